# SPDX-License-Identifier: GPL-3.0-or-later
"""EMDB's layout: SMPL's parameters in the world, a camera that moves, frames that do not count."""

import numpy as np
import pytest
from scope.benchmarks.evaluation.joint_sets import SMPL24
from scope.benchmarks.evaluation.models import Models
from scope.benchmarks.evaluation.readers.emdb import clips
from scope.solver.rotations import exp

from ....untrusted.conftest import make_tables, smpl_formula
from ..made_data import K, motion, rigid, write_emdb, write_models


@pytest.fixture
def models(tmp_path):
    return Models(write_models(tmp_path / "smpl", "SMPL_FEMALE"))


def test_joints_are_those_of_smpl_in_the_world_and_in_the_camera(tmp_path, models):
    write_emdb(tmp_path)
    (clip,) = clips(tmp_path, models)
    assert (clip.name, clip.protocols, len(clip.pictures)) == ("P0 00_mvs_a", ("emdb1",), 6)
    truth = clip.truth()
    assert np.allclose(truth.intrinsics, K)
    (person,) = truth.people
    assert person.rows.tolist() == [0, 2, 3, 4, 5]
    poses, trans, betas = motion(6, 24)
    extrinsics = rigid(6, 2)
    for row, frame in enumerate(person.rows):
        _, joints = smpl_formula(
            make_tables("smpl"), betas, exp(poses[frame].reshape(24, 3)), trans[frame]
        )
        assert np.allclose(person.world.joints(SMPL24)[row], joints, atol=1e-6)
        in_camera = joints @ extrinsics[frame, :3, :3].T + extrinsics[frame, :3, 3]
        assert np.allclose(person.camera.joints(SMPL24)[row], in_camera, atol=1e-6)
