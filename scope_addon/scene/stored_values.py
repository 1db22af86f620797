# SPDX-License-Identifier: GPL-3.0-or-later
"""Custom properties of a .blend file, which anybody may have changed: any type, any length, any
number. What is not as this extension writes it is read as if it were not there.

Spans of scene frames are stored as text, ``12-18,40``. Loaded while Blender starts.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from bpy.types import ID, Action, Object

from .budget import LAST_FRAME

if TYPE_CHECKING:
    from ..arrays import Float64Array
    from ..review_spans import Span

# the least and the largest frame rate that Blender can store, frames per second
RATES = 0.01, 32767.0
# custom property of an armature: the scene's frame rate for which its keys were written
RATE = "scope_rate"
# custom property of an action: the name of the captured armature whose motion retargeting wrote
KEYS_OF = "scope_keys_of"
_LARGEST = 1e9  # of numbers in a list
_SPAN = re.compile(r"(-?\d{1,7})(?:-(-?\d{1,7}))?", re.ASCII)


def stored_number(block: ID, name: str, default: float, lowest: float, highest: float) -> float:
    """Return a number between two others; the default if the property is missing or something
    else.
    """
    value = block.get(name)
    return (
        float(value) if isinstance(value, int | float) and lowest <= value <= highest else default
    )


def stored_numbers(block: ID, name: str) -> list[float]:
    """Return a list of finite numbers; empty if the property is missing or something else."""
    value = block.get(name)
    # Blender's own type for lists of numbers
    values = value.to_list() if hasattr(value, "to_list") else value
    if not isinstance(values, list) or not all(
        isinstance(x, int | float) and abs(x) < _LARGEST for x in values
    ):
        return []
    return [float(x) for x in values]


def stored_text(block: ID, name: str) -> str:
    """Return a text; empty if the property is missing or something else."""
    value = block.get(name)
    return value if isinstance(value, str) else ""


def source_of(action: Action) -> str:
    """Return the name of the captured armature whose motion retargeting has written to an action;
    empty if unknown.
    """
    return stored_text(action, KEYS_OF)


def start_frame(armature: Object) -> float:
    """Return the scene frame of a captured armature's timestamp 0."""
    return stored_number(armature, "scope_start", 0.0, -LAST_FRAME, LAST_FRAME)


def stored_rate(armature: Object, default: float) -> float:
    """Return the frame rate for which a captured armature's keys were written; the default if it is
    not stored.
    """
    return stored_number(armature, RATE, default, *RATES)


def smoothing_of(armature: Object) -> float:
    """Return the strength with which a captured armature's motion was smoothed last."""
    return stored_number(armature, "scope_smoothing", 1.0, 0.0, 20.0)


class FrameSpan(NamedTuple):
    """The scene frames from ``first`` to ``last``, inclusive."""

    first: int
    last: int

    def __str__(self) -> str:
        return f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"


def in_scene(span: Span, frames: Float64Array) -> FrameSpan:
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
