# SPDX-License-Identifier: GPL-3.0-or-later
"""BEDLAM's layout: rows of several people and images in one .npz, whose pickled arrays stay
unread.
"""

import numpy as np
import pytest
from scope.benchmarks.evaluation.files import DatasetError
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


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"imgname": np.array(["../../etc/passwd"] * 6)}, "imgname holds"),
        ({"imgname": np.zeros(6)}, "imgname must hold names"),
        ({"pose_cam": np.zeros((6, 72))}, "pose_cam must have shape"),
        ({"pose_cam": np.zeros((5, 165))}, "differ in length"),
        ({"trans_cam": None}, "lacks trans_cam"),
        ({"trans_cam": np.full((6, 3), np.inf)}, "trans_cam contains NaN or infinity"),
    ],
)
def test_damage_is_one_sentence(tmp_path, models, changes, said):
    path = write_bedlam(tmp_path)
    arrays = {
        key: value
        for key, value in np.load(path, allow_pickle=True).items()
        if key != "motion_info"
    } | changes
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})
    with pytest.raises(DatasetError, match=said) as found:
        clips(tmp_path, models)[0].truth()
    assert str(path) in str(found.value)


def test_closeups_are_left_out(tmp_path, models):
    path = write_bedlam(tmp_path)
    np.savez(path.with_name("20221019_1_250_highbmihand_closeup_suburb_b_6fps.npz"))
    assert len(clips(tmp_path, models)) == 1


def test_missing_images_are_named(tmp_path, models):
    write_bedlam(tmp_path)
    (tmp_path / "validation").rename(tmp_path / "elsewhere")
    with pytest.raises(DatasetError, match=r"validation.*png does not exist"):
        clips(tmp_path, models)
