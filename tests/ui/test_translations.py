# SPDX-License-Identifier: GPL-3.0-or-later
"""Every text of the interface has a translation in each language, with the same placeholders; none
is left over.

The bpy of the Python package index has no languages to switch to: ./scripts/blender --part panel
does that.
"""

from __future__ import annotations

import bpy
import pytest
from scope.scope_addon.options import Place, options_at
from scope.scope_addon.ui import reporting
from scope.scope_addon.ui.translations import CONTEXT, LANGUAGES

from .interface_texts import CORRECTIONS, OPERATOR, ROOT, interface_texts, texts_without_lookup
from .tables import assert_end_as_the_english_texts, assert_have_the_same_placeholders

MODULES = {module.__name__.rpartition(".")[2]: module for module in LANGUAGES.values()}
every_language = pytest.mark.parametrize("language", MODULES.values(), ids=MODULES)


@every_language
def test_every_text_is_translated(language):
    assert {text for context, text in interface_texts() if context != OPERATOR} - set(
        language.TEXTS
    ) == set()


@every_language
def test_no_translation_is_left_over(language):
    assert (
        set(language.TEXTS) - {text for context, text in interface_texts() if context != OPERATOR}
        == set()
    )


@every_language
def test_placeholders_are_the_same(language):
    assert_have_the_same_placeholders(language.TEXTS)


@every_language
def test_translations_end_as_the_english_texts_do(language):
    assert_end_as_the_english_texts(language.TEXTS)


def test_the_texts_found_come_from_classes_layouts_reports_and_lists():
    texts = interface_texts()
    assert ("Operator", "Capture") in texts  # bl_label
    assert (CONTEXT, "Balanced") in texts  # enumeration of a declared option
    assert ("*", "Footage Opacity") in texts  # literal in a layout
    assert ("Operator", "Left Foot Stands") in texts  # literal that a loop gives to a layout
    assert (CONTEXT, "{count} people") in texts  # either branch of a lookup's condition
    assert ("*", "Capture finished") in texts  # report


@pytest.mark.parametrize(
    "language", [MODULES[code] for code in ("de", "es", "fr")], ids=("de", "es", "fr")
)
def test_labels_fit_into_a_sidebar_of_the_usual_width(language):
    """Characters that fit, counted on screen: a checkbox of the options has room for 20, a listed
    correction for 18.
    """
    options = {
        each.blender.label or each.name
        for each in options_at(Place.PANEL)
        if each.value_type is bool
    }
    for text in options & set(language.TEXTS):
        assert len(language.TEXTS[text]) <= 20, text
    for text in CORRECTIONS - {"Interpolated"}:
        assert len(language.TEXTS[text]) <= 18, text


def test_languages_that_share_a_code_are_those_of_blender():
    assert set(LANGUAGES) == {"de", "fr", "es", "ja", "zh_HANS", "zh_CN"}
    assert LANGUAGES["zh_HANS"] is LANGUAGES["zh_CN"]


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
