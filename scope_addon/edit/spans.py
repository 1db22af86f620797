# SPDX-License-Identifier: GPL-3.0-or-later
"""Mending a span of frames: going over it smoothly, or giving back to each side the limb that the other one got."""

from __future__ import annotations

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp, log
from ..errors import UsageError
from .clip import Clip, inside

LIMBS = {
    "arms": ("collar", "shoulder", "elbow", "wrist", "hand", "index", "middle", "pinky", "ring", "thumb"),
    "legs": ("hip", "knee", "ankle", "foot"),
}
# The arms' rest directions are opposite: what one arm does turned half about z is what the other would do there,
# elbows bending the right way.
_HALF_ABOUT_Z = np.diag([-1.0, -1.0, 1.0])


def interpolate(clip: Clip, start: float, end: float) -> Clip:
    """The motion without what happens between ``start`` and ``end``: from one end to the other as the neighbours move.

    Every joint follows a cubic (Hermite) in the tangent space of the key before the span, with the speeds before and
    after it; the pelvis likewise.

    :raises UsageError: the span has no key, or no key is left on one side of it.
    """
    span = inside(clip, start, end)
    a, b = span[0] - 1, span[-1] + 1
    if a < 0 or b >= len(clip):
        raise UsageError("the span reaches the motion's end, so there is nothing to go to; leave a frame on both sides")
    length = clip.times[b] - clip.times[a]
    s = ((clip.times[span] - clip.times[a]) / length)[:, None, None]
    base = clip.rotations[a]
    target = log(np.swapaxes(base, -1, -2) @ clip.rotations[b])
    before, after = _angular_velocity(clip, a, -1), _angular_velocity(clip, b, +1)
    turn = _hermite(s, np.zeros_like(target), target, _calm(before * length, target), _calm(after * length, target))
    out = Clip(clip.times, clip.rotations.copy(), clip.root.copy())
    out.rotations[span] = base @ exp(turn)
    step = clip.root[b] - clip.root[a]
    v0, v1 = _velocity(clip, a, -1) * length, _velocity(clip, b, +1) * length
    out.root[span] = clip.root[a] + _hermite(s[:, 0], np.zeros(3), step, _calm(v0, step), _calm(v1, step))
    return out


def swap_sides(clip: Clip, body: Body, start: float, end: float, limbs: str = "both") -> Clip:
    """The motion with left and right exchanged within a span: each limb goes where the other one was.

    What a detector swaps are names, not places. So the left thigh takes the direction in space of the right one, and so
    on down the limb: legs keep their rotations, an arm's are turned half about z, because the arms point away from each
    other at rest, elbows bending the right way.

    :param limbs: "arms", "legs" or "both".
    :raises UsageError: no such limbs, or no key in the span.
    """
    if limbs not in (*LIMBS, "both"):
        raise UsageError(f"limbs must be arms, legs or both, not {limbs!r}")
    span = inside(clip, start, end)
    names = list(body.joint_names)
    out = Clip(clip.times, clip.rotations.copy(), clip.root)
    for kind in LIMBS if limbs == "both" else (limbs,):
        turn = _HALF_ABOUT_Z if kind == "arms" else np.eye(3)
        for left, name in enumerate(names):
            bare = name.removeprefix("left_")
            if bare == name or not bare.startswith(LIMBS[kind]) or f"right_{bare}" not in names:
                continue
            right = names.index(f"right_{bare}")
            # Omega' = before^T Omega turn: the limb's first joint hangs on the trunk, which does not turn with it
            for to, source in ((left, right), (right, left)):
                first = not names[body.parents[to]].startswith(("left_", "right_"))
                before = np.eye(3) if first else turn
                out.rotations[span, to] = before.T @ clip.rotations[span, source] @ turn
    return out


def _hermite(s: np.ndarray, p0: np.ndarray, p1: np.ndarray, v0: np.ndarray, v1: np.ndarray) -> np.ndarray:
    """Cubic from p0 to p1 with derivatives v0, v1 by s in 0..1."""
    s2, s3 = s * s, s * s * s
    return (2 * s3 - 3 * s2 + 1) * p0 + (s3 - 2 * s2 + s) * v0 + (3 * s2 - 2 * s3) * p1 + (s3 - s2) * v1


def _calm(v: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Speeds no larger than three times the way to go: beyond that a cubic overshoots (Fritsch and Carlson)."""
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    most = 3.0 * np.linalg.norm(step, axis=-1, keepdims=True)
    return v * np.minimum(1.0, most / np.maximum(size, 1e-12))


def _angular_velocity(clip: Clip, k: int, side: int) -> np.ndarray:
    """(K+1, 3) radians a second at key k, from the key beyond it; zero where there is none."""
    i, j = (k - 1, k) if side < 0 else (k, k + 1)
    if i < 0 or j >= len(clip):
        return np.zeros(clip.rotations.shape[1:3])
    return log(np.swapaxes(clip.rotations[i], -1, -2) @ clip.rotations[j]) / (clip.times[j] - clip.times[i])


def _velocity(clip: Clip, k: int, side: int) -> np.ndarray:
    i, j = (k - 1, k) if side < 0 else (k, k + 1)
    if i < 0 or j >= len(clip):
        return np.zeros(3)
    return (clip.root[j] - clip.root[i]) / (clip.times[j] - clip.times[i])
