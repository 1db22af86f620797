# SPDX-License-Identifier: GPL-3.0-or-later
"""What the progress of a capture says is there in each language, and filled in with the same
values.
"""

from __future__ import annotations

import pytest
from scope.scope_addon.ui.translations.stages import de, es, fr, ja, zh

from ..interface_texts import stage_texts

MODULES = {module.__name__.rpartition(".")[2]: module for module in (de, es, fr, ja, zh)}
VALUES = {"stage": "<stage>", "done": 12, "total": 34, "rate": 5.67, "time": "<time>"}


@pytest.mark.parametrize("language", MODULES.values(), ids=MODULES)
def test_the_texts_are_those_of_the_progress(language):
    assert set(language.STAGES) == stage_texts()


@pytest.mark.parametrize("language", MODULES.values(), ids=MODULES)
def test_a_text_says_the_same_values_in_every_language(language):
    for text, translation in language.STAGES.items():
        said = translation.format(**VALUES)
        for name, value in VALUES.items():
            shown = f"{value:.1f}" if name == "rate" else str(value)
            assert (shown in said) == (shown in text.format(**VALUES)), translation
