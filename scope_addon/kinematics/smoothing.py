# SPDX-License-Identifier: GPL-3.0-or-later
"""Filling gaps and zero-phase smoothing of a motion in time.

The kernel is a Gaussian over presentation times, so variable frame rates need no resampling. Its
gain at the cut-off frequency f is 1/√2: σ = √(ln 2) / (2 π f). Rotations are averaged as
quaternions on one hemisphere and normalized (the chordal mean), which has no discontinuities,
unlike axis-angle vectors.
"""

from __future__ import annotations

import numpy as np

from ...solver.rotations import exp, log, matrix_from_quaternion, quaternion_from_matrix
from ..arrays import BoolArray, Float64Array, FloatArray, unit_vectors

# Human limb motion lies below about 6 Hz; detector noise is white. A Gaussian has a slow roll-off:
# at 4.5 Hz it passes as much noise as the 6 Hz Butterworth filter that is usual for marker data.
ROTATION_CUTOFF_HZ = 4.5
# From one camera, depth is an order of magnitude less accurate than the image position.
DEPTH_CUTOFF_HZ = 2.0
# These take some 50 MB with numpy's intermediate results; one joint alone may exceed that.
_ROTATIONS_AT_ONCE = 50_000


def fill_gaps(values: FloatArray, valid: BoolArray, times: Float64Array) -> FloatArray:
    """Interpolate linearly over the frames that are not valid; extend the nearest valid value at
    both ends.

    :param values: (T, ...) samples.
    :param valid: (T,) with at least one True.
    :param times: (T,) seconds.
    :return: (T, ...) values; the argument itself if all frames are valid.
    """
    if valid.all():
        return values
    flat = values.reshape(len(values), -1)
    return interpolated_places(flat[valid], times[valid], times).reshape(values.shape)


def continuous_quaternions(R: FloatArray) -> Float64Array:
    """Convert rotations to unit quaternions whose sign does not change from frame to frame.

    :param R: (T, ..., 3, 3) rotation matrices.
    :return: (T, ..., 4) quaternions (w, x, y, z).
    """
    return on_one_hemisphere(quaternion_from_matrix(np.asarray(R, float)))


def on_one_hemisphere(quaternions: Float64Array) -> Float64Array:
    """Choose the signs of quaternions so that consecutive ones are on one hemisphere; q and −q are
    the same rotation.

    Blender interpolates the four components separately: a change of sign would make a bone spin
    between two keys.

    :param quaternions: (T, ..., 4).
    :return: (T, ..., 4).
    """
    dots = (quaternions[1:] * quaternions[:-1]).sum(axis=-1)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    out = quaternions.copy()
    out[1:] *= signs[..., None]
    return out


def fill_rotation_gaps(R: FloatArray, valid: BoolArray, times: Float64Array) -> FloatArray:
    """Interpolate rotations over the frames that are not valid, along the shorter arc; see
    `fill_gaps`.

    :param R: (T, J, 3, 3) rotation matrices.
    :param valid: (T,) with at least one True.
    :param times: (T,) seconds.
    :return: (T, J, 3, 3) rotation matrices; the argument itself if all frames are valid.
    """
    if valid.all():
        return R
    good = np.flatnonzero(valid)
    last_valid = good[np.clip(np.searchsorted(good, np.arange(len(R)), side="right") - 1, 0, None)]
    out = np.empty_like(R)
    for joints in _joint_blocks(R):
        q = fill_gaps(continuous_quaternions(R[last_valid, joints]), valid, times)
        out[:, joints] = matrix_from_quaternion(unit_vectors(q))
    return out


def interpolate_rotations(
    a: Float64Array, b: Float64Array, share: Float64Array | float
) -> Float64Array:
    """Interpolate along the shorter arc: ``a exp(share log(aᵀ b))``.

    :param a: (..., 3, 3) rotations at share 0.
    :param b: (..., 3, 3) rotations at share 1.
    :param share: (...) interpolation parameter, 0 to 1.
    :return: (..., 3, 3) rotations.
    """
    turn = log(np.swapaxes(a, -1, -2) @ b)
    return a @ exp(np.asarray(share)[..., None] * turn)


def interpolated_rotations(R: Float64Array, at: Float64Array, times: Float64Array) -> Float64Array:
    """Return rotations (N, 3, 3) at the times ``at`` (N,), on arcs between them at others (T,)."""
    k = np.clip(np.searchsorted(at, times, side="right") - 1, 0, len(at) - 2)
    share = (times - at[k]) / (at[k + 1] - at[k])
    return interpolate_rotations(R[k], R[k + 1], share)


def interpolated_places(places: FloatArray, at: Float64Array, times: Float64Array) -> Float64Array:
    """Return places (N, D) at the times ``at`` (N,), on lines between them at others (T,)."""
    return np.stack([np.interp(times, at, coordinate) for coordinate in places.T], axis=1)


def _joint_blocks(R: FloatArray) -> list[slice]:
    """Divide the joints of rotations (T, J, 3, 3) so that a long clip's intermediate results stay
    small.
    """
    T, J = R.shape[:2]
    count = max(1, min(J, _ROTATIONS_AT_ONCE // max(T, 1)))
    return [slice(j, j + count) for j in range(0, J, count)]


def gaussian_smooth(values: FloatArray, times: Float64Array, cutoff_hz: float) -> FloatArray:
    """Apply a zero-phase low-pass filter whose gain at the cut-off frequency is 1/√2.

    :param values: (T, ...) samples.
    :param times: (T,) seconds.
    :param cutoff_hz: 0 or less: return a copy.
    :return: (T, ...) smoothed samples; a copy of fewer than three.
    """
    T = len(values)
    if T < 3 or cutoff_hz <= 0:
        return values.copy()
    sigma = np.sqrt(np.log(2)) / (2 * np.pi * cutoff_hz)
    # The kernel reaches as many frames as it covers where frames are closest together in time.
    near = np.searchsorted(times, times + 4 * sigma, side="right") - np.arange(T)
    reach = min(int(near.max()), T - 1)
    flat = values.reshape(T, -1)
    total = np.zeros_like(flat, float)
    weight = np.zeros(T)
    for shift in range(-reach, reach + 1):
        to = slice(max(0, -shift), T - max(0, shift))
        start = slice(max(0, shift), T - max(0, -shift))
        w = np.exp(-0.5 * ((times[start] - times[to]) / sigma) ** 2)
        total[to] += w[:, None] * flat[start]
        weight[to] += w
    return (total / weight[:, None]).reshape(values.shape)


def smooth_rotations(
    R: FloatArray,
    times: Float64Array,
    cutoff_hz: float = ROTATION_CUTOFF_HZ,
    out: FloatArray | None = None,
) -> FloatArray:
    """Apply a zero-phase low-pass filter to rotations.

    :param R: (T, J, 3, 3) rotation matrices.
    :param times: (T,) seconds.
    :param out: (T, J, 3, 3) array for the result; may be ``R`` itself.
    :return: (T, J, 3, 3) rotation matrices.
    """
    out = np.empty_like(R) if out is None else out
    for joints in _joint_blocks(R):
        q = gaussian_smooth(continuous_quaternions(R[:, joints]), times, cutoff_hz)
        out[:, joints] = matrix_from_quaternion(unit_vectors(q))
    return out


def smooth_root(
    t_camera_root: FloatArray, times: Float64Array, strength: float = 1.0
) -> FloatArray:
    """Apply a zero-phase low-pass filter to the root's position.

    Direction and distance (its logarithm) are filtered separately: distance is noisier, and its
    errors must not move the person in the image. The cut-off frequencies are divided by
    ``strength``.

    :param t_camera_root: (T, 3) relative to the camera's centre, in axes that do not rotate.
    :param times: (T,) seconds.
    :return: (T, 3) smoothed positions.
    """
    distance = np.maximum(np.linalg.norm(t_camera_root, axis=1, keepdims=True), 1e-6)
    ray = gaussian_smooth(t_camera_root / distance, times, ROTATION_CUTOFF_HZ / strength)
    return unit_vectors(ray) * np.exp(
        gaussian_smooth(np.log(distance), times, DEPTH_CUTOFF_HZ / strength)
    )
