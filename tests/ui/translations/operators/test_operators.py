# SPDX-License-Identifier: GPL-3.0-or-later
"""Every button and menu entry has a label in each language, and no label is left over."""

from __future__ import annotations

import pytest
from scope.scope_addon.ui.translations.operators import de, es, fr, ja, zh

from ..interface_texts import OPERATOR, interface_texts
from ..tables import assert_end_as_the_english_texts, assert_have_the_same_placeholders

MODULES = {module.__name__.rpartition(".")[2]: module for module in (de, es, fr, ja, zh)}


@pytest.mark.parametrize("language", MODULES.values(), ids=MODULES)
def test_the_labels_are_those_of_the_operators(language):
    assert set(language.OPERATORS) == {
        text for context, text in interface_texts() if context == OPERATOR
    }


@pytest.mark.parametrize("language", MODULES.values(), ids=MODULES)
def test_labels_have_the_form_of_the_english_ones(language):
    assert_have_the_same_placeholders(language.OPERATORS)
    assert_end_as_the_english_texts(language.OPERATORS)
