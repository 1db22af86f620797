# SPDX-License-Identifier: GPL-3.0-or-later
"""The sets of rendered faces: what people do, how they are seen, and what they wear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from .sequences import FaceClip, in_motion, random_poses, talk_and_grimaces, turned_away


@dataclass(frozen=True)
class FaceSet:
    """``draw`` with a seed and sizes makes the clip, ``change`` what differs from another set with
    the same seed.

    ``worn``: a style of glasses, or a beard; ``blurred``: by motion; ``cycles``: rendered with
    light and shadows.
    """

    draw: Callable[..., FaceClip]
    seed: int
    sizes: dict[str, Any]
    cycles: bool = True
    change: Callable[[FaceClip], FaceClip] = field(default=lambda clip: clip)
    worn: str = ""
    blurred: bool = False


def _held_out(**what: Any) -> FaceSet:
    return FaceSet(talk_and_grimaces, 22, {"people": 4, "seconds": 5.0}, **what)


def _condition(change: Callable[[FaceClip], FaceClip] = lambda clip: clip, **what: Any) -> FaceSet:
    return _held_out(change=change, cycles=False, **what)


SETS: dict[str, FaceSet] = {
    "poses": FaceSet(random_poses, 11, {"people": 100, "each": 25}, cycles=False),
    "shaded_talk": FaceSet(talk_and_grimaces, 14, {"people": 8, "seconds": 5.0}, cycles=False),
    "talk": FaceSet(talk_and_grimaces, 12, {"people": 6, "seconds": 5.0}),
    "talk_held_out": _held_out(),
    "talk_plain": _condition(),
    "talk_turned_away": _condition(turned_away),
    "talk_in_motion": _condition(in_motion, blurred=True),
    "talk_thin_glasses": _condition(worn="thin glasses"),
    "talk_thick_glasses": _condition(worn="thick glasses"),
    "talk_reflections": _held_out(worn="thick glasses"),
    "talk_dark_glasses": _condition(worn="dark glasses"),
    "talk_beard": _condition(worn="beard"),
    "talk_half_minute": FaceSet(
        talk_and_grimaces, 23, {"people": 1, "seconds": 30.0}, cycles=False
    ),
}
