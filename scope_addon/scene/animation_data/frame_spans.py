# SPDX-License-Identifier: GPL-3.0-or-later
"""Spans of scene frames, as results and markers in a .blend file have them: ``12-18,40``. Loaded
while Blender starts.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ...review_spans import Span

_SPAN = re.compile(r"(-?\d{1,7})(?:-(-?\d{1,7}))?", re.ASCII)


class FrameSpan(NamedTuple):
    """The scene frames from ``first`` to ``last``, inclusive."""

    first: int
    last: int

    def __str__(self) -> str:
        return f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"


def in_scene(span: Span, frames: NDArray[np.float64]) -> FrameSpan:
    """Return a span of a motion in scene frames.

    :param frames: (T,) scene frame of each pose.
    """
    return FrameSpan(round(float(frames[span.first])), round(float(frames[span.last])))


def parse_spans(text: str) -> list[FrameSpan]:
    """Read spans; parts that are none are left out."""
    found = [_SPAN.fullmatch(part) for part in text.split(",")]
    return [FrameSpan(int(span[1]), int(span[2] or span[1])) for span in found if span]


def spans_text(spans: Sequence[FrameSpan]) -> str:
    """Write spans so that ``parse_spans`` reads them."""
    return ",".join(map(str, spans))
