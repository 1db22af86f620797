# SPDX-License-Identifier: GPL-3.0-or-later
"""Two people on one floor, the height of one of them given: the other one's follows from the
floor.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.stature import with_stature
from scope.scope_addon.capture.solve import solve
from scope.solver import default_priors

from .standing_people import BODY, seen, steps

pytestmark = pytest.mark.usefixtures("exact_lifting")
TALL_M = 1.95
SHORT_M = 1.5


def shape(height_m: float) -> np.ndarray:
    """The proportions of the mean, as tall as that: nothing but the floor tells the size."""
    betas = np.asarray(with_stature(default_priors(BODY), BODY, height_m).shape_mean)
    assert BODY.stature(betas) == pytest.approx(height_m, abs=0.005)
    return betas


def test_the_size_of_others_follows_from_a_given_height():
    tracks = [steps(0.0, shape(TALL_M), -0.6), steps(0.0, shape(SHORT_M), 0.6)]
    statures = [
        [
            BODY.stature(motion.betas)
            for motion in solve(seen(tracks[0]), tracks, lambda *_: None, given).motions
        ]
        for given in ((), (TALL_M,))
    ]
    (_, unknown), (tall, short) = statures
    assert tall == pytest.approx(TALL_M, abs=0.01)
    assert abs(short - SHORT_M) < min(0.6 * abs(unknown - SHORT_M), 0.03)


def test_the_deviation_of_such_a_size_is_not_that_of_a_given_one():
    tracks = [steps(0.0, shape(TALL_M), -0.6), steps(0.0, shape(SHORT_M), 0.6)]
    tall, short = solve(seen(tracks[0]), tracks, lambda *_: None, (TALL_M,)).motions
    assert tall.height_sigma_m < 0.02
    assert short.height_sigma_m > 0.09
