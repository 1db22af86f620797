# SPDX-License-Identifier: GPL-3.0-or-later
"""A tree of one's own: a robot arm whose angles and place follow from trigonometry."""

from dataclasses import dataclass

import numpy as np
import pytest
from scope.solver import (
    Keypoints3D,
    Measurements,
    Priors,
    Status,
    fit,
    fit_clip,
    fit_motion,
    rotations,
)

LINKS_M = (0.5, 0.4, 0.3)


@dataclass
class Arm:
    """Three links along x, the second and third with an elbow; one shape coefficient makes the
    second link longer. Four markers on each link.
    """

    parents = np.array([-1, 0, 1])
    l = np.array([[0.0, 0.0, 0.0], [LINKS_M[0], 0.0, 0.0], [LINKS_M[1], 0.0, 0.0]])
    keypoint_part = np.repeat(np.arange(3), 4)
    S = np.zeros((3, 3, 1))
    V = np.zeros((12, 3, 1))
    v_bar = np.array(
        [
            [x * length, y, z]
            for length in LINKS_M
            for x in (0.3, 0.9)
            for y, z in ((0.05, 0.0), (0.0, 0.05))
        ]
    )

    def __post_init__(self) -> None:
        """Let the shape move the third joint, metres."""
        self.S = self.S.copy()
        self.S[2, 0, 0] = 1.0


def markers(angles, place, longer):
    """The markers by hand, of an arm that is bent about z."""
    found = []
    origin = np.asarray(place)
    heading = 0.0
    for link, length in enumerate(LINKS_M):
        heading += angles[link]
        along = np.array([np.cos(heading), np.sin(heading), 0.0])
        across = np.array([-np.sin(heading), np.cos(heading), 0.0])
        for x in (0.3, 0.9):
            for y, z in ((0.05, 0.0), (0.0, 0.05)):
                found.append(origin + x * length * along + y * across + [0.0, 0.0, z])
        origin = origin + (length + (longer if link == 1 else 0.0)) * along
    return np.array(found)


ANGLES = (0.4, -1.1, 0.7)
PLACE = (0.1, -0.2, 2.0)
LONGER_M = 0.05


def angle(Omega):
    return rotations.log(Omega)[..., 2]


def test_angles_place_and_length_come_out():
    seen = Measurements(keypoints3d=Keypoints3D(np.arange(12), markers(ANGLES, PLACE, LONGER_M)))
    found = fit(Arm(), seen, priors=Priors(joint_weights=np.zeros(2)))
    assert found.status is Status.CONVERGED
    assert found.state.beta[0] == pytest.approx(LONGER_M, abs=1e-3)  # the shape's prior is at 0
    np.testing.assert_allclose(angle(found.state.R_camera_root), ANGLES[0], atol=1e-3)
    np.testing.assert_allclose(angle(found.state.Omega), ANGLES[1:], atol=2e-3)
    np.testing.assert_allclose(found.t_camera_part[0], PLACE, atol=1e-3)


def test_clips_and_motions_share_the_length():
    turns = np.linspace(0.0, 0.5, 6)
    clip = np.array([markers(np.add(ANGLES, turn), PLACE, LONGER_M) for turn in turns])
    seen = Measurements(keypoints3d=Keypoints3D(np.arange(12), clip))
    free = Priors(joint_weights=np.zeros(2))
    together = fit_clip(Arm(), seen, priors=free)
    assert together.beta[0] == pytest.approx(LONGER_M, abs=1e-3)
    motion = fit_motion(Arm(), seen, turns, priors=free)
    first = motion.states[0]
    np.testing.assert_allclose(angle(first.Omega), np.add(ANGLES[1:], turns[0]), atol=5e-3)
