# SPDX-License-Identifier: GPL-3.0-or-later
"""The recordings of the lifter's training: which are drawn how often, and which are held out. Needs
no PyTorch.
"""

import numpy as np
from scope.solver.rotations import exp
from scope.tools.train_lifter.motions import Motions, load_motions
from scope.tools.train_lifter.split import held_out_frames, is_held_out, training_frames


def motions_of(performers, kinds=None, sets=None, take=None):
    """One frame for each performer, each frame a take of its own unless takes are given."""
    n = len(performers)
    return Motions(
        np.tile(np.eye(3, dtype=np.float32), (n, 24, 1, 1)),
        np.arange(n) if take is None else np.asarray(take),
        np.full(n, 30.0),
        np.array(performers),
        np.full(n, "other") if kinds is None else np.array(kinds),
        np.full(n, "cmu_expmap") if sets is None else np.array(sets),
    )


def test_every_tenth_take_and_the_joint_prior_s_test_performers_are_held_out():
    performers = ["cmu_01"] * 12
    performers[3] = "cmu_02"
    performers[5] = "expmap_soccer"
    performers[9] = "expmap_jumping"
    motions = motions_of(performers)
    assert held_out_frames(motions).take.tolist() == [3, 5, 9]
    assert training_frames(motions).take.tolist() == [0, 1, 2, 4, 6, 7, 8, 10, 11]
    assert "cmu_02" not in training_frames(motions).performers


def test_renders_and_scenes_show_every_tenth_take_whoever_performs():
    assert np.flatnonzero(is_held_out(np.arange(30))).tolist() == [9, 19, 29]


def test_takes_of_the_sets_are_held_out_by_performer_only():
    assert np.flatnonzero(is_held_out(np.arange(700))).max() == 139
    motions = motions_of(
        ["markers", "reactidle_reserved", "cmu_08", "cmu_12", "style100_mason"],
        take=range(195, 200),
    )
    assert held_out_frames(motions).take.tolist() == [195, 196, 197, 198]


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
        take_source=np.array(["cmu_asf_amc", "cmu_expmap"]),
        take_subject=np.array(["cmu_02", "expmap_01_soccer"]),
        take_kind=np.array(["walk", "other"]),
        take_set=np.array(["cmu_asf_amc", "cmu_expmap"]),
    )
    motions = load_motions(path)
    assert motions.take.tolist() == [0, 0, 1, 1]
    assert motions.fps.tolist() == [30, 30, 120, 120]
    assert motions.performers.tolist() == ["cmu_02", "cmu_02", "expmap_soccer", "expmap_soccer"]
    assert motions.kinds.tolist() == ["walk", "walk", "other", "other"]
    assert motions.sets.tolist() == ["cmu_asf_amc", "cmu_asf_amc", "cmu_expmap", "cmu_expmap"]
    assert np.allclose(
        motions.Omega[:, 1], exp(np.array([[0.1 * k, 0, 0] for k in (0, 2, 3, 4)])), atol=1e-6
    )
    assert [end.tolist() for end in motions.ends] == [[0, 0, 2, 2], [1, 1, 3, 3]]
