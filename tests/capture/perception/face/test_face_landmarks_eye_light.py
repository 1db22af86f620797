# SPDX-License-Identifier: GPL-3.0-or-later
"""Light around the eyes, on pictures that are painted here."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.face_landmarks import FACE_POINTS, eye_light

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
        (60, (15, 15), 0.25),
        (200, (30, 180), 0.9),
        (4, (0, 0), 1.0),
    ],
)
def test_light_is_that_of_the_brighter_eye_over_the_skin(skin, around_eyes, light):
    assert eye_light(*painted(skin, around_eyes)) == pytest.approx(light)


def test_an_eye_itself_is_not_taken_for_glasses():
    image, landmarks = painted(120, (120, 120))
    for left in (30, 70):
        image[36:44, left + 4 : left + 16] = 10  # an iris, and lashes
    assert eye_light(image, landmarks) == pytest.approx(1.0)


def test_a_face_beyond_the_edge_of_the_image_says_nothing():
    image, landmarks = painted(120, (10, 10))
    assert eye_light(image, landmarks + [500.0, -300.0, 0.0]) == 1.0


@pytest.mark.parametrize("rows", [slice(60, 100), slice(0, 20)])  # a white mask, a light cap
def test_what_is_brighter_than_skin_is_no_measure(rows):
    image, landmarks = painted(90, (80, 80))
    image[rows] = 250
    assert eye_light(image, landmarks) == pytest.approx(80 / 90)


def test_small_eyes_say_nothing():
    image, landmarks = painted(120, (10, 10))
    assert eye_light(np.ascontiguousarray(image[::4, ::4]), landmarks / 4) == 1.0


@pytest.mark.parametrize("number", [33, 50, 151])  # of an eye, a cheek, the forehead
def test_landmarks_that_are_not_finite_say_nothing(number):
    image, landmarks = painted(200, (30, 30))
    for value in (np.nan, np.inf):
        landmarks[number, :2] = value
        assert eye_light(image, landmarks) == 1.0
