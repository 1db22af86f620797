# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length by the edges of what people build: most are upright or level, at right angles to each other.

How many edges three directions at right angles explain (`right_angles`) depends on the focal length f:

    p(f) ∝ exp(κ score(f)) N(log f; log f_0, σ²)

f_0 and σ what is assumed without looking. A wall seen straight on fits every f; then p stays as wide as what was
assumed, and nothing is said.

Source: Caprile and Torre 1990 (f from vanishing points).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..camera.intrinsics import ASSUMED_DEVIATION, Camera, assumed_camera, estimated_camera
from ..camera.line_segments import Segments
from ..camera.manhattan import Edges
from .focal_fits import log_likelihood

KAPPA = 4.0
LOG_RANGE, COARSE_STEP, FINE_STEP = 0.7, 0.05, 0.0125  # of log(f / f_0)
FITTED_STEP = 0.0025  # where trying one costs nothing
CERTAIN = 0.1  # deviation of log f: whatever is less certain is no better than what was assumed


@dataclass(frozen=True)
class FocalLength:
    """Mean, and standard deviation of its logarithm: the relative error."""

    focal_px: float
    deviation: float


def camera_by_edges(segments: Segments, width: int, height: int, longer_px: float) -> Camera:
    """The camera with the focal length that edges tell, if they tell any, else the assumed one.

    ``longer_px``: the longer side of what the camera saw; see `bars`.
    """
    camera = assumed_camera(width, height, longer_px)
    found = focal_from_edges(segments, width, height, camera.intrinsics[0, 0])
    return estimated_camera(width, height, found.focal_px, found.deviation, longer_px) if found else camera


def camera_by_fits(camera: Camera, assumed: Camera, costs: list[np.ndarray], longer_px: float) -> Camera:
    """The camera with what fits to pictures say of its focal length as well.

    ``costs``: of the fits, about ``assumed``; see `focal_fits`.
    """
    if not costs:
        return camera
    assumed_px = assumed.intrinsics[0, 0]
    log_ratio = np.arange(-LOG_RANGE, LOG_RANGE + 1e-9, FITTED_STEP)
    off = (log_ratio - np.log(camera.intrinsics[0, 0] / assumed_px)) / camera.focal_deviation
    mean, deviation = _moments(log_ratio, log_likelihood(costs, log_ratio) - 0.5 * np.square(off))
    width, height = 2 * camera.intrinsics[:2, 2]
    return estimated_camera(width, height, assumed_px * float(np.exp(mean)), deviation, longer_px)


def focal_from_edges(segments: Segments, width: int, height: int, assumed_px: float) -> FocalLength | None:
    """The focal length that a picture's edges tell; None where they do not tell any."""
    edges = Edges.of(segments, width, height)
    coarse = np.arange(-LOG_RANGE, LOG_RANGE + 1e-9, COARSE_STEP)
    scores = [edges.support(assumed_px * np.exp(x)) for x in coarse]
    best = float(coarse[_log_posterior(coarse, scores).argmax()])
    fine = np.arange(best - COARSE_STEP, best + COARSE_STEP + 1e-9, FINE_STEP)
    log_ratio = np.concatenate([coarse[np.abs(coarse - best) > COARSE_STEP + 1e-6], fine])
    known = dict(zip(coarse.tolist(), scores, strict=True))
    scores = [known.get(x) or edges.support(assumed_px * np.exp(x)) for x in log_ratio.tolist()]
    mean, deviation = _moments(log_ratio, _log_posterior(log_ratio, scores))
    return FocalLength(assumed_px * float(np.exp(mean)), deviation) if deviation < CERTAIN else None


def _log_posterior(log_ratio: np.ndarray, scores: list[float]) -> np.ndarray:
    return KAPPA * np.array(scores) - 0.5 * np.square(log_ratio / ASSUMED_DEVIATION)


def _moments(log_ratio: np.ndarray, log_p: np.ndarray) -> tuple[float, float]:
    """Mean and standard deviation of log(f / f_0), by trapezoids over unevenly spaced values."""
    order = np.argsort(log_ratio)
    x, log_p = log_ratio[order], log_p[order]
    p = np.exp(log_p - log_p.max()) * np.gradient(x)
    p /= p.sum()
    mean = float(p @ x)
    return mean, float(np.sqrt(p @ np.square(x - mean)))
