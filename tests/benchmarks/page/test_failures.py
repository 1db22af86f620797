# SPDX-License-Identifier: GPL-3.0-or-later
"""The worst moments of a capture are those in which its joints are farthest from the truth."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scope.benchmarks.page.commands import WITHOUT_TRUTH
from scope.benchmarks.page.failures import KNOWN, limb_errors, worst_moments, worst_rows
from scope.solver.rotations import exp

from ...made_motion import made_motion

LIMBS = {
    **{"LShoulder": 16, "RShoulder": 17, "LElbow": 18, "RElbow": 19, "LWrist": 20, "RWrist": 21},
    **{"LHip": 1, "RHip": 2, "LKnee": 4, "RKnee": 5, "LAnkle": 7, "RAnkle": 8},
}
COUNT = 8


@pytest.fixture
def capture(body, tmp_path):
    """A motion, and the file with its ground truth, from which it is off in three frames, and which
    the last lacks.
    """
    poses = np.zeros((COUNT, 3 * (body.K + 1)))
    trans = np.zeros((COUNT, 3))
    motion = made_motion(body, poses, trans, rate=5.0)
    _, t = body.forward_kinematics(exp(poses.reshape(COUNT, -1, 3)), trans, np.zeros(body.P))
    T = np.linalg.inv(motion.world_from_camera[0])
    motion.joints_cam[:] = t @ T[:3, :3].T + T[:3, 3]
    true = motion.joints_cam[:, list(LIMBS.values())] + [0.5, 0.0, 1.0]  # hips are aligned
    true[2, list(LIMBS).index("RWrist")] += [0.0, 0.24, 0.0]
    true[3, list(LIMBS).index("RWrist")] += [0.0, 0.36, 0.0]
    true[6, list(LIMBS).index("LKnee")] += [0.12, 0.0, 0.0]
    path = tmp_path / "truth_made.npz"
    np.savez(path, names=list(LIMBS), joints=true[:-1], frame_index=np.arange(COUNT - 1))
    return motion, path


def test_errors_are_means_over_the_limb_joints(capture):
    errors = limb_errors(*capture)
    assert errors[:-1] == pytest.approx([0, 0, 20, 30, 0, 0, 10], abs=1e-3)
    assert np.isnan(errors[-1])


def test_the_worst_moments_are_apart(capture):
    motion, truth = capture
    assert worst_rows(limb_errors(motion, truth), motion.timestamps) == [3, 6]  # 2 is 0.2 s from 3
    assert worst_rows(np.full(COUNT, 5.0), motion.timestamps) == []
    # the mean is 5.9
    assert worst_rows(np.array([9.0, 8, 5, 5, 5, 5.5, 5, 5]), motion.timestamps) == [0]


def test_the_page_says_how_far_off_they_are(capture, body):
    shown = worst_moments(*capture, body)
    assert re.findall(r"<figcaption>([^<]*)<", shown) == [
        "frame 3, 0.60 s: 30 mm",
        "frame 6, 1.20 s: 10 mm",
    ]
    assert "its mean over the clip is 9 mm" in shown  # 60 / 7


def test_known_failures_are_of_clips_that_are_captured():
    assert set(KNOWN) <= set(WITHOUT_TRUTH)
    assert all(failure.first_s < failure.last_s for failure in KNOWN.values())
