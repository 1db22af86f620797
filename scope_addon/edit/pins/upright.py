# SPDX-License-Identifier: GPL-3.0-or-later
"""Turning a motion and its camera so that a line that the user drew in the image is upright.

The line and the camera's centre span a plane with the normal n; what is upright in the world lies in it. Of all such
directions the nearest to the present up z is u = z − (z·n) n, normalized. The rotation from u to z is applied to
everything about a point on the floor, after which the feet are again as high as they were.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ....solver.rotations import shortest_turn
from ...errors import UsageError
from ...kinematics.standing import standing_probability
from ...motion import Motion
from ..clip import clip_from_motion
from .corrected_motion import shot_of

_UP = np.array([0.0, 0.0, 1.0])
_LARGEST = np.radians(40.0)
_SHORTEST_PX = 10.0


def upright_transform(
    motion: Motion, body: Body, frame: int, line: tuple[tuple[float, float], tuple[float, float]]
) -> NDArray[np.float64]:
    """Return the rigid transform (4, 4) of the world after which a line in the image is upright.

    :param frame: source frame.
    :param line: two pixels of the upright frame, without lens distortion.
    :raises UsageError: the line is too short, or farther from upright than any tilt of a camera explains.
    """
    a, b = np.array(line, float)
    if np.linalg.norm(a - b) < _SHORTEST_PX:
        raise UsageError(f"the line is shorter than {_SHORTEST_PX:.0f} pixels; draw a longer one")
    T_world_camera, K = shot_of(motion).camera(frame)
    rays = np.linalg.solve(K, np.stack([[*a, 1.0], [*b, 1.0]], axis=1)).T @ T_world_camera[:3, :3].T
    normal = np.cross(rays[0], rays[1])
    normal /= np.linalg.norm(normal)
    u = _UP - (_UP @ normal) * normal
    angle = np.arcsin(np.clip(abs(_UP @ normal), 0.0, 1.0))
    if angle > _LARGEST:
        raise UsageError(
            f"the line is {np.degrees(angle):.0f} degrees from upright; draw it along something that stands, such as a "
            "door or a wall's edge"
        )
    turn = shortest_turn(u / np.linalg.norm(u), _UP)
    clip = clip_from_motion(body, motion, raw=False)
    soles = clip.soles(body, motion.betas)
    standing = standing_probability(soles, _UP, clip.times) > 0.5
    points = soles[standing] if standing.any() else soles.reshape(-1, 3)
    pivot = points.mean(axis=0) * [1.0, 1.0, 0.0]
    moved = (points - pivot) @ turn.T + pivot
    out = np.eye(4)
    out[:3, :3] = turn
    out[:3, 3] = pivot - turn @ pivot + _UP * (np.median(points[:, 2]) - np.median(moved[:, 2]))
    return out
