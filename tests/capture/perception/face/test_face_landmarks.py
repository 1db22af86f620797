# SPDX-License-Identifier: GPL-3.0-or-later
"""The face networks on a real face: which side is which, and that one eye can be closed alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.perception.face.face_landmarks import FaceEstimate, FaceNetwork
from scope.scope_addon.capture.perception.region import Region
from scope.solver.names import EXPRESSIONS

# Upper lid, lower lid and corners of the person's left and right eye, in the mesh of 478 points.
LIDS = {
    "Left": ((398, 384, 385, 386, 387, 388, 466), (382, 381, 380, 374, 373, 390, 249)),
    "Right": ((173, 157, 158, 159, 160, 161, 246), (155, 154, 153, 145, 144, 163, 7)),
}


@pytest.fixture(scope="module")
def network() -> FaceNetwork:
    return FaceNetwork(1)


@pytest.fixture(scope="module")
def face(shared: Path, network: FaceNetwork) -> tuple[np.ndarray, FaceEstimate]:
    video = cv2.VideoCapture(str(shared / "data" / "clips" / "squats_5fps.mp4"))
    ok, frame = video.read()
    assert ok
    image = np.ascontiguousarray(frame[:, :, ::-1])
    head = network.estimate(image, Region(_head(image), 130.0, 0.0))
    return image, network.estimate(image, head.next_region)


def _head(image: np.ndarray) -> tuple[float, float]:
    """The middle of the skin-coloured pixels of the upper part of the picture, which are the face's."""
    hue, saturation, value = cv2.split(cv2.cvtColor(image, cv2.COLOR_RGB2HSV))
    skin = ((hue < 20) | (hue > 170)) & (saturation > 30) & (saturation < 160) & (value > 120)
    rows, columns = np.nonzero(skin[: image.shape[0] // 4])
    return float(np.median(columns)), float(np.median(rows))


def test_a_real_face_is_present_and_in_order(face):
    _, estimate = face
    points = estimate.landmarks[:, :2]
    assert estimate.presence > 0.9
    assert points[263, 0] > points[33, 0]  # the person's left eye is on the right of the picture
    assert points[10, 1] < points[1, 1] < points[13, 1] < points[152, 1]  # forehead, nose, lips, chin


def test_a_wall_is_no_face(face, network):
    image, estimate = face
    wall = network.estimate(np.full_like(image, 128), estimate.region)
    assert wall.presence < 0.1


@pytest.mark.parametrize("side", ["Left", "Right"])
def test_closing_one_eye_is_a_blink_of_that_eye(face, network, side):
    _, estimate = face
    closed = estimate.landmarks.copy()
    upper, lower = LIDS[side]
    closed[list(upper)] = closed[list(lower)]
    before, after = network.expression(estimate), network.expression(replace(estimate, landmarks=closed))
    rise = {eye: (after - before)[EXPRESSIONS.index(f"eyeBlink{eye}")] for eye in LIDS}
    other = "Left" if side == "Right" else "Right"
    assert rise[side] > 0.2
    assert rise[side] > 2 * rise[other]


def test_the_expression_does_not_depend_on_position_and_size(face, network):
    _, estimate = face
    moved = replace(estimate, landmarks=3.0 * estimate.landmarks + [500.0, 70.0, 0.0])
    np.testing.assert_allclose(network.expression(moved), network.expression(estimate), atol=1e-3)
