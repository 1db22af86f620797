# SPDX-License-Identifier: GPL-3.0-or-later
"""What a table of translations has in common with the English texts."""

from __future__ import annotations

import re
import string
from collections.abc import Mapping


def assert_have_the_same_placeholders(table: Mapping[str, str]) -> None:
    for text, translation in table.items():
        assert _placeholders(translation) == _placeholders(text), text


def assert_end_as_the_english_texts(table: Mapping[str, str]) -> None:
    """Blender's labels and tooltips have no full stop at their end, and no spaces around."""
    for text, translation in table.items():
        assert translation, text
        assert translation == translation.strip(), text
        assert not translation.endswith((".", "。")) or text.endswith("."), text
        assert translation.endswith(("?", "？")) == text.endswith("?"), text


def _placeholders(text: str) -> list[str]:
    """Names and formats in braces, and printf's, each as often as it occurs."""
    fields = [
        f"{name}:{spec}" for _, name, spec, _ in string.Formatter().parse(text) if name is not None
    ]
    return sorted(fields + re.findall(r"%(?:\d+\$)?[sdif]", text))
