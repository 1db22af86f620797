# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels and tooltips of the declared options are there in each language, and nothing else is among
them.
"""

from __future__ import annotations

import pytest
from scope.scope_addon.options import OPTIONS
from scope.scope_addon.ui.translations import de as german
from scope.scope_addon.ui.translations.options import de, es, fr, ja, zh

MODULES = {module.__name__.rpartition(".")[2]: module for module in (de, es, fr, ja, zh)}
DECLARED = {
    text.lower()
    for each in OPTIONS
    for text in (each.help, each.blender.label if each.blender else "")
    if text
}


@pytest.mark.parametrize("language", MODULES.values(), ids=MODULES)
def test_the_texts_are_those_of_declared_options(language):
    assert {text.lower() for text in language.OPTIONS} <= DECLARED
    assert set(language.OPTIONS) == set(de.OPTIONS)
    assert all(language.OPTIONS.values())


def test_no_text_of_an_option_is_elsewhere():
    elsewhere = {text.lower() for text in german.TEXTS} - {text.lower() for text in de.OPTIONS}
    assert not elsewhere & DECLARED
