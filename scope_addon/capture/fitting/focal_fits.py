# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length by the fit: in perspective what is near is large, and a body says what is near and how large it is.

A few pictures are fitted at several focal lengths f each, with a shape of their own, while the next frames are
tracked. Keypoints are misplaced by pixels, whatever f is, so that the weight of the normalized residuals grows with f².
With c(f) the pictures' mean cost,

    p(f) ∝ exp(−a c(f)) N(log f; log f_0, σ²),

f_0 and σ what is known without the fit: assumed, or told by edges. All pictures together count as a < 1 of them
(`SHARE`), since keypoints are misplaced, and depths mistaken, alike in all pictures of a person.

It tells little: see `camera` for how much. Nor does it tell more of people whose height is known: with preset fast, the
mean over fourteen renders of the ratio to the true focal length falls from 0.78 to 0.68 with their heights, since
other proportions come with these.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver import Body
from ..camera.intrinsics import Camera, pinhole
from ..perception.observation import Observation
from ..tracking.track import single_frame_track
from .ablation import ALL_PARTS, Parts
from .track_fit import fit_picture, prepare_track

LOG_RATIOS = np.array([-0.7, -0.35, 0.0, 0.35, 0.7])  # of the focal lengths that are tried
SHARE = 0.2  # of 0 to 1.2, 0.2 to 0.3 is best for preset best, 0.1 to 0.2 for fast; see `camera`
FIRST_GAP_S = 0.2  # between pictures; each further gap is twice as long, so that an hour has some fifteen of them


class FocalFits:
    """Fits single observations of a clip, in whatever thread asks."""

    def __init__(self, body: Body, parts: Parts = ALL_PARTS) -> None:
        self._body, self._parts = body, parts
        self._next_s, self._gap_s = -np.inf, FIRST_GAP_S

    def is_due(self, timestamp_s: float) -> bool:
        """Whether a frame at this time is to be fitted; if so, the next one is due later."""
        if timestamp_s < self._next_s:
            return False
        self._next_s, self._gap_s = timestamp_s + self._gap_s, 2 * self._gap_s
        return True

    def costs(self, observation: Observation, camera: Camera) -> np.ndarray | None:
        """Costs (5,) of the fit at ``camera``'s focal length times e^`LOG_RATIOS`; None where that says too little.

        Square pixels and a principal point in the middle are assumed, as for any camera that nothing is known of.
        """
        track = single_frame_track(observation)
        if not track.seen[0]:
            return None
        K, costs = camera.intrinsics, []
        for ratio in np.exp(LOG_RATIOS):
            tried = replace(camera, intrinsics=pinhole(2 * K[0, 2], 2 * K[1, 2], ratio * K[0, 0]))
            prepared = prepare_track(self._body, track, tried, self._parts)
            weights = replace(prepared.weights, keypoints2d=prepared.weights.keypoints2d * ratio**2)
            found = fit_picture(replace(prepared, weights=weights))
            if found is None:
                return None
            costs.append(found.cost)
        return np.array(costs)


def log_likelihood(costs: list[np.ndarray], log_ratio: np.ndarray) -> np.ndarray:
    """What the costs (5,) of some pictures say of the focal length, by its logarithmic ratio to the camera's."""
    return -SHARE * np.interp(log_ratio, LOG_RATIOS, np.mean(costs, axis=0)) if costs else np.zeros(len(log_ratio))
