# SPDX-License-Identifier: GPL-3.0-or-later
"""Every text of the interface has a translation in each language, with the same placeholders; none
is left over.

The bpy of the Python package index has no languages to switch to: ./scripts/blender --part panel
does that.
"""

from __future__ import annotations

import re
import string
from pathlib import Path

import bpy
import pytest
from scope.scope_addon.options import Place, options_at
from scope.scope_addon.ui import reporting
from scope.scope_addon.ui import translations as translations_module
from scope.scope_addon.ui.translations import (
    BLENDER_CODES,
    CONTEXT,
    ENGLISH,
    blender_translations,
    read_table,
)

from .interface_texts import (
    CORRECTIONS,
    OPERATOR,
    ROOT,
    interface_texts,
    texts_without_lookup,
)

TABLE = read_table()
ENTRIES = [*TABLE.operators, *TABLE.texts]
every_language = pytest.mark.parametrize("language", BLENDER_CODES)


def test_every_entry_has_a_text_in_every_language():
    columns = [ENGLISH, *BLENDER_CODES]
    assert [entry for entry in ENTRIES if list(entry) != columns] == []
    assert [entry for entry in ENTRIES if not all(entry.values())] == []


def test_the_table_has_exactly_the_texts_of_the_interface():
    labels = {text for context, text in interface_texts() if context == OPERATOR}
    texts = {text for context, text in interface_texts() if context != OPERATOR}
    assert {entry[ENGLISH] for entry in TABLE.operators} == labels
    assert {entry[ENGLISH] for entry in TABLE.texts} == texts


def test_no_text_stands_in_the_table_twice():
    assert len(TABLE.texts) == len({entry[ENGLISH] for entry in TABLE.texts})
    assert len(TABLE.operators) == len({entry[ENGLISH] for entry in TABLE.operators})


def test_the_table_is_at_most_100_columns_wide():
    content = Path(translations_module.__file__).with_suffix(".txt").read_text(encoding="utf-8")
    wide = [line for line in content.splitlines() if len(line) > 100 or line != line.rstrip()]
    assert wide == []


@every_language
def test_placeholders_are_the_same(language):
    for entry in ENTRIES:
        assert _placeholders(entry[language]) == _placeholders(entry[ENGLISH]), entry[ENGLISH]


@every_language
def test_translations_end_as_the_english_texts_do(language):
    """Blender's labels and tooltips have no full stop at their end, and no spaces around."""
    for entry in ENTRIES:
        text = entry[ENGLISH]
        translation = entry[language]
        assert translation == translation.strip(), text
        assert not translation.endswith((".", "。")) or text.endswith("."), text
        assert translation.endswith(("?", "？")) == text.endswith("?"), text


def test_the_texts_found_come_from_classes_layouts_reports_and_lists():
    texts = interface_texts()
    assert ("Operator", "Capture") in texts  # bl_label
    assert (CONTEXT, "Balanced") in texts  # enumeration of a declared option
    assert ("*", "Footage Opacity") in texts  # literal in a layout
    assert ("Operator", "Left Foot Stands") in texts  # literal that a loop gives to a layout
    assert (CONTEXT, "{count} people") in texts  # either branch of a lookup's condition
    assert ("*", "Capture finished") in texts  # report


@pytest.mark.parametrize("language", ["de", "es", "fr"])
def test_labels_fit_into_a_sidebar_of_the_usual_width(language):
    """Characters that fit, counted on screen: a checkbox of the options has room for 20, a listed
    correction for 18.
    """
    texts = {entry[ENGLISH]: entry[language] for entry in TABLE.texts}
    options = {
        each.blender.label or each.name
        for each in options_at(Place.PANEL)
        if each.value_type is bool
    }
    for text in options & set(texts):
        assert len(texts[text]) <= 20, text
    for text in CORRECTIONS - {"Interpolated"}:
        assert len(texts[text]) <= 18, text


def test_blender_is_given_every_language_under_each_of_its_codes():
    given = blender_translations()
    assert set(given) == {"de", "fr", "es", "ja", "zh_HANS", "zh_CN"}
    assert given["de"]["Operator", "Match Frame Rate"] == "Bildrate angleichen"
    assert given["zh_CN"]["*", "Camera"] == given["zh_HANS"][CONTEXT, "Camera"] == "摄像机"


def test_a_text_has_its_values_filled_in():
    assert reporting.iface_("{count} people", count=3) == "3 people"
    assert reporting.iface_("100 %") == "100 %"


def test_braces_in_a_value_are_kept():
    assert reporting.rpt_("Saved {file}", file="{a}.json") == "Saved {a}.json"


def test_messages_and_composed_texts_are_looked_up():
    found = {path.name: texts_without_lookup(path) for path in (ROOT / "ui").rglob("*.py")}
    assert {name: texts for name, texts in found.items() if texts} == {}


def test_a_composed_text_that_is_not_looked_up_is_found(tmp_path):
    path = tmp_path / "panel.py"
    path.write_text(
        'cls.poll_message_set("Choose one")\nlayout.label(text=f"{n} '
        'frames")\nself.report({"INFO"}, f"Freed {n}")\n'
        'layout.label(text=iface_("{n} frames", n=n))\nlayout.label(text=f"{n} %")\n'
    )
    assert texts_without_lookup(path) == ["Choose one", " frames", "Freed "]


def test_buttons_in_a_row_have_our_short_words_in_place_of_blenders():
    settings = bpy.types.Scene.bl_rna.properties["scope_retarget"].fixed_type
    assert settings.properties["captured"].translation_context == CONTEXT


def _placeholders(text: str) -> list[str]:
    """Names and formats in braces, and printf's, each as often as it occurs."""
    fields = [
        f"{name}:{spec}" for _, name, spec, _ in string.Formatter().parse(text) if name is not None
    ]
    return sorted(fields + re.findall(r"%(?:\d+\$)?[sdif]", text))
