# SPDX-License-Identifier: GPL-3.0-or-later
"""BEDLAM's layout: rows of several people and images in one .npz, whose pickled arrays stay
unread.
"""

import numpy as np
import pytest
from scope.benchmarks.evaluation.joint_sets import SMPL22
from scope.benchmarks.evaluation.models import Models
from scope.benchmarks.evaluation.readers.bedlam import clips
from scope.solver.rotations import exp

from ....untrusted.conftest import make_tables, smpl_formula
from ..made_data import K, motion, rigid, write_bedlam, write_models


@pytest.fixture
def models(tmp_path):
    return Models(write_models(tmp_path / "smplx", "SMPLX_NEUTRAL"))


def test_rows_become_people_in_the_order_of_the_images(tmp_path, models):
    write_bedlam(tmp_path)
    (clip,) = clips(tmp_path, models)
    assert clip.name.endswith("6fps seq_000003")
    assert (clip.rate, clip.alone, len(clip.pictures)) == (6.0, False, 4)
    truth = clip.truth()
    assert np.allclose(truth.intrinsics, K)
    first, second = truth.people
    assert first.rows.tolist() == [0, 1, 2, 3]
    assert second.rows.tolist() == [2, 3]
    poses, trans, betas = motion(6, 55)
    rotations = exp(poses[5].reshape(55, 3))
    _, joints = smpl_formula(
        make_tables("smplx"), betas, rotations, trans[5] + rigid(6, 7)[5, :3, 3]
    )
    assert np.allclose(second.camera.joints(SMPL22)[1], joints[:22], atol=1e-6)
