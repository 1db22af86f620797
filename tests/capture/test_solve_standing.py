# SPDX-License-Identifier: GPL-3.0-or-later
"""What the lifting network and the solver make of half a second of noisy keypoints of a person who
stands with straight or bent knees.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.camera.line_segments import Lines
from scope.scope_addon.capture.solve import solve
from scope.scope_addon.capture.world.assemble import Shot
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.solver.body_file import load_body

from .exact_tracks import track_of_points
from .standing_views import DISTANCE_M, K, knee_flexion, standing_views

RATE = 30
FRAMES = 16
NOISE_PX = 3.0


def captured_flexion(body, view, rng):
    """The knees' flexion of the captured motion's median pose; the network sees no world
    landmarks.
    """
    points = np.tile(view.points + [0.0, 0.0, DISTANCE_M], (FRAMES, 1, 1))
    track = track_of_points(
        points,
        K,
        RATE,
        keypoints_px=view.pixels + rng.normal(size=(FRAMES, *view.pixels.shape)) * NOISE_PX,
        confidence=np.full((FRAMES, len(view.points)), 0.95),
        world_landmarks=np.zeros(points.shape),
    )
    camera = Camera(K, np.zeros(5), "given")
    shot = Shot(
        body, camera, CameraPath.static(FRAMES), Lines.none(), Fraction(RATE), (1280, 1000), "made"
    )  # fmt: skip
    motion = solve(shot, [track], lambda *_: None).motions[0]
    return knee_flexion(np.median(motion.joints_cam, axis=0), body.joint_names)


@pytest.mark.parametrize(("bend_deg", "mean_deg"), [(0.0, 7.0), (67.0, -25.0)])
def test_knees_are_as_bent_as_they_are(bend_deg, mean_deg):
    """From the front, from the side and from between. Before this test: 12.8° for straight legs,
    21° from the front.
    """
    body = load_body("scope")
    rng = np.random.default_rng(0)
    views = [view for view in standing_views(body, bend_deg) if view.azimuth in (0, 60, 90)][::2]
    found = [captured_flexion(body, view, rng) - knee_flexion(view.points) for view in views]
    if bend_deg == 0.0:
        assert np.mean(found) < mean_deg
        assert np.max(found) < 2 * mean_deg
    else:
        assert np.mean(found) > mean_deg
