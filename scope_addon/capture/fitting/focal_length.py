# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length from the edges of buildings and rooms: most follow three orthogonal directions.

How many edges the best Manhattan directions explain (`manhattan`) depends on the focal length f:

    p(f) ∝ exp(κ score(f)) N(log f; log f_0, σ²)

with the assumed f_0 and σ. A wall seen frontally fits every f; p is then as wide as the assumption, and the assumed
focal length is kept.

Source: Caprile and Torre 1990 (f from vanishing points).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera.intrinsics import ASSUMED_DEVIATION, Camera, assumed_camera, estimated_camera
from ..camera.line_segments import Segments
from ..camera.manhattan import Edges
from .focal_fits import log_likelihood

KAPPA = 4.0
LOG_RANGE, COARSE_STEP, FINE_STEP = 0.7, 0.05, 0.0125  # of log(f / f_0)
FITTED_STEP = 0.0025  # finer, since evaluating the fits' likelihood costs nothing
MAX_DEVIATION = 0.1  # of log f; a less certain estimate is no better than the assumption


def camera_by_edges(segments: Segments, width: int, height: int, longer_px: float) -> Camera:
    """Return the camera with the focal length estimated from edges or, if that fails, the assumed one.

    :param longer_px: longer side of the image without letterbox bars, see `bars`.
    """
    camera = assumed_camera(width, height, longer_px)
    found = focal_from_edges(segments, width, height, camera.intrinsics[0, 0])
    return estimated_camera(width, height, *found, longer_px) if found else camera


def camera_by_fits(camera: Camera, assumed: Camera, costs: list[NDArray[np.float64]], longer_px: float) -> Camera:
    """Combine the camera's focal length with the likelihood from fits of the body.

    :param assumed: the camera of the fits.
    :param costs: (5,) of each fitted frame, see `focal_fits`.
    :param longer_px: longer side of the image without letterbox bars, see `bars`.
    """
    if not costs:
        return camera
    assumed_px = assumed.intrinsics[0, 0]
    log_ratio = np.arange(-LOG_RANGE, LOG_RANGE + 1e-9, FITTED_STEP)
    off = (log_ratio - np.log(camera.intrinsics[0, 0] / assumed_px)) / camera.focal_deviation
    mean, deviation = _moments(log_ratio, log_likelihood(costs, log_ratio) - 0.5 * np.square(off))
    width, height = 2 * camera.intrinsics[:2, 2]
    return estimated_camera(width, height, assumed_px * float(np.exp(mean)), deviation, longer_px)


def focal_from_edges(segments: Segments, width: int, height: int, assumed_px: float) -> tuple[float, float] | None:
    """Estimate the focal length in pixels and its relative error from an image's edges; None if it is uncertain."""
    edges = Edges.of(segments, width, height)
    coarse = np.arange(-LOG_RANGE, LOG_RANGE + 1e-9, COARSE_STEP)
    scores = [edges.support(assumed_px * np.exp(x)) for x in coarse]
    best = float(coarse[_log_posterior(coarse, scores).argmax()])
    fine = np.arange(best - COARSE_STEP, best + COARSE_STEP + 1e-9, FINE_STEP)
    log_ratio = np.concatenate([coarse[np.abs(coarse - best) > COARSE_STEP + 1e-6], fine])
    known = dict(zip(coarse.tolist(), scores, strict=True))
    scores = [known.get(x) or edges.support(assumed_px * np.exp(x)) for x in log_ratio.tolist()]
    mean, deviation = _moments(log_ratio, _log_posterior(log_ratio, scores))
    return (assumed_px * float(np.exp(mean)), deviation) if deviation < MAX_DEVIATION else None


def _log_posterior(log_ratio: NDArray[np.float64], scores: list[float]) -> NDArray[np.float64]:
    log_p: NDArray[np.float64] = KAPPA * np.array(scores) - 0.5 * np.square(log_ratio / ASSUMED_DEVIATION)
    return log_p


def _moments(log_ratio: NDArray[np.float64], log_p: NDArray[np.float64]) -> tuple[float, float]:
    """Return mean and standard deviation of log(f / f_0), integrated over unevenly spaced values."""
    order = np.argsort(log_ratio)
    x, log_p = log_ratio[order], log_p[order]
    p = np.exp(log_p - log_p.max()) * np.gradient(x)
    p /= p.sum()
    mean = float(p @ x)
    return mean, float(np.sqrt(p @ np.square(x - mean)))
