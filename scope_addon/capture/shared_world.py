# SPDX-License-Identifier: GPL-3.0-or-later
"""One world for all people of a clip: which way is up, where the floor is, and who stands on something else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.body import Body
from ...solver.frames import world_from_level_camera
from .assemble import place_in_camera
from .fitting import FittedTrack
from .track import Track
from .world import up_from_floor, up_from_standing

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


def share_world(body: Body, tracks: list[Track], fits: list[FittedTrack], smoothing: bool) -> SharedWorld:
    """Up from all bodies and all floors together, the floor and the origin from the first, most prominent person.

    Each person's feet count from their own mean place, so that neither a step nor a wrong distance tilts the world.
    """
    placed = [place_in_camera(body, track, fit, smoothing) for track, fit in zip(tracks, fits, strict=True)]
    up = up_from_standing(body, np.concatenate([joints for joints, _ in placed]))
    centered = [soles - _lowest(soles, up).mean(axis=0) for _, soles in placed]
    up = up_from_floor(np.concatenate(centered), up)
    heights = [float(np.median(_lowest(soles, up) @ up)) for _, soles in placed]
    T_world_camera = world_from_level_camera(up, height=-heights[0])
    start = T_world_camera[:3, :3] @ placed[0][0][0, 0] + T_world_camera[:3, 3]
    T_world_camera[:2, 3] -= start[:2]
    own = [height - heights[0] for height in heights]
    return SharedWorld(T_world_camera, [h if abs(h) > SAME_FLOOR_M else 0.0 for h in own])


def _lowest(soles_cam: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(T, 3) the lowest sole point of each frame."""
    return soles_cam[np.arange(len(soles_cam)), (soles_cam @ up).argmin(axis=1)]
