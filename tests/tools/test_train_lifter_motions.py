# SPDX-License-Identifier: GPL-3.0-or-later
"""The recordings of the lifter's training: which are drawn how often, and which are held out. Needs no PyTorch."""

import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError
from scope.solver.rotations import exp
from scope.tools.train_lifter.motions import Motions, load_motions
from scope.tools.train_lifter.split import held_out_frames, is_held_out, training_frames


def motions_of(performers):
    """One frame for each performer, each frame a take of its own."""
    n = len(performers)
    return Motions(np.zeros((n, 24, 3, 3), np.float32), np.arange(n), np.full(n, 30.0), np.array(performers))


def test_every_tenth_take_and_the_joint_prior_s_test_performers_are_held_out():
    performers = ["cmu_01"] * 12
    performers[3], performers[5], performers[9] = "cmu_02", "expmap_soccer", "expmap_jumping"
    motions = motions_of(performers)
    assert held_out_frames(motions).take.tolist() == [3, 5, 9]
    assert training_frames(motions).take.tolist() == [0, 1, 2, 4, 6, 7, 8, 10, 11]
    assert "cmu_02" not in training_frames(motions).performers


def test_renders_and_scenes_show_every_tenth_take_whoever_performs():
    assert np.flatnonzero(is_held_out(np.arange(30))).tolist() == [9, 19, 29]


def test_common_poses_are_drawn_less_often_than_their_number_says():
    """Ninety frames of one pose and ten of another: shares per frame in the ratio of 1/√90 to 1/√10."""
    Omega = np.tile(np.eye(3, dtype=np.float32), (100, 24, 1, 1))
    Omega[90:, 5] = exp(np.array([1.0, 0, 0]))
    n = len(Omega)
    # Of a hundred identical centres, the first takes all frames of its pose.
    share = Motions(Omega, np.zeros(n, int), np.full(n, 30.0), np.full(n, "cmu_01")).share
    assert np.isclose(share.sum(), 1)
    assert np.allclose(share[:90], share[0])
    assert np.isclose(share[95] / share[0], 3.0)


def test_only_valid_frames_are_read_with_their_take_s_rate_and_performer(tmp_path):
    poses = np.zeros((5, 72), np.float32)
    poses[:, 3] = 0.1 * np.arange(5)
    path = tmp_path / "motions.npz"
    np.savez(
        path,
        poses=poses,
        valid=np.array([True, False, True, True, True]),
        take_start=np.array([0, 3, 5]),
        take_fps=np.array([30.0, 120.0]),
        take_source=np.array(["cmu_mocap", "cmu_expmap"]),
        take_subject=np.array(["cmu_02", "expmap_01_soccer"]),
    )
    motions = load_motions(path)
    assert motions.take.tolist() == [0, 0, 1, 1]
    assert motions.fps.tolist() == [30, 30, 120, 120]
    assert motions.performers.tolist() == ["cmu_02", "cmu_02", "expmap_soccer", "expmap_soccer"]
    assert np.allclose(motions.Omega[:, 1], exp(np.array([[0.1 * k, 0, 0] for k in (0, 2, 3, 4)])), atol=1e-6)
    assert [end.tolist() for end in motions.ends] == [[0, 0, 2, 2], [1, 1, 3, 3]]


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(MotionFileError, match="absent"):
        load_motions(tmp_path / "absent.npz")
