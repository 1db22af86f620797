# SPDX-License-Identifier: GPL-3.0-or-later
"""EMDB's layout: SMPL's parameters in the world, a camera that moves, frames that do not count."""

import numpy as np
import pytest
from scope.benchmarks.evaluation.files import DatasetError
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


def test_both_parts_may_hold_a_sequence(tmp_path, models):
    write_emdb(tmp_path, emdb2=np.bool_(True))
    assert clips(tmp_path, models)[0].protocols == ("emdb1", "emdb2")


def test_without_smpl_the_ground_truth_cannot_be_computed(tmp_path):
    write_emdb(tmp_path)
    with pytest.raises(
        DatasetError,
        match=r"parameters of SMPL: give the folder .* "
        r"SMPL_FEMALE\.npz .* --smpl FOLDER",
    ):
        clips(tmp_path, Models())[0].truth()


def test_a_gender_without_a_file_is_named(tmp_path, models):
    write_emdb(tmp_path, gender="male")
    with pytest.raises(DatasetError, match=r"holds none of SMPL_MALE\.npz"):
        clips(tmp_path, models)[0].truth()


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        ({"gender": "robot"}, "gender must be one of"),
        ({"smpl": 3}, "lacks smpl"),
        ({"camera": {"intrinsics": K}}, "lacks extrinsics"),
        ({"camera": {"intrinsics": K, "extrinsics": np.zeros((9, 4, 4))}}, "is about 9 frames"),
        ({"good_frames_mask": np.zeros(6, bool)}, "marks no frame"),
        ({"good_frames_mask": np.zeros(5, bool)}, r"good_frames_mask must have shape \(6\)"),
    ],
)
def test_damage_is_one_sentence(tmp_path, models, flags, said):
    path = write_emdb(tmp_path, **flags)
    with pytest.raises(DatasetError, match=said) as found:
        clips(tmp_path, models)[0].truth()
    assert str(path) in str(found.value)


def test_sequences_of_neither_part_are_left_out(tmp_path, models):
    write_emdb(tmp_path, emdb1=False)
    with pytest.raises(DatasetError, match="no sequence of EMDB 1 or EMDB 2"):
        clips(tmp_path, models)
