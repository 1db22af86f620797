# SPDX-License-Identifier: GPL-3.0-or-later
"""Which recordings the lifter's training leaves out. Needs no PyTorch."""

import numpy as np
from scope.tools.train_lifter.motions import Motions
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


def test_takes_of_the_sets_are_held_out_by_performer_only():
    assert np.flatnonzero(is_held_out(np.arange(700))).max() == 139
    motions = motions_of(
        ["markers", "reactidle_reserved", "cmu_08", "cmu_12", "style100_mason"],
        take=range(195, 200),
    )
    assert held_out_frames(motions).take.tolist() == [195, 196, 197, 198]
