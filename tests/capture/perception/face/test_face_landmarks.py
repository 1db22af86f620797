# SPDX-License-Identifier: GPL-3.0-or-later
"""The face landmark network on a real face: where its parts are."""

from __future__ import annotations

import numpy as np


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
