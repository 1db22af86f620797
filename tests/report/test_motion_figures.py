# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of motions whose figures are known."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.report.motion_figures import height_text, highest_speed, motion_figures

from ..made_motion import made_motion


def test_a_walk_of_known_length_and_speed(body):
    T = 61
    trans = np.zeros((T, 3))
    # 1.5 m in a second, then a second of standing
    trans[:, 0] = np.minimum(np.arange(T), 30) / 30 * 1.5
    trans[:, 2] = 0.9 - body.rest_joints()[0, 2]
    contact = np.zeros((T, 4))
    contact[31:, 1] = 1.0
    residual = np.r_[np.full(T - 1, 4.0), 100.0]
    valid = np.arange(T) < T - 1
    motion = made_motion(
        body,
        np.zeros((T, 3 * (body.K + 1))),
        trans,
        foot_contact=contact,
        residual_px=residual,
        valid=valid,
    )
    figures = motion_figures(motion, body)
    assert figures["Frames seen"] == "60 of 61"
    assert figures["Path over the floor"] == "1.50 m"
    assert figures["Highest speed"] == "1.50 m/s"
    assert figures["Pelvis height"] == "0.90 to 0.90 m"
    # of the frames in which the person was seen
    assert figures["Reprojection error, mean"] == "4.0 px"
    assert figures["Left foot in contact"] == "49 % of frames"
    assert figures["Right foot in contact"] == "0 % of frames"
    assert figures["Frames to review"] == "1"
    assert figures["Height"] == f"{100 * np.ptp(body.v_template[:, 1]):.0f} cm"


def test_the_height_with_its_deviation():
    assert height_text(1.7449, 0.0882) == "174 ± 9 cm"
    assert height_text(1.7449, 0.005) == "174.5 ± 0.5 cm"
    assert height_text(1.7449, np.nan) == "174 cm"


def test_speed_of_very_short_motions():
    assert highest_speed(np.zeros((1, 2)), np.zeros(1)) == 0.0
    assert np.isclose(highest_speed(np.array([[0.0, 0], [0.2, 0]]), np.array([0.0, 0.1])), 2.0)
