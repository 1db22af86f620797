# SPDX-License-Identifier: GPL-3.0-or-later
"""RICH's layout: a pickle of SMPL-X for each frame, calibrations in XML, several cameras."""

import numpy as np
import pytest
from scope.benchmarks.evaluation.joint_sets import SMPL22
from scope.benchmarks.evaluation.models import Models
from scope.benchmarks.evaluation.readers.rich import clips
from scope.solver.rotations import exp

from ....untrusted.conftest import make_tables, smpl_formula
from ..made_data import K, motion, rigid, write_models, write_rich


@pytest.fixture
def models(tmp_path):
    return Models(write_models(tmp_path / "smplx", "SMPLX_MALE"))


def test_joints_are_those_of_smplx_in_the_world_and_in_the_camera(tmp_path, models):
    write_rich(tmp_path)
    (clip,) = clips(tmp_path, models)  # without the sequence of two people
    assert (clip.name, clip.protocols, clip.alone) == ("Gym_011_pushup1 cam_02", ("rich",), True)
    truth = clip.truth()
    assert np.allclose(truth.intrinsics, K)
    (person,) = truth.people
    assert person.rows.tolist() == [0, 1, 2, 3]  # the last image has no body
    poses, trans, betas = motion(5, 22)
    rotations = np.tile(np.eye(3), (55, 1, 1))
    rotations[:22] = exp(poses[3].reshape(22, 3))
    _, joints = smpl_formula(make_tables("smplx"), betas, rotations, trans[3])
    assert np.allclose(person.world.joints(SMPL22)[3], joints[:22], atol=1e-5)
    T = rigid(1, 3)[0]
    assert np.allclose(
        person.camera.joints(SMPL22)[3], joints[:22] @ T[:3, :3].T + T[:3, 3], atol=1e-5
    )
