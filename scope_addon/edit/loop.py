# SPDX-License-Identifier: GPL-3.0-or-later
"""Extracting a cycle from a motion, such as two steps of a walk, and closing it into a loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp, log
from ..arrays import BoolArray, Float64Array, FloatArray
from ..errors import UsageError
from ..kinematics.axes import transposed
from .clip import Clip, floor_trajectory, keys_within, relative_to_trajectory

# A difference in velocity of 1 m/s weighs as much as one in position of 0.1 m.
SPEED_WEIGHT_S = 0.1
# A smaller turn per cycle is noise, and would bend a straight walk into a circle.
MIN_TURN = np.radians(5.0)
# Longer spans are subsampled, because all pairs of keys are compared.
MAX_SPAN_KEYS = 600


@dataclass(frozen=True)
class Cycle:
    """Two keys that show the same phase of a movement."""

    first: int
    last: int
    error_m: float  # root mean square distance of the joints between the two poses


def best_cycle(
    clip: Clip,
    body: Body,
    betas: FloatArray,
    start: float,
    end: float,
    shortest: float = 0.4,
    least_movement_m: float = 0.05,
    most_turn: float = np.pi,
) -> Cycle:
    """Find the two keys within a span whose poses and velocities differ least, with movement
    between them.

    Poses are compared by joint positions relative to the pelvis's projection on the floor, rotated
    to the same heading.

    :param betas: (P,) shape coefficients.
    :param start: start of the span, seconds.
    :param end: end of the span, seconds.
    :param shortest: minimum duration of the cycle, seconds.
    :param least_movement_m: root mean square distance of the joints, metres, by which a pose
        between the two must differ from the first; 0 also accepts a person who does not move.
    :param most_turn: radians by which the body may be turned about the vertical from the first pose
        to the second; `MIN_TURN` for a cycle that is to be repeated.
    :raises UsageError: when the span is too short, no movement in it is repeated, or only with a
        turn.
    """
    span = keys_within(clip, start, end)
    if clip.times[span[-1]] - clip.times[span[0]] < shortest or len(span) < 4:
        raise UsageError(
            f"a cycle of at least {shortest} s does not fit in the chosen frames; "
            "choose more of them"
        )
    span = span[:: max(1, len(span) // MAX_SPAN_KEYS)]
    part = clip.rows(span)
    joints = relative_to_trajectory(part, *floor_trajectory(part)).joints(body, betas)
    speed = SPEED_WEIGHT_S * np.gradient(joints, part.times, axis=0)
    features = np.concatenate([joints, speed], axis=-1).reshape(len(span), -1)
    apart = _squared_distances(features)
    duration = part.times[None] - part.times[:, None]
    apart[duration < shortest] = np.inf
    if least_movement_m > 0:
        apart[~_moves(joints, least_movement_m)] = np.inf
    if not np.isfinite(apart).any():
        raise UsageError(
            "no cycle was found: no movement is repeated within the chosen frames; choose frames "
            "in which the person "
            "does the same thing twice, such as two steps of a walk"
        )
    turns = np.abs(_vertical_turns(part.rotations[:, 0]))
    is_straight = turns <= most_turn
    if np.isfinite(apart[is_straight]).any():
        apart[~is_straight] = np.inf
    else:
        turn = turns.ravel()[int(apart.argmin())]
        raise UsageError(
            f"the person turns by {np.degrees(turn):.0f} degrees while the movement is repeated, "
            "and each repetition would snap back by that; choose frames in which they go straight, "
            "or turn Repeat off"
        )
    # Prefer the longest of nearly equal cycles: a negligible difference must not select the
    # shortest part of a walk.
    score = np.sqrt(apart / joints.shape[1]) - 0.002 * duration
    a, b = np.unravel_index(int(np.argmin(score)), score.shape)
    distance = np.sqrt(((joints[a] - joints[b]) ** 2).sum(-1).mean())
    return Cycle(int(span[a]), int(span[b]), float(distance))


def _moves(joints: Float64Array, least: float) -> BoolArray:
    """Return (N, N): whether the body leaves pose a by ``least`` and comes back at least halfway by
    pose b.

    :param joints: (N, J, 3) metres.
    :param least: root mean square distance over the joints, metres.
    """
    apart = np.sqrt(_squared_distances(joints.reshape(len(joints), -1)) / joints.shape[1])
    # The largest distance from pose a among the poses from a to b.
    farthest = np.maximum.accumulate(np.triu(apart), axis=1)
    return (farthest >= least) & (apart <= 0.5 * farthest)


def _squared_distances(points: Float64Array) -> Float64Array:
    """Return the squared distances (N, N) between points (N, D)."""
    squares = (points**2).sum(1)
    return np.maximum(squares[:, None] + squares[None] - 2 * points @ points.T, 0.0)


def close_cycle(clip: Clip, cycle: Cycle, blend: float = 0.2) -> Clip:
    """Return the keys of a cycle, with times from zero and the last pose equal to the first.

    The difference between the two poses is blended in over the last ``blend`` seconds. The
    horizontal root trajectory is kept: when the cycle repeats, it continues from where it ended.
    Height is closed like rotations. A turn of the body of more than `MIN_TURN` is kept too, by
    which curves that repeat snap back.
    """
    chosen = slice(cycle.first, cycle.last + 1)
    times = clip.times[chosen] - clip.times[cycle.first]
    rotations = clip.rotations[chosen].copy()
    root = clip.root[chosen].copy()
    s = np.clip((times - (times[-1] - max(blend, 1e-6))) / max(blend, 1e-6), 0.0, 1.0)
    s = s * s * (3 - 2 * s)
    heading = _vertical_turns(rotations[[0, -1], 0])[0, 1]
    heading = heading if abs(heading) > MIN_TURN else 0.0
    ahead = exp(np.array([0.0, 0.0, heading]))
    goal = rotations[0].copy()
    goal[0] = ahead @ goal[0]
    missing = log(transposed(rotations[-1]) @ goal)
    rotations = rotations @ exp(s[:, None, None] * missing)
    root[:, 2] += s * (root[0, 2] - root[-1, 2])
    return Clip(times, rotations, root)


def _vertical_turns(rotations: Float64Array) -> Float64Array:
    """Return the angles (N, N) in radians of the rotations about the vertical that take each of the
    rotations (N, 3, 3) closest to each other one, by row and column.
    """
    level = rotations[:, :2]
    turns = np.einsum("bik,ajk->abij", level, level)
    sine = turns[..., 1, 0] - turns[..., 0, 1]
    cosine = turns[..., 0, 0] + turns[..., 1, 1]
    return np.arctan2(sine, cosine)
