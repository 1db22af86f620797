# SPDX-License-Identifier: GPL-3.0-or-later
"""The clip of a person who talks and gestures: a motion a person could make, in the image."""

from __future__ import annotations

import numpy as np
import pytest
from scope.solver.body_file import load_body
from scope.solver.names import EXPRESSIONS
from scope.tools.render_talk.draw import PersonPainter
from scope.tools.render_talk.shot import SIZE, talk_shot


@pytest.fixture(scope="module")
def hands():
    return load_body("scope_h")


@pytest.fixture(scope="module")
def shot(hands):
    return talk_shot(hands)


def test_fingers_bend_into_the_right_palm_one_by_one_and_hands_stay_in_the_image(hands, shot):
    joint = hands.joint_names.index
    reach = {}
    for frame in range(len(shot)):
        _, t = hands.forward_kinematics(shot.rotations[frame], shot.trans[frame])
        pixels = shot.project(
            shot.to_camera(t[[joint("left_middle1"), joint("right_middle1"), joint("head")]])
        )
        assert (pixels > 0).all()
        assert (pixels < SIZE).all()
        for finger in ("index", "pinky"):
            wrist = t[joint("right_wrist")]
            tip = t[joint(f"right_{finger}3")]
            reach.setdefault(finger, []).append(np.linalg.norm(tip - wrist))
    closed = {finger: np.array(values) < 0.75 * values[0] for finger, values in reach.items()}
    assert closed["pinky"].argmax() + 5 < closed["index"].argmax()  # frames
    assert not closed["index"][-1]


def test_the_face_speaks_blinks_and_is_surprised(shot):
    weight = dict(zip(EXPRESSIONS, shot.weights.T, strict=True))
    assert (np.diff((weight["eyeBlinkLeft"] > 0.5).astype(int)) == 1).sum() == 3
    assert weight["jawOpen"].max() > 0.75
    assert weight["mouthSmileLeft"][-20:].max() > 0.7


def test_the_person_hides_the_room(hands, shot):
    room = np.full((*SIZE[::-1], 3), (0, 255, 0), np.uint8)
    picture = PersonPainter(hands, shot, room).picture(0).astype(int)
    green = picture[..., 1] - picture[..., [0, 2]].max(axis=-1) > 150
    assert green[20, 20]
    _, t = hands.forward_kinematics(shot.rotations[0], shot.trans[0])
    column, row = (
        shot.project(shot.to_camera(t[[hands.joint_names.index("spine3")]]))[0].round().astype(int)
    )
    assert not green[row, column]
