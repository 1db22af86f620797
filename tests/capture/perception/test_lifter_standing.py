# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the lifting network lets people stand straight, and sink into a squat: exact keypoints,
analytic truth.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.lifter import default_lifter
from scope.solver.body_file import load_body

from ..standing_views import DISTANCE_M, knee_flexion, standing_views


@pytest.fixture(scope="module")
def body():
    return load_body("scope")


def errors(body, bend_deg, with_world):
    """The errors of the knees' flexion in what the network makes of each view, a still."""
    points = np.array([view.points for view in standing_views(body, bend_deg)])
    in_front = points + [0.0, 0.0, DISTANCE_M]
    rays = in_front[..., :2] / in_front[..., 2:]
    world = points if with_world else None
    lifted = default_lifter().lift(rays, np.ones(rays.shape[:2]), world).points
    return np.array(
        [
            knee_flexion(ours) - knee_flexion(truth)
            for ours, truth in zip(lifted, points, strict=True)
        ]
    )


@pytest.mark.parametrize("with_world", [False, True])
def test_straight_legs_stay_straight(body, with_world):
    """The network before this test answered 14.5° on average and 24° from the front."""
    found = errors(body, 0.0, with_world)
    assert found.mean() < 7.0
    assert np.abs(found).max() < 11.0


def test_bent_legs_stay_bent(body):
    """Seen from the front, bent knees only shorten the legs; with depth from the landmark network
    they are known.
    """
    views = list(standing_views(body, 67.0))
    from_the_side = [k for k, view in enumerate(views) if view.azimuth in (30, 60, 90, 150)]
    found = errors(body, 67.0, True)
    assert np.abs(found[from_the_side]).max() < 20.0
    assert found.mean() > -15.0
