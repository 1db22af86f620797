# SPDX-License-Identifier: GPL-3.0-or-later
"""The measures of pose estimation, as equations: x̂ captured, x true, both in metres; errors in
millimetres.

Points have shape (T, J, 3): T frames that the protocol evaluates, without those between them, and J
joints or vertices. A measure has one value for each frame, so that the mean over all frames of all
clips is the figure of a data set. Sources, by the names under which the measures were published:

- MPJPE: Ionescu et al., *Human3.6M*, TPAMI 2014. PA-MPJPE (also "reconstruction error"): Zhou et
  al., *Sparse Representation for 3D Shape Estimation*, TPAMI 2018, with the similarity of Umeyama,
  TPAMI 1991.
- 3D PCK and its AUC: Mehta et al., *Monocular 3D Human Pose Estimation in the Wild*, 3DV 2017, and
  the evaluation program of MPI-INF-3DHP: thresholds 0, 5, …, 150 mm, the first of which no error is
  below. PCK at 50 mm and its AUC up to 199 mm: the evaluation program of the 3DPW challenge (ECCV
  2020), where an error of just the threshold counts.
- Acceleration error: Kanazawa et al., *Learning 3D Human Dynamics from Video*, CVPR 2019.
- WA-MPJPE and W-MPJPE over segments of 100 frames: Ye et al., *SLAHMR*, CVPR 2023. RTE, jitter and
  foot sliding: Shin et al., *WHAM*, CVPR 2024, whose evaluation program GVHMR and others use, and
  which decides what the papers leave open: both segments are aligned by a similarity with scale,
  the last segment of a clip may be shorter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

MM = 1000.0
PCK_MM = 150.0
AUC_MM = np.arange(0.0, 151.0, 5.0)
# of 3DPW's challenge, which ends below 200
CHALLENGE_PCK_MM = 50.0
CHALLENGE_AUC_MM = np.arange(0.0, 200.0)
SEGMENT = 100  # frames
STILL_M = 0.01  # per frame; a true foot point that moves less counts as standing


def similarity(
    source: Points, target: Points, with_scale: bool = True
) -> tuple[NDArray[np.float64], Points, Points]:
    """Return s, R, t that minimize Σ_j ‖s R source_j + t − target_j‖², R a rotation (Umeyama 1991).

    With Σ = Σ_j (target_j − mean)(source_j − mean)ᵀ = U D Vᵀ and S = diag(1, 1, det U det V): R = U
    S Vᵀ, s = tr(D S) / Σ_j ‖source_j − mean‖² (1 if all source points coincide), t = mean − s R
    mean.

    :param source, target: (..., J, 3).
    :param with_scale: False for s = 1.
    :return: s (...), R (..., 3, 3), t (..., 3).
    """
    mean_source = source.mean(axis=-2)
    mean_target = target.mean(axis=-2)
    x = source - mean_source[..., None, :]
    y = target - mean_target[..., None, :]
    U, D, Vt = np.linalg.svd(np.swapaxes(y, -1, -2) @ x)
    sign = np.ones(D.shape)
    sign[..., 2] = np.sign(np.linalg.det(U) * np.linalg.det(Vt))
    R = (U * sign[..., None, :]) @ Vt
    scale = np.ones(D.shape[:-1])
    if with_scale:
        size = np.square(x).sum(axis=(-1, -2))
        np.divide((D * sign).sum(axis=-1), size, out=scale, where=size > 0)
    t = mean_target - scale[..., None] * np.einsum("...ij,...j->...i", R, mean_source)
    return scale, R, t


def aligned(points: Points, transform: tuple[NDArray[np.float64], Points, Points]) -> Points:
    """Return s R x + t.

    :param points: (..., J, 3).
    :param transform: s (...), R (..., 3, 3), t (..., 3) of `similarity`.
    """
    scale, R, t = transform
    moved: Points = (
        scale[..., None, None] * np.einsum("...ij,...nj->...ni", R, points) + t[..., None, :]
    )
    return moved


def joint_errors(captured: Points, true: Points) -> NDArray[np.float64]:
    """Return ‖x̂_j − x_j‖ in mm, (T, J); `captured` and `true` (T, J, 3)."""
    distance: NDArray[np.float64] = np.linalg.norm(captured - true, axis=-1) * MM
    return distance


def relative_to(points: Points, root: Points) -> Points:
    """Return points (T, J, 3) relative to a root (T, 3), such as the pelvis or the middle between
    the hips.
    """
    return points - root[:, None]


def mpjpe(captured: Points, true: Points) -> NDArray[np.float64]:
    """Return the mean joint error of each frame in mm, (T,); (T, J, 3) both, relative to their
    roots.
    """
    return joint_errors(captured, true).mean(axis=1)


def pa_mpjpe(captured: Points, true: Points) -> NDArray[np.float64]:
    """Return the mean joint error after each frame's best similarity in mm, (T,); (T, J, 3)
    both.
    """
    return mpjpe(aligned(captured, similarity(captured, true)), true)


def pck(errors_mm: NDArray[np.float64], threshold_mm: float = PCK_MM) -> NDArray[np.float64]:
    """Return the percentage of joints with errors below the threshold, (T,); errors (T, J)."""
    share: NDArray[np.float64] = 100.0 * (errors_mm < threshold_mm).mean(axis=1)
    return share


def auc(errors_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of PCK over the thresholds 0, 5, …, 150 mm, (T,); errors (T, J)."""
    return np.mean([pck(errors_mm, threshold) for threshold in AUC_MM], axis=0)


def challenge_pck(
    errors_mm: NDArray[np.float64], threshold_mm: float = CHALLENGE_PCK_MM
) -> NDArray[np.float64]:
    """Return the percentage of joints with errors of at most the threshold, (T,); errors (T, J)."""
    share: NDArray[np.float64] = 100.0 * (errors_mm <= threshold_mm).mean(axis=1)
    return share


def challenge_auc(errors_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of `challenge_pck` over the thresholds from 0 to 199 mm, in steps of 1, (T,);
    errors (T, J).
    """
    shares = np.array([challenge_pck(errors_mm, threshold) for threshold in CHALLENGE_AUC_MM])
    # trapezoids of equal width
    area: NDArray[np.float64] = (shares[:-1] + shares[1:]).mean(axis=0) / 2
    return area


def acceleration_error(captured: Points, true: Points, rate: float) -> NDArray[np.float64]:
    """Return mean_j ‖Δ²x̂_j − Δ²x_j‖ f² in m/s², (T − 2,), with Δ²x = x_{t−1} − 2 x_t + x_{t+1}.

    :param captured, true: (T, J, 3), relative to their roots.
    :param rate: f, frames per second.
    """
    difference = np.diff(captured - true, n=2, axis=0)
    error: NDArray[np.float64] = np.linalg.norm(difference, axis=-1).mean(axis=1) * rate**2
    return error


def wa_mpjpe(captured: Points, true: Points) -> NDArray[np.float64]:
    """Return the mean joint error in the world after one similarity for each segment of 100 frames,
    mm, (T,).

    :param captured, true: (T, J, 3) in the world.
    """
    return _segment_errors(captured, true, SEGMENT)


def w_mpjpe(captured: Points, true: Points) -> NDArray[np.float64]:
    """Return the mean joint error in the world after each segment of 100 frames is aligned by its
    first two, mm, (T,).

    :param captured, true: (T, J, 3) in the world.
    """
    return _segment_errors(captured, true, 2)


def _segment_errors(captured: Points, true: Points, aligned_frames: int) -> NDArray[np.float64]:
    errors = [np.zeros(0)]
    for start in range(0, len(true), SEGMENT):
        x = captured[start : start + SEGMENT]
        y = true[start : start + SEGMENT]
        transform = similarity(x[:aligned_frames].reshape(-1, 3), y[:aligned_frames].reshape(-1, 3))
        errors.append(mpjpe(aligned(x.reshape(-1, 3), transform).reshape(x.shape), y))
    return np.concatenate(errors)


def root_translation_error(captured: Points, true: Points) -> NDArray[np.float64]:
    """Return 100 ‖R r̂_t + t − r_t‖ / Σ ‖r_{t+1} − r_t‖, (T,) in % of the distance that the true
    root travels.

    R and t are one rigid transform for the whole clip. NaN where the true root does not move.

    :param captured, true: roots (T, 3) in the world.
    """
    travelled = float(np.linalg.norm(np.diff(true, axis=0), axis=1).sum())
    if travelled <= 0:
        return np.full(len(true), np.nan)
    moved = aligned(captured, similarity(captured, true, with_scale=False))
    error: NDArray[np.float64] = 100.0 * np.linalg.norm(moved - true, axis=1) / travelled
    return error


def jitter(captured: Points, rate: float) -> NDArray[np.float64]:
    """Return mean_j ‖Δ³x̂_j‖ f³ / 10 in units of 10 m/s³, (T − 3,).

    :param captured: (T, J, 3) in the world.
    :param rate: f, frames per second.
    """
    third: NDArray[np.float64] = np.linalg.norm(np.diff(captured, n=3, axis=0), axis=-1).mean(
        axis=1
    )
    return third * rate**3 / 10.0


def foot_slide(captured: Points, true: Points) -> NDArray[np.float64]:
    """Return ‖Δx̂‖ in mm of every foot point and pair of frames between which the true point moves
    less than 1 cm, (n,).

    :param captured, true: (T, F, 3) points under heels and toes in the world.
    """
    still = np.linalg.norm(np.diff(true, axis=0), axis=-1) < STILL_M
    distance: NDArray[np.float64] = np.linalg.norm(np.diff(captured, axis=0), axis=-1)[still] * MM
    return distance
