# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard deviations of joints, from the covariance that the solver gives for independent errors.

Networks' errors are not independent: those of neighbouring frames and keypoints are alike, and their mean is not zero.
Positions relative to the pelvis are off by a multiple of what independent errors would give. That multiple differs
little from person to person and from joint to joint, and grows less with the frame rate than smoothing lowers the
covariance:
    sigma = c s (rate / 60 Hz)^0.3,   s of the covariance,   c = 15.5 along the line of sight and 11.5 across it
Fitted to the twelve limb joints of real clips and renders with ground truth
(benchmarks/notebook/clip.md).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

ALONG, ACROSS = 15.5, 11.5
_RATE_HZ, _EXPONENT = 60.0, 0.3
_MIN_HZ = 10.0  # acceleration hardly couples frames that are further apart


def joint_sigma(
    pelvis: NDArray[np.float64],
    from_pelvis: NDArray[np.float64],
    joints: NDArray[np.floating[Any]],
    times: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the (T, K+1, 2) standard deviations along the line of sight and across it, per axis, metres.

    That of the pelvis is relative to the camera, those of the others relative to the pelvis.

    :param pelvis: (T, 3, 3) covariance of its position for independent errors, metres².
    :param from_pelvis: (T, K+1, 3, 3) of the joints' positions relative to it; row 0 is not used.
    :param joints: (T, K+1, 3) relative to the camera's centre, in the axes of the covariances.
    :param times: (T,) seconds.
    """
    covariance = from_pelvis.copy()
    covariance[:, 0] = pelvis
    sight = joints / np.linalg.norm(joints, axis=-1, keepdims=True)
    along = np.einsum("tki,tkij,tkj->tk", sight, covariance, sight)
    across = 0.5 * (np.trace(covariance, axis1=-2, axis2=-1) - along)
    rate = 1.0 / float(np.median(np.diff(times))) if len(times) > 1 else _MIN_HZ
    inflation = (max(rate, _MIN_HZ) / _RATE_HZ) ** _EXPONENT
    variance = np.maximum(np.stack([along, across], axis=-1), 0.0)
    sigma: NDArray[np.float64] = inflation * np.sqrt(variance) * [ALONG, ACROSS]
    return sigma
