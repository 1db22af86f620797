# SPDX-License-Identifier: GPL-3.0-or-later
"""The direction across rendered heads that turn, nod and lean, as the network sees their faces, and
its certainty.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera, choose_camera
from scope.scope_addon.capture.perception.face_landmarks import FaceEstimate, FaceNetwork
from scope.scope_addon.capture.perception.face_record import RECORD, record
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.expression_fit import across_head, certainty
from scope.solver.body_file import load_body
from scope.solver.rotations import exp
from scope.tools.render_faces.looks import draw_look
from scope.tools.render_faces.shaded import ShadedStage
from scope.tools.render_faces.truth import MIDDLE, SIZE, focal_px

FRONTAL = np.diag([1.0, -1.0, -1.0])
DISTANCE_M = 0.8


def camera_of(focal: float) -> Camera:
    return Camera(
        np.array([[focal, 0, SIZE / 2], [0, focal, SIZE / 2], [0, 0, 1.0]]), np.zeros(5), "given"
    )


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the network sees of the default body's face, turned by degrees about the head's axes, in
    the middle.
    """
    body = load_body("scope")
    path = tmp_path_factory.mktemp("faces") / "face.png"
    stage = ShadedStage(body)
    network = FaceNetwork()
    rng = np.random.default_rng(8)
    stage.dress(draw_look(body, rng), rng)

    @cache
    def estimate(turn_deg) -> FaceEstimate:
        R = FRONTAL @ exp(np.radians(turn_deg))
        stage.render(
            (body.v_template - MIDDLE) @ R.T + [0, 0, DISTANCE_M], focal_px(DISTANCE_M), path
        )
        image = np.ascontiguousarray(cv2.imread(str(path))[..., ::-1])
        first = network.estimate(image, Region((SIZE / 2, SIZE / 2), 0.8 * SIZE, 0.0))
        return network.estimate(image, first.next_region)

    return estimate


@pytest.mark.parametrize("turn_deg", [(0, 0, -35), (0, 35, 0), (15, -30, 10)])
def test_the_direction_across_a_rendered_head(seen, turn_deg):
    (found,) = across_head(record(seen(turn_deg))[None], camera_of(focal_px(DISTANCE_M)))
    true = (FRONTAL @ exp(np.radians(turn_deg)))[:, 0]
    assert np.degrees(np.arccos(found @ true)) < 5


def test_a_face_that_looks_frontal_at_the_edge_of_the_image_is_turned(seen):
    """It looks along the line of sight, 30° beside the camera's axis."""
    estimate = seen((0, 0, 0))
    focal = 300.0
    places = (0.0, focal * np.tan(np.radians(30.0)))
    rows = [record(replace(estimate, landmarks=estimate.landmarks + [x, 0, 0])) for x in places]
    middle, aside = np.degrees(
        [np.arctan2(d[2], d[0]) for d in across_head(np.array(rows), camera_of(focal))]
    )
    assert aside - middle == pytest.approx(-30.0, abs=2)


def test_a_face_of_which_the_network_is_unsure_counts_by_the_cube_of_its_presence(seen):
    rows = np.array([record(replace(seen((0, 0, 0)), presence=p)) for p in (1.0, 0.5)])
    across = across_head(rows, camera_of(300.0))
    sure, unsure = certainty(rows, across, across)
    assert unsure == pytest.approx(sure / 8, rel=1e-6)


def test_frames_without_a_face_have_no_direction():
    face = np.zeros((2, RECORD))
    ears = np.tile([0.15, 0, 0], (2, 1))
    across = across_head(face, choose_camera(SIZE, SIZE))
    assert not across.any()
    assert not certainty(face, across, ears).any()
