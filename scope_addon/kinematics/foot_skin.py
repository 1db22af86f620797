# SPDX-License-Identifier: GPL-3.0-or-later
"""The lowest points of the feet's skin: how far a posed body's feet are above the floor, or below
it.

Contact points (`contact_points`) are where a flat foot touches the floor. A foot that rolls over
its heel or its toes is lower at its end, by two centimetres and more, so the skin itself decides
whether a foot is under the floor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp
from ..arrays import BoolArray, Float64Array, FloatArray, IndexArray
from ..motion import Motion
from ..scene_gaps import usual_step_s
from .axes import UP
from .contact_points import FOOT_PARTS, with_points_on_parts
from .frame_blocks import by_blocks
from .sequences import runs
from .standing import LEVEL_M

UNDER_FLOOR_M = 0.01  # A foot this deep counts as under the floor.
MIN_REST_S = 0.3  # Feet that rest more briefly may be at the turning point of a jump.
# Rests farther from the floor are no errors of a few centimetres, but may be on a step.
STEP_M = 0.1
DEPTH_ERROR_M = 0.5  # Largest depth error of a foot: none is taken for lower by more.
_DIRECTIONS = 400  # Directions in which the skin's outermost points are kept.


class FootSkin:
    """The skin of the feet, for one shape of a body, or that of other parts."""

    def __init__(self, body: Body, betas: FloatArray, parts: Sequence[str] = FOOT_PARTS) -> None:
        """Collect the vertices that move with each part, of which only the outermost matter.

        :param betas: (P,) shape coefficients.
        :param parts: their joints' names.
        """
        v = body.rest_vertices(betas)
        J = body.rest_joints(betas)
        self.parts = [body.joint_names.index(name) for name in parts]
        self.points: list[Float64Array] = []  # One (n, 3) for each part, from its joint.
        for part in self.parts:
            own = v[body.strongest_joints == part] - J[part]
            own = own if len(own) else np.zeros((1, 3))
            self.points.append(own[np.unique((_directions() @ own.T).argmax(axis=1))])

    def heights(
        self,
        R: FloatArray,
        t: FloatArray,
        up: FloatArray,
    ) -> Float64Array:
        """Return the (T, N) heights of each part's lowest point, relative to the origin.

        :param R, t: (T, K+1, 3, 3) and (T, K+1, 3) part poses in any frame.
        :param up: (3,) unit vector, in the same frame.
        """
        lowest = [
            (np.einsum("tji,j->ti", R[:, k], up) @ points.T).min(axis=1) + t[:, k] @ up
            for k, points in zip(self.parts, self.points, strict=True)
        ]
        return np.stack(lowest, axis=1)

    def as_keypoints(self, body: Body) -> tuple[Body, IndexArray]:
        """Add the skin's outermost points to the body as keypoints, and return their numbers, (n,),
        too.

        They are exact for this skin's betas; for others, they keep their positions relative to the
        joints.
        """
        points = np.concatenate(self.points)
        parts = np.repeat(np.array(self.parts, np.int32), [len(own) for own in self.points])
        names = (f"foot_skin/{k}" for k in range(len(points)))
        extended = with_points_on_parts(body, names, parts, points)
        return extended, len(body.keypoint_names) + np.arange(len(points))


def foot_heights(motion: Motion, body: Body, raw: bool = False) -> Float64Array:
    """Return the (T, 4) heights of the lowest skin of left heel, left toes, right heel and right
    toes; z = 0 the floor.

    :param body: the motion's body.
    :param raw: use the motion before smoothing and contact.
    """
    betas = np.asarray(motion.betas, float)
    skin = FootSkin(body, betas)

    def heights(poses: FloatArray, trans: FloatArray) -> tuple[Float64Array]:
        rotations = exp(poses.reshape(len(poses), -1, 3).astype(float))
        return (skin.heights(*body.forward_kinematics(rotations, trans.astype(float), betas), UP),)

    chosen = (motion.poses_raw, motion.trans_raw) if raw else (motion.poses, motion.trans)
    return by_blocks(heights, *chosen)[0]


def under_floor(motion: Motion, body: Body) -> BoolArray:
    """Return the (T,) frames in which a foot is more than `UNDER_FLOOR_M` under the floor; none on
    uneven ground.
    """
    return depth_under_floor(motion, body) > UNDER_FLOOR_M


def depth_under_floor(motion: Motion, body: Body) -> Float64Array:
    """Return how far the lowest foot of each frame is under the floor, (T,) metres; 0 above it and
    on uneven ground.
    """
    if motion.uneven_ground:
        return np.zeros(len(motion))
    return np.maximum(-foot_heights(motion, body).min(axis=1), 0.0)


def lower_floors(
    heights: FloatArray,
    contact: FloatArray,
    times: Float64Array,
) -> list[tuple[int, int]]:
    """Find the spans in which the feet walk or stand on another, lower floor, with the ways down
    and up.

    A foot rests in them more than `LEVEL_M` under the floor, or is farther below it than depth
    errors reach.

    :param heights: (T, F) of the feet's points above the floor, metres.
    :param contact: (T, F) probability that each of them rests on something.
    :param times: (T,) seconds.
    :return: the first row and the row after the last one of each span.
    """
    lowest = heights.min(axis=1)
    rests = ((contact > 0.5) & (heights < -LEVEL_M)).any(axis=1)
    found = []
    for first, end in runs(lowest < -LEVEL_M):
        if (
            lowest[first:end].min() < -DEPTH_ERROR_M
            or _duration(rests[first:end], times[first:end]) >= MIN_REST_S
        ):
            while first > 0 and lowest[first] < lowest[first - 1] < 0:
                first -= 1
            while end < len(lowest) and lowest[end - 1] < lowest[end] < 0:
                end += 1
            found.append((first, end))
    return found


def upper_floors(
    heights: FloatArray,
    contact: FloatArray,
    times: Float64Array,
) -> list[tuple[int, int]]:
    """Find the spans in which the lower foot rests clearly above the floor.

    :param heights: (T, F) of the feet's points above the floor, metres.
    :param contact: (T, F) probability that each of them rests on something.
    :param times: (T,) seconds.
    :return: the first row and the row after the last one of each span.
    """
    return _rests((contact > 0.5).any(axis=1) & (heights.min(axis=1) > LEVEL_M), times)


def steps(
    heights: FloatArray,
    contact: FloatArray,
    times: Float64Array,
) -> list[tuple[int, float]]:
    """Find where feet rest some centimetres above or below the floor, as on a step.

    Such a step cannot be distinguished from an error of the depth, so a capture puts these feet on
    the floor.

    :param heights: (T, F) of the feet's points above the floor, metres.
    :param contact: (T, F) probability that each of them rests on something.
    :param times: (T,) seconds.
    :return: the first row and the median height of each rest, in chronological order.
    """
    found = [
        (first, float(np.median(heights[first:end, point])))
        for point in range(contact.shape[1])
        for first, end in _rests(contact[:, point] > 0.5, times)
    ]
    return sorted((first, height) for first, height in found if STEP_M < abs(height) <= LEVEL_M)


def _rests(mask: BoolArray, times: Float64Array) -> list[tuple[int, int]]:
    """Return the runs of True in ``mask`` (T,) that last as long as a rest, of frames at ``times``
    (T,).
    """
    return [run for run in runs(mask) if times[run[1] - 1] - times[run[0]] >= MIN_REST_S]


def _duration(mask: BoolArray, times: Float64Array) -> float:
    """Return the seconds for which ``mask`` (T,) is True, of frames at ``times`` (T,)."""
    return float(mask.sum() * usual_step_s(times))


def _directions() -> Float64Array:
    """Return unit vectors (n, 3) that are spread evenly over the sphere, by a Fibonacci spiral."""
    k = np.arange(_DIRECTIONS) + 0.5
    z = 1 - 2 * k / _DIRECTIONS
    turn = np.pi * (1 + np.sqrt(5)) * k
    flat = np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
