# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in each of its languages, in a Blender that has them: bpy from the package index
has none.

Usage: ``blender --background --python-exit-code 1 --python languages.py``, with the extension
enabled.
"""

from __future__ import annotations

import sys

import bpy
from bpy.app.translations import contexts, pgettext_iface, pgettext_tip

# Blender's code of each language of our table.
LANGUAGES = {"de_DE": "de", "fr_FR": "fr", "es": "es", "ja_JP": "ja", "zh_HANS": "zh"}


def shown() -> tuple[str, str, str, str]:
    """Return a button, a label, a tooltip and an option whose name means something else in
    Blender.
    """
    return (
        pgettext_iface("Compare with Footage", contexts.operator_default),
        pgettext_iface("Footage Opacity"),
        pgettext_tip("Video or image of a person to capture"),
        pgettext_iface("Fast", "Scope"),
    )


translations = next(
    module for name, module in sys.modules.items() if name.endswith(".scope_addon.ui.translations")
)
view = bpy.context.preferences.view
english = shown()
view.use_translate_interface = view.use_translate_tooltips = True
table = translations.read_table()
for code, language in LANGUAGES.items():
    assert code in bpy.app.translations.locales, (code, bpy.app.translations.locales)
    view.language = code
    labels = {entry["en"]: entry[language] for entry in table.operators}
    texts = {entry["en"]: entry[language] for entry in table.texts}
    expected = (labels[english[0]], *(texts[text] for text in english[1:]))
    assert shown() == expected, (shown(), expected)
    translations.detach()
    assert shown() == english, shown()
    translations.attach()
    assert shown() == expected, shown()
print("languages:", ", ".join(LANGUAGES), flush=True)
