# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's body files are found by their publisher's names, and a regressor is used for its mesh
alone.
"""

import numpy as np
import pytest
from scope.benchmarks.evaluation.joint_sets import LSP14, REGRESSED17
from scope.benchmarks.evaluation.models import Models, pose_body

from .made_data import motion, write_models, write_regressor


@pytest.mark.parametrize(
    "name", ["SMPL_MALE", "basicModel_m_lbs_10_207_0_v1.0.0", "basicmodel_m_lbs_10_207_0_v1.1.0"]
)
def test_files_are_found_by_every_name_that_they_have_had(tmp_path, name):
    models = Models(write_models(tmp_path / "smpl", name))
    body = models.body("smpl", "male", "a data set")
    assert body.name == "smpl"
    assert models.body("smpl", "male", "a data set") is body  # read once


def test_a_regressor_is_for_one_mesh(tmp_path, body):
    matrix = write_regressor(tmp_path / "J.npy")
    models = Models(write_models(tmp_path / "smpl", "SMPL_NEUTRAL"), tmp_path / "J.npy")
    smpl = models.body("smpl", "neutral", "a data set")
    assert models.regressor_for(body) is None
    poses, trans, betas = motion(2, 24)
    posed = pose_body(smpl, poses, betas, trans, models.regressor_for(smpl))
    vertices = np.concatenate(list(posed.vertex_blocks()))
    assert np.allclose(posed.joints(REGRESSED17), matrix @ vertices)
    assert np.allclose(posed.joints(LSP14)[:, 0], matrix[6] @ vertices)  # the right ankle
    skeleton = posed.joints(("left_foot",))  # which the regressor does not give
    assert np.allclose(skeleton, pose_body(smpl, poses, betas, trans).joints(("left_foot",)))


def test_shapes_of_other_lengths_are_cut_or_filled(body):
    poses, trans, _ = motion(1, 24)
    long = pose_body(body, poses, np.arange(300.0) / 300, trans)
    assert np.allclose(long.betas, np.arange(body.P) / 300)
    assert np.allclose(pose_body(body, poses, np.array([0.5]), trans).betas[:2], [0.5, 0.0])
