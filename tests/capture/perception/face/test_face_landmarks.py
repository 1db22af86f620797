# SPDX-License-Identifier: GPL-3.0-or-later
"""The face landmark network on a real face: where its parts are.

The expression network on a real face: which side is which, and that one eye can be closed
alone.

Light around the eyes, on pictures that are painted here.

Regions of the face: the same face, however the body's head and the landmarks are turned and
scaled.

The direction of eyes whose irises were placed on an eyeball of 12 mm, however the head is
turned.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.face_landmarks import (
    EXPRESSION_POINTS,
    FACE_POINTS,
    ExpressionNetwork,
    eye_light,
    region_from_body,
    region_from_landmarks,
)
from scope.scope_addon.capture.perception.face_record import gaze, head_axes
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.solver.rotations import exp


def test_a_real_face_is_present_and_in_order(face):
    _, estimate = face
    points = estimate.landmarks[:, :2]
    assert estimate.presence > 0.9
    assert points[263, 0] > points[33, 0]  # the person's left eye is on the right of the picture
    # forehead, nose, lips, chin
    assert points[10, 1] < points[1, 1] < points[13, 1] < points[152, 1]


def test_a_wall_is_no_face(face, network):
    image, estimate = face
    wall = network.estimate(np.full_like(image, 128), estimate.region)
    assert wall.presence < 0.1


# Upper lid, lower lid and corners of the person's left and right eye, in the mesh of 478 points.
LIDS = {
    "Left": ((398, 384, 385, 386, 387, 388, 466), (382, 381, 380, 374, 373, 390, 249)),
    "Right": ((173, 157, 158, 159, 160, 161, 246), (155, 154, 153, 145, 144, 163, 7)),
}


@pytest.fixture(scope="module")
def weights_of():
    network = ExpressionNetwork()
    return lambda landmarks: network.estimate(landmarks[list(EXPRESSION_POINTS), :2])


@pytest.mark.parametrize("side", ["Left", "Right"])
def test_closing_one_eye_is_a_blink_of_that_eye(face, weights_of, side):
    _, estimate = face
    closed = estimate.landmarks.copy()
    upper, lower = LIDS[side]
    closed[list(upper)] = closed[list(lower)]
    before = weights_of(estimate.landmarks)
    after = weights_of(closed)
    rise = {eye: (after - before)[EXPRESSIONS.index(f"eyeBlink{eye}")] for eye in LIDS}
    other = "Left" if side == "Right" else "Right"
    assert rise[side] > 0.2
    assert rise[side] > 2 * rise[other]


CORNERS = {33: (30, 40), 133: (50, 40), 362: (70, 40), 263: (90, 40)}


CHEEKS = {
    50: (35, 70), 101: (42, 66), 205: (40, 75), 36: (46, 72),
    280: (85, 70), 330: (78, 66), 425: (80, 75), 266: (74, 72),
}  # fmt: skip


FOREHEAD = {151: (60, 10), 108: (50, 10), 69: (40, 12), 337: (70, 10), 299: (80, 12)}


def painted(skin: int, around_eyes: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    image = np.full((100, 120, 3), skin, np.uint8)
    for left, value in zip((28, 68), around_eyes, strict=True):
        image[28:52, left : left + 25] = value
    landmarks = np.zeros((FACE_POINTS, 3))
    for number, place in (CORNERS | CHEEKS | FOREHEAD).items():
        landmarks[number, :2] = place
    return image, landmarks


@pytest.mark.parametrize(
    ("skin", "around_eyes", "light"),
    [
        (200, (200, 200), 1.0),
        (200, (30, 30), 0.15),
        (200, (30, 180), 0.9),
        (4, (0, 0), 1.0),
    ],
)
def test_light_is_that_of_the_brighter_eye_over_the_skin(skin, around_eyes, light):
    assert eye_light(*painted(skin, around_eyes)) == pytest.approx(light)


def test_a_face_beyond_the_edge_of_the_image_says_nothing():
    image, landmarks = painted(120, (10, 10))
    assert eye_light(image, landmarks + [500.0, -300.0, 0.0]) == 1.0


def test_small_eyes_say_nothing():
    image, landmarks = painted(120, (10, 10))
    assert eye_light(np.ascontiguousarray(image[::4, ::4]), landmarks / 4) == 1.0


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_landmarks_that_are_not_finite_say_nothing(value):
    image, landmarks = painted(200, (30, 30))
    landmarks[50, :2] = value
    assert eye_light(image, landmarks) == 1.0


# A frontal head, metres from the middle of the eyes, y down; the person's left is to the right.
HEAD = {
    "nose": (0, 0.035), "left_eye": (0.0315, 0), "right_eye": (-0.0315, 0),
    "left_ear": (0.075, 0.02),
    "right_ear": (-0.075, 0.02), "mouth_left": (0.025, 0.068), "mouth_right": (-0.025, 0.068),
}  # fmt: skip


def keypoints(scale: float, angle: float) -> np.ndarray:
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    out = np.zeros((33, 2))
    for name, point in HEAD.items():
        out[KEYPOINT_NAMES.index(name)] = scale * R @ point + [300, 200]
    return out


@pytest.mark.parametrize("angle", [0.6, 3.0])
def test_the_body_predicts_a_face_whichever_way_up_it_is(angle):
    region = region_from_body(keypoints(500.0, angle))
    assert region.side_px == pytest.approx(1.5 * 0.185 * 500, rel=0.02)
    assert np.angle(np.exp(1j * (region.rotation - angle))) == pytest.approx(0, abs=0.02)
    x, y = region.crop_from_image(np.array([300.0, 200.0]))
    assert x == pytest.approx(0.5)
    assert 0.3 < y < 0.5  # the eyes are above the middle


def test_the_landmarks_box_fills_two_thirds_along_the_line_of_the_eyes():
    points = np.random.default_rng(1).uniform(-1, 1, (FACE_POINTS, 2)) * [30, 40]
    points[[33, 263]] = [[-20, -10], [20, -10]]
    points[:2] = [[-30, -40], [30, 40]]
    c = np.cos(0.5)
    s = np.sin(0.5)
    region = region_from_landmarks(points @ np.array([[c, s], [-s, c]]) + [100, 50])
    assert region.center_px == pytest.approx((100, 50))
    assert region.side_px == pytest.approx(1.5 * 80)
    assert region.rotation == pytest.approx(0.5)


# Metres in the head's axes: x to the person's left, y up, z out of the face.
EYE_CORNERS = {
    362: (0.016, 0, 0),
    263: (0.046, 0, 0),
    133: (-0.016, 0, 0),
    33: (-0.046, 0, 0),
}


R_CAMERA_FRONTAL = np.diag([1.0, -1.0, -1.0])


def landmarks(direction: np.ndarray, turn: tuple[float, float, float]) -> np.ndarray:
    points = np.zeros((478, 3))
    for number, point in EYE_CORNERS.items():
        points[number] = point
    points[10] = (0, 0.08, 0)
    points[152] = (0, -0.11, 0)
    for iris, x in ((473, 0.031), (468, -0.031)):
        points[iris] = np.array([x, 0, 0]) + 0.012 * direction
    return 2000 * points @ (R_CAMERA_FRONTAL @ exp(np.array(turn))).T + [400, 300, 0]


@pytest.mark.parametrize(
    ("direction", "turn"),
    [((0, 0, 1), (0, 0.6, 0)), ((0.3, 0.2, 0.93), (0.3, -0.4, 0.5)), ((-0.4, 0, 0.92), (0, 0, 0))],
)
def test_the_gaze_is_where_the_irises_were_turned(direction, turn):
    direction = np.array(direction) / np.linalg.norm(direction)
    points = landmarks(direction, turn)
    np.testing.assert_allclose(
        head_axes(points), R_CAMERA_FRONTAL @ exp(np.array(turn, float)), atol=1e-9
    )
    np.testing.assert_allclose(gaze(points), [direction, direction], atol=0.01)
