# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length from fits of the body: the perspective of a body depends on the distance, and so on f.

A few frames are fitted at several focal lengths f each, with a shape of their own, while the next frames are tracked.
Keypoint errors are in pixels, independent of f, so the weight of the normalized residuals grows with f². With the mean
cost c(f) of the frames,

    p(f) ∝ exp(−a c(f)) N(log f; log f_0, σ²),

where f_0 and σ are known without the fit: assumed, or estimated from edges. All frames together count as a < 1 of them
(`SHARE`), since the errors of keypoints and depths are correlated over all frames of a person.

The estimate is weak. People of known stature do not improve it: with preset fast, the mean ratio to the true focal
length over fourteen renders falls from 0.78 to 0.68 when statures are given, because these also imply proportions.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....solver import Body
from ..camera.intrinsics import Camera, pinhole
from ..perception.observation import Observation
from ..tracking.track import single_frame_track
from .ablation import NO_ABLATION, Ablation
from .prepared_track import prepare_track
from .stature import with_population
from .track_fit import fit_single_frame

LOG_RATIOS = np.array([-0.7, -0.35, 0.0, 0.35, 0.7])  # logarithms of the tried focal lengths, relative to the camera's
SHARE = 0.2  # a; of 0 to 1.2, 0.2 to 0.3 is best for preset best, and 0.1 to 0.2 for fast
SHAPE_WEIGHT = 10.0  # a body that follows keypoints further than that imitates the perspective of another focal length
FIRST_GAP_S = 0.2  # between fitted frames; each further gap is twice as long: an hour has some fifteen frames


class FocalFits:
    """Fits single observations of a clip, in the calling thread."""

    def __init__(self, body: Body, ablation: Ablation = NO_ABLATION) -> None:
        self._body, self._ablation = body, ablation
        self._next_s, self._gap_s = -np.inf, FIRST_GAP_S

    def is_due(self, timestamp_s: float) -> bool:
        """Whether a frame at this time is to be fitted; if so, schedule the next one."""
        if timestamp_s < self._next_s:
            return False
        self._next_s, self._gap_s = timestamp_s + self._gap_s, 2 * self._gap_s
        return True

    def costs(self, observation: Observation, camera: Camera) -> NDArray[np.float64] | None:
        """Return the (5,) costs of fits at the camera's focal length times e^`LOG_RATIOS`; None if a fit fails.

        Assumes square pixels and a central principal point, as for any camera that is not calibrated.
        """
        track = single_frame_track(observation)
        if not track.seen[0]:
            return None
        K, costs = camera.intrinsics, []
        for ratio in np.exp(LOG_RATIOS):
            candidate = replace(camera, intrinsics=pinhole(2 * K[0, 2], 2 * K[1, 2], ratio * K[0, 0]))
            prepared = prepare_track(self._body, track, candidate, self._ablation)
            keypoints2d = prepared.weights.keypoints2d * ratio**2
            weights = replace(prepared.weights, keypoints2d=keypoints2d, shape=SHAPE_WEIGHT)
            priors = with_population(prepared.priors, self._body)
            found = fit_single_frame(replace(prepared, weights=weights, priors=priors))
            if found is None:
                return None
            costs.append(found.cost)
        return np.array(costs)


def log_likelihood(costs: list[NDArray[np.float64]], log_ratio: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (n,) log likelihood of focal lengths, up to a constant.

    :param costs: (5,) of each fitted frame, from `FocalFits.costs`.
    :param log_ratio: (n,) logarithms of the focal lengths, relative to the camera's.
    """
    if not costs:
        return np.zeros(len(log_ratio))
    return -SHARE * np.interp(log_ratio, LOG_RATIOS, np.mean(costs, axis=0))
