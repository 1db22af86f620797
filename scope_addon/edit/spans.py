# SPDX-License-Identifier: GPL-3.0-or-later
"""Repairing a span of frames: interpolating across it, undoing a left-right swap of limbs, or
fading a correction in and out around the keys where it is known.

A correction follows a monotone cubic (Fritsch and Carlson, *Monotone Piecewise Cubic
Interpolation*, 1980): it never overshoots what is known, and its slope is zero where it begins and
ends.
"""

from __future__ import annotations

import numpy as np

from ...solver.body import Body
from ...solver.names import FINGERS
from ...solver.rotations import exp, log
from ..arrays import BoolArray, Float64Array
from ..errors import UsageError
from ..kinematics.axes import transposed
from .clip import Clip, keys_within

LIMBS = {
    "arms": ("collar", "shoulder", "elbow", "wrist", "hand", *FINGERS),
    "legs": ("hip", "knee", "ankle", "foot"),
}
# The arms point in opposite directions at rest. A half turn about z maps one arm's rotations to the
# other's, and keeps elbows bending the right way.
_HALF_ABOUT_Z = np.diag([-1.0, -1.0, 1.0])
# A half turn would bend fingers backwards: both palms look down at rest, and it turns them up. The
# mirror image of a finger's rotation bends it as far towards the other hand's palm.
SIDES_EXCHANGED = np.diag([-1.0, 1.0, 1.0])


def interpolate(clip: Clip, start: float, end: float) -> Clip:
    """Replace the motion between ``start`` and ``end`` (seconds) by an interpolation from its
    neighbours.

    Every joint follows a cubic Hermite spline in the tangent space of the key before the span, with
    the velocities before and after the span; so does the pelvis.

    :raises UsageError: when the span has no key, or no key is left on one side of it.
    """
    span = keys_within(clip, start, end)
    a = span[0] - 1
    b = span[-1] + 1
    if a < 0 or b >= len(clip):
        raise UsageError(
            "the span reaches the motion's end and has nothing to interpolate to; leave a frame on "
            "both sides"
        )
    length = clip.times[b] - clip.times[a]
    s = ((clip.times[span] - clip.times[a]) / length)[:, None, None]
    base = clip.rotations[a]
    target = log(transposed(base) @ clip.rotations[b])
    before = _velocities(clip, a, -1)
    after = _velocities(clip, b, +1)
    v0 = _limited(before[0] * length, target)
    v1 = _limited(after[0] * length, target)
    turn = _hermite(s, np.zeros_like(target), target, v0, v1)
    out = clip.copy()
    out.rotations[span] = base @ exp(turn)
    step = clip.root[b] - clip.root[a]
    v0 = _limited(before[1] * length, step)
    v1 = _limited(after[1] * length, step)
    out.root[span] = clip.root[a] + _hermite(s[:, 0], np.zeros(3), step, v0, v1)
    return out


def swap_sides(clip: Clip, body: Body, start: float, end: float, limbs: str = "both") -> Clip:
    """Swap left and right limbs within a span: each limb moves to where the other one was.

    A detector swaps labels, not positions. Therefore the left thigh takes the direction in space of
    the right one, and so on down the limb. Legs keep their rotations; those of an arm are combined
    with a half turn about z, because the arms point in opposite directions at rest. Fingers take
    the mirrored rotations of the other hand's, S Ω S with S = diag(-1, 1, 1), and so its shape.

    :param start: start of the span, seconds.
    :param end: end of the span, seconds.
    :param limbs: "arms", "legs" or "both".
    :raises UsageError: no key is in the span.
    """
    span = keys_within(clip, start, end)
    names = body.joint_names
    out = clip.copy()
    for kind in _kinds_of_limbs(limbs):
        turn = _HALF_ABOUT_Z if kind == "arms" else np.eye(3)
        for left, right in _pairs_of_joints(body, kind):
            for to, source in ((left, right), (right, left)):
                rotation = clip.rotations[span, source]
                if names[to].partition("_")[2].startswith(FINGERS):
                    out.rotations[span, to] = SIDES_EXCHANGED @ rotation @ SIDES_EXCHANGED
                    continue
                # Omega' = before^T Omega turn: the parent of the limb's first joint is the trunk,
                # which is not turned.
                first = not names[body.parents[to]].startswith(("left_", "right_"))
                before = np.eye(3) if first else turn
                out.rotations[span, to] = before.T @ rotation @ turn
    return out


def joints_of_limbs(body: Body, limbs: str) -> list[int]:
    """Return the joints of both sides that `swap_sides` exchanges.

    :param limbs: "arms", "legs" or "both".
    """
    return [
        joint
        for kind in _kinds_of_limbs(limbs)
        for pair in _pairs_of_joints(body, kind)
        for joint in pair
    ]


def _kinds_of_limbs(limbs: str) -> tuple[str, ...]:
    return tuple(LIMBS) if limbs == "both" else (limbs,)


def _pairs_of_joints(body: Body, kind: str) -> list[tuple[int, int]]:
    """Return the left and the right one of each joint of the arms or the legs."""
    names = body.joint_names
    pairs = []
    for left, name in enumerate(names):
        bare = name.removeprefix("left_")
        is_of_kind = bare != name and bare.startswith(LIMBS[kind])
        if is_of_kind and f"right_{bare}" in names:
            pairs.append((left, names.index(f"right_{bare}")))
    return pairs


def _hermite(
    s: Float64Array,
    p0: Float64Array,
    p1: Float64Array,
    v0: Float64Array,
    v1: Float64Array,
) -> Float64Array:
    """Evaluate the cubic from p0 to p1 with derivatives v0, v1 with respect to s, 0 to 1."""
    s2 = s * s
    s3 = s * s * s
    return (
        (2 * s3 - 3 * s2 + 1) * p0
        + (s3 - 2 * s2 + s) * v0
        + (3 * s2 - 2 * s3) * p1
        + (s3 - s2) * v1
    )


def _limited(v: Float64Array, step: Float64Array) -> Float64Array:
    """Limit velocities to three times the step; above that a cubic overshoots (Fritsch and
    Carlson).
    """
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    most = 3.0 * np.linalg.norm(step, axis=-1, keepdims=True)
    return v * np.minimum(1.0, most / np.maximum(size, 1e-12))


def _velocities(clip: Clip, k: int, side: int) -> tuple[Float64Array, Float64Array]:
    """Return the velocities at key k, from the neighbouring key on ``side``; zeros where there is
    none.

    :return: angular velocities of the joints (K+1, 3), radians per second, and the velocity of the
        pelvis (3,), metres per second.
    """
    i, j = (k - 1, k) if side < 0 else (k, k + 1)
    if i < 0 or j >= len(clip):
        return np.zeros(clip.rotations.shape[1:3]), np.zeros(3)
    seconds = clip.times[j] - clip.times[i]
    turn = log(transposed(clip.rotations[i]) @ clip.rotations[j])
    return turn / seconds, (clip.root[j] - clip.root[i]) / seconds


def faded(
    times: Float64Array,
    known: Float64Array,
    values: Float64Array,
    reach: Float64Array,
) -> Float64Array:
    """Interpolate values that fade to zero ``reach`` seconds beyond the known ones.

    Between two known values it interpolates, unless they are far apart, see `are_far_apart`.

    :param times: (T,) seconds at which the values are wanted.
    :param known: (H,) seconds, increasing.
    :param values: (H, ...) at the known times.
    :param reach: (H,) seconds.
    :return: (T, ...).
    """
    flat = values.reshape(len(values), -1)
    far = are_far_apart(known, reach)
    begins = (known - reach)[np.append(True, far)]
    ends = (known + reach)[np.append(far, True)]
    at = np.concatenate([known, begins, ends])
    rows = np.concatenate([flat, np.zeros((len(begins) + len(ends), flat.shape[1]))])
    order = np.argsort(at)
    inside = _monotone_cubic(times, at[order], rows[order])
    return inside.reshape(len(times), *values.shape[1:])


def are_far_apart(known: Float64Array, reach: Float64Array) -> BoolArray:
    """Return (H-1,) between which of the known times a correction fades out and in again: those
    farther apart than twice the sum of their reaches.

    :param known: (H,) seconds, increasing.
    :param reach: (H,) seconds.
    """
    return np.diff(known) > 2 * (reach[:-1] + reach[1:])


def _monotone_cubic(times: Float64Array, x: Float64Array, y: Float64Array) -> Float64Array:
    """Evaluate the monotone cubic through (x, y) with zero slopes at both ends; zero beyond them.

    :param x: (H,) increasing; y: (H, D), zero at both ends.
    """
    step = np.diff(x)[:, None]
    slope = np.diff(y, axis=0) / step
    m = np.zeros_like(y)
    before = slope[:-1]
    after = slope[1:]
    # The slope is the harmonic mean of both sides where these have the same sign.
    with np.errstate(divide="ignore", invalid="ignore"):
        w0 = 2 * step[1:] + step[:-1]
        w1 = step[1:] + 2 * step[:-1]
        mean = (w0 + w1) / (w0 / before + w1 / after)
    m[1:-1] = np.where(before * after > 0, mean, 0.0)
    k = np.clip(np.searchsorted(x, times, side="right") - 1, 0, len(x) - 2)
    s = np.clip((times - x[k]) / (x[k + 1] - x[k]), 0.0, 1.0)[:, None]
    h = (x[k + 1] - x[k])[:, None]
    value: Float64Array = (1 + 2 * s) * (1 - s) ** 2 * y[k] + s**2 * (3 - 2 * s) * y[k + 1]
    value += h * s * (1 - s) * ((1 - s) * m[k] - s * m[k + 1])
    return value
