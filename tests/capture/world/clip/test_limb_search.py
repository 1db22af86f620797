# SPDX-License-Identifier: GPL-3.0-or-later
"""A limb that starts on the wrong side of the image plane, on motions whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.solver.rotations import exp

from .waving_person import BODY, HIPS, JOINTS, LEG, fit, joints, person, prepare

FRAMES = 64
SPAN = slice(12, 52)


@pytest.mark.parametrize("moving", [False, True])
def test_a_limb_that_starts_mirrored_for_long_ends_where_it_was(moving: bool) -> None:
    """For forty frames, the lifter cannot tell the thigh before the hip from one behind it, and the
    start is wrong.
    """
    angles = np.linspace(0.0, 0.3, FRAMES)
    turns = exp(np.array([[0.0, angle, 0.0] for angle in (angles if moving else 0.0 * angles)]))
    path = CameraPath(turns, np.linspace([0.0, 0.0, 0.0], [0.4, 0.0, 0.0], FRAMES) * moving)
    track, true = person(FRAMES, path)
    unsure = track.world_landmarks.copy()
    sigma = np.full((FRAMES, JOINTS), 0.1)
    unsure[SPAN, LEG, 2] = unsure[SPAN, HIPS[1], None, 2]
    sigma[SPAN, LEG] = 0.8
    start = replace(true, rotations=true.rotations.copy())
    for joint, angle in (("right_hip", -0.3), ("right_knee", -0.9)):
        start.rotations[SPAN, BODY.joint_names.index(joint)] = exp(np.array([angle, 0.0, 0.0]))
    ankle = BODY.joint_names.index("right_ankle")
    truth, before, after = (
        joints(each)[:, ankle]
        for each in (
            true,
            start,
            path.to_first(fit(prepare(track, unsure, sigma), path.to_frames(start), path)),
        )
    )
    assert np.linalg.norm(before - truth, axis=1)[SPAN].min() > 0.5
    assert np.linalg.norm(after - truth, axis=1).max() < 0.1
