# SPDX-License-Identifier: GPL-3.0-or-later
"""One world for all people of a clip: which way is up, where the floor is, and who stands on something else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.frames import transform_points, world_from_level_camera
from .line_segments import Lines
from .placement import PlacedTrack
from .world import floor_height, up_from_bodies, upright

SAME_FLOOR_M = 0.4  # how far apart, for their distances are not known well, the feet of people on one floor may seem


@dataclass(frozen=True)
class SharedWorld:
    """``T_world_camera`` (4, 4) for everybody, and the height of each person's own floor in it, metres."""

    T_world_camera: np.ndarray
    floors_m: list[float]

    def floor_from_camera(self, person: int) -> np.ndarray:
        """(4, 4) as ``T_world_camera``, with the person's own floor at z = 0."""
        T = self.T_world_camera.copy()
        T[2, 3] -= self.floors_m[person]
        return T


def share_world(placed: list[PlacedTrack], lines: Lines | None = None) -> SharedWorld:
    """Up from the background's lines, or from all bodies and floors together; the floor and the origin from the first,
    most prominent person.

    Each person's feet count from their own mean place, so that neither a step nor a wrong distance tilts the world.
    """
    all_soles = [person.soles[person.valid] for person in placed]
    up = up_from_bodies(placed)
    centered = [soles - _lowest(soles, up).mean(axis=0) for soles in all_soles]
    up = upright(up, np.concatenate(centered), lines)
    stands = [person.contact(up)[person.valid] for person in placed]
    heights = [floor_height(soles, contact, up) for soles, contact in zip(all_soles, stands, strict=True)]
    T_world_camera = world_from_level_camera(up, height=-heights[0])
    start = transform_points(T_world_camera, placed[0].joints[placed[0].valid.argmax(), :1])[0]
    T_world_camera[:2, 3] -= start[:2]
    own = [height - heights[0] for height in heights]
    return SharedWorld(T_world_camera, [h if abs(h) > SAME_FLOOR_M else 0.0 for h in own])


def _lowest(soles_cam: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(T, 3) the lowest sole point of each frame."""
    return soles_cam[np.arange(len(soles_cam)), (soles_cam @ up).argmin(axis=1)]
