# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in other languages: the table ``translations.txt``, registered with
``bpy.app.translations``. Error messages of the solver stay English.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import bpy

# Blender's own translations come first. In this context it has none, so ours hold where the same
# English word means something else in Blender.
CONTEXT = "Scope"
ENGLISH = "en"
# Blender's codes of a language, by the code in the table. A code without a country holds for all
# countries: Blender asks for "de_DE" and takes "de". Not so "zh", which could be the traditional
# script as well; "zh_CN" is its name in other versions.
BLENDER_CODES = {
    "de": ("de",),
    "fr": ("fr",),
    "es": ("es",),
    "ja": ("ja",),
    "zh": ("zh_HANS", "zh_CN"),
}
# Languages that are written without spaces between words.
_WITHOUT_SPACES = ("ja", "zh")
_INDENT = "    "


class Table(NamedTuple):
    """The entries of the table, each a text by language.

    :param operators: labels of operators, which are buttons and entries of menus.
    :param texts: everything else.
    """

    operators: list[dict[str, str]]
    texts: list[dict[str, str]]


def read_table() -> Table:
    """Read ``translations.txt``, whose head describes its form."""
    sections: dict[str, list[dict[str, str]]] = {"operators": [], "texts": []}
    entries: list[dict[str, str]] = []
    entry: dict[str, str] = {}
    language = ""
    content = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
    for line in content.splitlines():
        if line.startswith("#") or not line:
            continue
        if line.startswith("["):
            entries = sections[line.strip("[]")]
        elif line.startswith(_INDENT):
            space = "" if language in _WITHOUT_SPACES else " "
            entry[language] += space + line[len(_INDENT) :]
        else:
            language, _, text = line.partition("  ")
            if language == ENGLISH:
                entry = {}
                entries.append(entry)
            entry[language] = text
    return Table(**sections)


def blender_translations() -> dict[str, dict[tuple[str, str], str]]:
    """Return the table as Blender wants it: for each of its codes, the translation of each pair of
    a context and an English text.
    """
    table = read_table()
    contexts = bpy.app.translations.contexts
    by_code: dict[str, dict[tuple[str, str], str]] = {}
    for language, codes in BLENDER_CODES.items():
        translations = {}
        for entry in table.texts:
            translations[contexts.default, entry[ENGLISH]] = entry[language]
            translations[CONTEXT, entry[ENGLISH]] = entry[language]
        for entry in table.operators:
            translations[contexts.operator_default, entry[ENGLISH]] = entry[language]
        for code in codes:
            by_code[code] = translations
    return by_code


def attach() -> None:
    """Add the translations to Blender's."""
    bpy.app.translations.register(__name__, blender_translations())


def detach() -> None:
    """Remove the translations."""
    bpy.app.translations.unregister(__name__)
