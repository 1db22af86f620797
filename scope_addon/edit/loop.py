# SPDX-License-Identifier: GPL-3.0-or-later
"""Cutting a cycle out of a motion, such as two steps of a walk, and closing it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp, log
from ..errors import UsageError
from .clip import Clip, inside
from .root_motion import floor_trajectory, relative_to_trajectory

SPEED_S = 0.1  # a difference in speed of 1 m/s counts like one of 0.1 m in place
STRAIGHT = np.radians(5.0)  # a smaller turn over a cycle is noise: who walks straight on must not go in circles
MOST_KEYS = 600  # of a span that is searched key by key; a longer one is searched in steps


@dataclass(frozen=True)
class Cycle:
    """Keys ``first`` and ``last`` show the same moment of a movement."""

    first: int
    last: int
    error_m: float  # root mean square over the joints: how far apart the two poses are


def best_cycle(
    clip: Clip, body: Body, betas: np.ndarray, start: float, end: float, shortest: float = 0.4
) -> Cycle:
    """The two keys within a span, at least ``shortest`` seconds apart, whose poses and speeds are most alike.

    Poses are compared by joints relative to the pelvis's shadow on the floor, turned to the same heading.

    :raises UsageError: the span is too short.
    """
    span = inside(clip, start, end)
    if clip.times[span[-1]] - clip.times[span[0]] < shortest or len(span) < 4:
        raise UsageError(f"a cycle of at least {shortest} s does not fit in the chosen frames; choose more of them")
    span = span[:: max(1, len(span) // MOST_KEYS)]
    part = Clip(clip.times[span], clip.rotations[span], clip.root[span])
    joints = relative_to_trajectory(part, *floor_trajectory(part)).joints(body, betas)
    speed = SPEED_S * np.gradient(joints, part.times, axis=0)
    features = np.concatenate([joints, speed], axis=-1).reshape(len(span), -1)
    squares = (features**2).sum(1)
    apart = np.maximum(squares[:, None] + squares[None] - 2 * features @ features.T, 0.0)
    duration = part.times[None] - part.times[:, None]
    apart[duration < shortest] = np.inf
    # Of equally good cycles the longest: a hair's difference must not cut a walk to the shortest part of it.
    score = np.sqrt(apart / joints.shape[1]) - 0.002 * duration
    a, b = np.unravel_index(int(np.argmin(score)), score.shape)
    distance = np.sqrt(((joints[a] - joints[b]) ** 2).sum(-1).mean())
    return Cycle(int(span[a]), int(span[b]), float(distance))


def close_cycle(clip: Clip, cycle: Cycle, blend: float = 0.2) -> Clip:
    """The keys of a cycle, times from zero on, the last pose made equal to the first.

    What is missing at the end is spread over the last ``blend`` seconds, with a smooth beginning. The way that the
    person has gone stays, and so does a turn of the body of more than 5 degrees: repeated, the cycle goes on from where
    it ended. Heights are closed like rotations.
    """
    chosen = slice(cycle.first, cycle.last + 1)
    times = clip.times[chosen] - clip.times[cycle.first]
    rotations, root = clip.rotations[chosen].copy(), clip.root[chosen].copy()
    s = np.clip((times - (times[-1] - max(blend, 1e-6))) / max(blend, 1e-6), 0.0, 1.0)
    s = s * s * (3 - 2 * s)
    heading = np.arctan2(*_turn(rotations[0, 0], rotations[-1, 0]))
    heading = heading if abs(heading) > STRAIGHT else 0.0
    ahead = exp(np.array([0.0, 0.0, heading]))
    goal = rotations[0].copy()
    goal[0] = ahead @ goal[0]
    missing = log(np.swapaxes(rotations[-1], -1, -2) @ goal)
    rotations = rotations @ exp(s[:, None, None] * missing)
    root[:, 2] += s * (root[0, 2] - root[-1, 2])
    return Clip(times, rotations, root)


def _turn(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Sine and cosine of the turn about the upright axis that best takes rotation a to b."""
    between = b @ a.T
    return float(between[1, 0] - between[0, 1]), float(between[0, 0] + between[1, 1])
