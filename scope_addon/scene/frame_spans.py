# SPDX-License-Identifier: GPL-3.0-or-later
"""Spans of scene frames, as a result in a .blend file has them: ``12-18,40``. Standard library
only.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

_SPAN = re.compile(r"(-?\d{1,7})(?:-(-?\d{1,7}))?", re.ASCII)


class FrameSpan(NamedTuple):
    """The scene frames from ``first`` to ``last``, inclusive."""

    first: int
    last: int

    def __str__(self) -> str:
        return f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"


def parse_spans(text: str) -> list[FrameSpan]:
    """Read spans; parts that are none are left out."""
    found = [_SPAN.fullmatch(part) for part in text.split(",")]
    return [FrameSpan(int(span[1]), int(span[2] or span[1])) for span in found if span]


def spans_text(spans: Sequence[FrameSpan]) -> str:
    """Write spans so that ``parse_spans`` reads them."""
    return ",".join(map(str, spans))
