# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of one person's motion for the page's table, in the field's units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ..motion import Motion
from ..review_spans import body_confidence, find_review_spans

_SPEED_WINDOW_S = 0.5  # over which a speed is measured, so that jitter does not count
_CONTACT = 0.5  # probability from which a heel or toe counts as in contact


def motion_figures(motion: Motion, body: Body) -> dict[str, str]:
    """Return what a user may ask about a motion: name of the figure to its value with its unit."""
    seen = motion.valid
    pelvis = motion.trans.astype(float) + body.rest_joints(motion.betas.astype(float))[0]
    path = np.linalg.norm(np.diff(pelvis[:, :2], axis=0), axis=1)
    error = motion.residual_px[seen]
    contact = motion.foot_contact > _CONTACT
    sigma = np.asarray(motion.joint_sigma_m, float)[seen]
    spans = find_review_spans(motion)
    review = sum(span.last - span.first + 1 for span in spans)
    return {
        "Frames seen": f"{int(seen.sum())} of {len(motion)}",
        "Height": height_text(body.stature(motion.betas.astype(float)), motion.height_sigma_m),
        "Path over the floor": f"{path.sum():.2f} m",
        "Highest speed": f"{highest_speed(pelvis[:, :2], motion.timestamps):.2f} m/s",
        "Pelvis height": f"{pelvis[:, 2].min():.2f} to {pelvis[:, 2].max():.2f} m",
        "Reprojection error, mean": f"{error.mean():.1f} px" if len(error) else "–",
        "Reprojection error, 95th percentile": f"{np.percentile(error, 95):.1f} px"
        if len(error)
        else "–",
        "Confidence, mean": f"{body_confidence(motion).mean():.2f}",
        "Standard deviation of joints, mean": f"{100 * np.nanmean(sigma):.1f} cm"
        if np.isfinite(sigma).any()
        else "–",
        "Left foot in contact": f"{100 * contact[:, :2].any(axis=1).mean():.0f} % of frames",
        "Right foot in contact": f"{100 * contact[:, 2:].any(axis=1).mean():.0f} % of frames",
        "Frames to review": f"{review}",
    }


def height_text(height_m: float, sigma_m: float) -> str:
    """Return a stature in centimetres, with its standard deviation where that is known."""
    if not np.isfinite(sigma_m):
        return f"{100 * height_m:.0f} cm"
    digits = 0 if sigma_m >= 0.01 else 1
    return f"{100 * height_m:.{digits}f} ± {100 * sigma_m:.{digits}f} cm"


def highest_speed(points: NDArray[np.float64], times: NDArray[np.float64]) -> float:
    """Return the highest mean speed of points (T, 2) at times (T,) over half a second, or over the
    whole of less.
    """
    if len(points) < 2:
        return 0.0
    ends = np.searchsorted(times, times + _SPEED_WINDOW_S - 1e-6)
    first = np.flatnonzero(ends < len(times))
    if not len(first):
        first = np.array([0])
        ends = np.array([len(times) - 1])
    distance = np.linalg.norm(points[ends[first]] - points[first], axis=1)
    return float((distance / np.maximum(times[ends[first]] - times[first], 1e-9)).max())
