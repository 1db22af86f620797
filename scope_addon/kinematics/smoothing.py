# SPDX-License-Identifier: GPL-3.0-or-later
"""Filling gaps and zero-phase smoothing of a motion in time.

The kernel is a Gaussian over presentation times, so that variable frame rates need no resampling; its gain at the
cut-off frequency f is 1/√2: σ = √(ln 2) / (2 π f). Rotations are averaged as quaternions on one hemisphere (the
chordal mean), which stays on the group and has no axis-angle seams.
"""

from __future__ import annotations

import numpy as np

from ...solver.rotations import matrix_from_quaternion, quaternion_from_matrix

# Human limb motion lies below some 6 Hz, detector noise is spread evenly. A Gaussian falls off slowly: with 4.5 Hz it
# lets as much noise through as the 6 Hz Butterworth filter that is usual for marker data.
ROTATION_CUTOFF_HZ = 4.5
DEPTH_CUTOFF_HZ = 2.0  # a single camera measures depth an order worse than the image position
_ROTATIONS_AT_ONCE = 50_000  # with what numpy needs in between, some 50 MB; of one joint, as many as there are


def fill_gaps(values: np.ndarray, valid: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Linear interpolation over the frames that are not valid, the nearest valid value at both ends.

    :param values: (T, ...);  valid: (T,) bool with at least one True;  times: (T,) seconds.
    """
    if valid.all():
        return values
    flat = values.reshape(len(values), -1)
    good = np.flatnonzero(valid)
    out = np.stack([np.interp(times, times[good], flat[good, k]) for k in range(flat.shape[1])], axis=1)
    return out.reshape(values.shape)


def continuous_quaternions(R: np.ndarray) -> np.ndarray:
    """(T, J, 3, 3) rotations -> (T, J, 4) unit quaternions (w, x, y, z) without sign jumps from frame to frame."""
    q = quaternion_from_matrix(np.asarray(R, float))
    dots = (q[1:] * q[:-1]).sum(-1)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    q[1:] *= signs[..., None]
    return q


def fill_rotation_gaps(R: np.ndarray, valid: np.ndarray, times: np.ndarray) -> np.ndarray:
    """``fill_gaps`` for rotations (T, J, 3, 3), along the shorter arc."""
    if valid.all():
        return R
    good = np.flatnonzero(valid)
    held = good[np.clip(np.searchsorted(good, np.arange(len(R)), side="right") - 1, 0, None)]
    out = np.empty_like(R)
    for joints in _some_joints(R):
        q = fill_gaps(continuous_quaternions(R[held, joints]), valid, times)
        out[:, joints] = matrix_from_quaternion(q / np.linalg.norm(q, axis=-1, keepdims=True))
    return out


def _some_joints(R: np.ndarray) -> list[slice]:
    """Of rotations (T, J, 3, 3), so many joints at a time that a long clip's intermediate results stay small."""
    T, J = R.shape[:2]
    count = max(1, min(J, _ROTATIONS_AT_ONCE // max(T, 1)))
    return [slice(j, j + count) for j in range(0, J, count)]


def gaussian_smooth(values: np.ndarray, times: np.ndarray, cutoff_hz: float) -> np.ndarray:
    """Zero-phase low-pass of (T, ...) samples at ``times`` (seconds); the gain at ``cutoff_hz`` is 1/√2."""
    T = len(values)
    if T < 3 or cutoff_hz <= 0:
        return values.copy()
    sigma = np.sqrt(np.log(2)) / (2 * np.pi * cutoff_hz)
    near = np.searchsorted(times, times + 4 * sigma, side="right") - np.arange(T)  # where frames lie closest, the most
    reach = min(int(near.max()), T - 1)
    flat = values.reshape(T, -1)
    total, weight = np.zeros_like(flat, float), np.zeros(T)
    for shift in range(-reach, reach + 1):
        to, start = slice(max(0, -shift), T - max(0, shift)), slice(max(0, shift), T - max(0, -shift))
        w = np.exp(-0.5 * ((times[start] - times[to]) / sigma) ** 2)
        total[to] += w[:, None] * flat[start]
        weight[to] += w
    return (total / weight[:, None]).reshape(values.shape)


def smooth_rotations(
    R: np.ndarray, times: np.ndarray, cutoff_hz: float = ROTATION_CUTOFF_HZ, out: np.ndarray | None = None
) -> np.ndarray:
    """Zero-phase low-pass of rotations (T, J, 3, 3); ``out`` may be ``R`` itself."""
    out = np.empty_like(R) if out is None else out
    for joints in _some_joints(R):
        q = gaussian_smooth(continuous_quaternions(R[:, joints]), times, cutoff_hz)
        out[:, joints] = matrix_from_quaternion(q / np.linalg.norm(q, axis=-1, keepdims=True))
    return out


def smooth_root(t_camera_root: np.ndarray, times: np.ndarray, strength: float = 1.0) -> np.ndarray:
    """Zero-phase low-pass of the root's position (T, 3) about the camera's centre, in axes that do not turn.

    Direction and distance (its logarithm) are filtered apart: distance is the noisier one, and a wrong distance must
    not move the person off the footage. The cut-off frequencies are divided by ``strength``.
    """
    distance = np.maximum(np.linalg.norm(t_camera_root, axis=1, keepdims=True), 1e-6)
    ray = gaussian_smooth(t_camera_root / distance, times, ROTATION_CUTOFF_HZ / strength)
    ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-6)
    return ray * np.exp(gaussian_smooth(np.log(distance), times, DEPTH_CUTOFF_HZ / strength))
