# SPDX-License-Identifier: GPL-3.0-or-later
"""The standard deviation of a captured stature against the true statures of people drawn from the
population.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.fitting.prepared_track import prepare_track
from scope.scope_addon.capture.fitting.track_fit import fit_track
from scope.scope_addon.capture.tracking.track import Track
from scope.solver import load_body
from scope.solver.rotations import exp

from ..exact_tracks import centred, network_points, pixels_of, track_of_points

PEOPLE = 24
FRAMES = 4
BODY = load_body("scope")
CAMERA = choose_camera(1080, 1920)


def _track(rng: np.random.Generator, betas: np.ndarray) -> Track:
    """A person of a shape, 4 m away, at arbitrary angles of view, by keypoints with 4 pixels of
    noise.
    """
    flip = np.diag([1.0, -1.0, -1.0])
    rotations = np.tile(np.eye(3), (FRAMES, BODY.K + 1, 1, 1))
    rotations[:, 0] = flip @ exp(
        np.outer(rng.uniform(-1.0, 1.0) + 0.1 * np.arange(FRAMES), [0.0, 1.0, 0.0])
    )
    pose = BODY.forward_kinematics(rotations, np.tile([0.0, 0.0, 4.0], (FRAMES, 1)), betas)
    points = network_points(BODY, *pose, betas)
    pixels = pixels_of(points, CAMERA.intrinsics)
    return track_of_points(
        points,
        CAMERA.intrinsics,
        keypoints_px=pixels + rng.normal(0.0, 4.0, pixels.shape),
        world_landmarks=centred(points) * BODY.stature() / BODY.stature(betas),
    )


def test_statures_are_off_by_their_deviations():
    rng = np.random.default_rng(5)
    deviations = []
    for betas in rng.standard_normal((PEOPLE, BODY.P)):
        found = fit_track(prepare_track(BODY, _track(rng, betas), CAMERA), lambda *_: None)
        deviations.append((BODY.stature(found.betas) - BODY.stature(betas)) / found.height_sigma_m)
    assert 0.6 < np.sqrt(np.mean(np.square(deviations))) < 1.4


@pytest.mark.parametrize("height_m", [1.55, 1.85])
def test_a_given_stature_is_known_to_half_a_centimetre(height_m):
    track = _track(np.random.default_rng(0), np.zeros(BODY.P))
    found = fit_track(prepare_track(BODY, track, CAMERA, height_m=height_m), lambda *_: None)
    assert abs(BODY.stature(found.betas) - height_m) < 3 * found.height_sigma_m
    assert 0.003 < found.height_sigma_m <= 0.0051
