# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that several cameras film at once: two, 60 degrees apart, on tripods, in a room."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from ...scope_addon.arrays import Uint8Array
from ...solver import Body
from .footage import Camera, draw_clip
from .surroundings import Surroundings
from .walk import Walk, Walker

SECONDS = 7.0
APART_DEG = 60.0
DISTANCE_M = 4.2
WRONG_S = (2.0, 4.0)  # of the scene, where a camera shows something else
ROOM = 3  # its seed
NTSC = Fraction(60000, 1001)


@dataclass(frozen=True)
class ViewScene:
    """Who is filmed, and how."""

    walks: tuple[Walk, ...]
    second: Camera
    is_flipped: bool = False  # the second camera's picture, in `WRONG_S`
    is_other: bool = False  # the second camera shows somebody else, in `WRONG_S`


def camera_at(angle_deg: float, height_m: float) -> Camera:
    """Return a camera that looks at the middle of the room from a direction, 0 from −y."""
    angle = np.radians(angle_deg)
    eye = np.array([DISTANCE_M * np.sin(angle), -DISTANCE_M * np.cos(angle), height_m])
    target = np.array([0.0, 0.0, 0.95])
    return Camera(lambda _: eye, lambda _: target)


FIRST = camera_at(-APART_DEG / 2, 1.4)
SECOND = camera_at(APART_DEG / 2, 1.2)
ALONE = (Walk.around((0.0, 0.0), 0.8, 0.0, 1),)
PAIR = (
    Walk.around((-0.75, 0.35), 0.5, 40.0, 2),
    Walk.around((0.75, -0.35), 0.5, 220.0, 3),
)
OTHER = Walk.around((0.2, 0.3), 0.5, 120.0, 4)
SCENES = {
    "together": ViewScene(ALONE, SECOND),
    "later": ViewScene(ALONE, replace(SECOND, start_s=1.87)),
    "other_rate": ViewScene(ALONE, replace(SECOND, start_s=-0.63, fps=NTSC)),
    "two_people": ViewScene(PAIR, SECOND),
    "flipped": ViewScene(ALONE, SECOND, is_flipped=True),
    "somebody_else": ViewScene(ALONE, SECOND, is_other=True),
}


def draw_scene(body: Body, name: str, folder: Path) -> tuple[Path, Path]:
    """Draw the clips of a scene where they are missing; return them, the first camera's first."""
    scene = SCENES[name]
    surroundings = Surroundings.room(ROOM)
    walkers = [Walker(body, walk) for walk in scene.walks]
    first = folder / ("pair_first.mp4" if len(walkers) > 1 else "alone_first.mp4")
    second = folder / f"{name}_second.mp4"
    if not first.is_file():
        draw_clip(first, surroundings, walkers, FIRST, SECONDS)
    if not second.is_file():
        change = _flip if scene.is_flipped else _keep
        others = [_Swapped(walkers[0], Walker(body, OTHER))] if scene.is_other else walkers
        draw_clip(second, surroundings, others, scene.second, SECONDS, change)
    return first, second


class _Swapped(Walker):
    """Somebody in whose place somebody else is for a while."""

    def __init__(self, walker: Walker, other: Walker) -> None:
        super().__init__(walker.body, walker.walk, walker.betas)
        self._other = other

    def pose(self, time_s: float):
        return self._other.pose(time_s) if _is_wrong(time_s) else super().pose(time_s)


def _is_wrong(time_s: float) -> bool:
    return WRONG_S[0] <= time_s < WRONG_S[1]


def _keep(_: float, image: Uint8Array) -> Uint8Array:
    return image


def _flip(time_s: float, image: Uint8Array) -> Uint8Array:
    return np.ascontiguousarray(image[:, ::-1]) if _is_wrong(time_s) else image
