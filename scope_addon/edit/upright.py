# SPDX-License-Identifier: GPL-3.0-or-later
"""Turning a motion and its camera so that a line that the user drew in the image or in another view
is upright.

The line and the camera's centre, or the direction of an orthographic view, span a plane with the
normal n; what is upright in the world lies in it. Of all such directions the nearest to the present
up z is u = z − (z·n) n, normalized. The rotation from u to z is applied to everything about a point
on the floor, after which the feet are again as high as they were. A line determines the tilt across
the direction of its view, so the image shows a roll, and a view from the side a lean towards the
camera or away from it.

Where *Snap Feet to Floor* has levelled the motion, it has turned it without the camera. A line is
drawn in that levelled world, so the camera is turned likewise, before both are turned by the line.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp, log, shortest_turn
from ..arrays import Float64Array
from ..errors import UsageError
from ..kinematics.axes import UP, transposed
from ..kinematics.standing import standing_probability
from ..motion import Motion
from .clip import clip_from_motion
from .corrected_motion import corrections_of, shot_of, with_corrections
from .corrections import feet_on_floor

_LARGEST = np.radians(40.0)
_SHORTEST_PX = 10.0
_SHORTEST_M = 0.1
_SIDE = np.radians(30.0)  # A view from a side deviates from level by at most this angle.


def upright_transform(
    motion: Motion, body: Body, frame: int, line: tuple[tuple[float, float], tuple[float, float]]
) -> Float64Array:
    """Return the rigid transform (4, 4) of the world, not levelled, after which a line in the image
    is upright.

    :param frame: source frame.
    :param line: two pixels of the upright frame, without lens distortion.
    :raises UsageError: the line is too short, or farther from upright than any tilt of a camera
        explains.
    """
    a, b = np.array(line, float)
    if np.linalg.norm(a - b) < _SHORTEST_PX:
        raise UsageError(f"the line is shorter than {_SHORTEST_PX:.0f} pixels; draw a longer one")
    levelling = _levelling(motion, body)
    T_world_camera, K = shot_of(motion).camera(frame)
    T_world_camera = levelling @ T_world_camera
    rays = np.linalg.solve(K, np.stack([[*a, 1.0], [*b, 1.0]], axis=1)).T @ T_world_camera[:3, :3].T
    return _transform(motion, body, np.cross(rays[0], rays[1])) @ levelling


def upright_transform_in_view(
    motion: Motion,
    body: Body,
    line: tuple[Float64Array, Float64Array],
    direction: Float64Array,
) -> Float64Array:
    """Return the rigid transform (4, 4) of the world, not levelled, after which a line in an
    orthographic view is upright.

    :param line: two points (3,) on the line, metres, world; how far away they are in the view does
        not matter.
    :param direction: (3,) in which the view looks, world.
    :raises UsageError: the view is none from a side, or the line is too short or too far from
        upright.
    """
    direction = np.asarray(direction, float)
    if not abs(direction @ UP) < np.sin(_SIDE) * np.linalg.norm(direction):
        raise UsageError("the line needs a view from a side, such as Blender's front or right view")
    along = np.subtract(line[1], line[0])
    across = np.cross(direction / np.linalg.norm(direction), along)
    if np.linalg.norm(across) < _SHORTEST_M:
        raise UsageError(f"the line is shorter than {100 * _SHORTEST_M:.0f} cm; draw a longer one")
    return _transform(motion, body, across) @ _levelling(motion, body)


def _levelling(motion: Motion, body: Body) -> Float64Array:
    """Return the rigid transform (4, 4) by which putting feet on the floor has levelled a motion;
    the identity where it has not.
    """
    out = np.eye(4)
    corrections = corrections_of(motion)
    feet = feet_on_floor(corrections)
    if feet is None or not feet.level:
        return out
    without = tuple(replace(c, level=False) if c is feet else c for c in corrections)
    before = clip_from_motion(body, with_corrections(motion, body, without), raw=False)
    after = clip_from_motion(body, motion, raw=False)
    # The median, because pins turn the body in a few frames.
    turns = after.rotations[:, 0] @ transposed(before.rotations[:, 0])
    out[:3, :3] = exp(np.median(log(turns), axis=0))
    out[:3, 3] = np.median(after.root - before.root @ out[:3, :3].T, axis=0)
    return out


def _transform(motion: Motion, body: Body, normal: Float64Array) -> Float64Array:
    """Return the transform (4, 4) after which a plane in which something stands is upright.

    :param normal: (3,) of the plane, of any length.
    :raises UsageError: the plane is farther from upright than any tilt of a camera explains.
    """
    normal = normal / np.linalg.norm(normal)
    u = UP - (UP @ normal) * normal
    angle = np.arcsin(np.clip(abs(UP @ normal), 0.0, 1.0))
    if angle > _LARGEST:
        raise UsageError(
            f"the line is {np.degrees(angle):.0f} degrees from upright; draw it along something "
            "upright, such as a "
            "door or a wall's edge"
        )
    turn = shortest_turn(u / np.linalg.norm(u), UP)
    clip = clip_from_motion(body, motion, raw=False)
    soles = clip.soles(body, motion.betas)
    seen = motion.valid if motion.valid.any() else np.ones(len(motion), bool)
    standing = standing_probability(soles, UP, motion.times_with_gaps) > 0.5
    standing &= seen[:, None]
    points = soles[standing] if standing.any() else soles[seen].reshape(-1, 3)
    pivot = points.mean(axis=0) * [1.0, 1.0, 0.0]
    moved = (points - pivot) @ turn.T + pivot
    out = np.eye(4)
    out[:3, :3] = turn
    out[:3, 3] = pivot - turn @ pivot + UP * (np.median(points[:, 2]) - np.median(moved[:, 2]))
    return out
