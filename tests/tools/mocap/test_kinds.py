# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of motion by the names of takes and by how the body moves."""

import pytest
from scope.tools.mocap.kinds import named_kind


@pytest.mark.parametrize(
    ("source", "name", "kind"),
    [
        ("cmu_expmap", "train_walking_3", "walk"),
        ("cmu_expmap", "train_basketball_signal_1", "stand"),
        ("cmu_expmap", "train_basketball_1", "other"),
        ("deepmimic", "stealthy_walk0", "other"),
        ("deepmimic", "long_walk1", "walk"),
        ("rocketbox", "m_sit_chair_idle_cough", "sit"),
        ("rocketbox", "f_sit_stand_up_chair_01", "sit"),
        ("rocketbox", "m_walk_to_run", "run"),
        ("rocketbox", "f_turn_left_120_to_walk", "walk"),
        ("rocketbox", "m_idle_neutral_01", "stand"),
        ("accad", "Female1_B03_Walk1", "walk"),
        ("accad", "Female1_B24_WalkToCrouch", "floor"),
        ("accad", "Female1_C11_RunTurnLeft90", "run"),
        ("style100", "Neutral_FR", "run"),
        ("markers", "opencap_subject4_walkingTI2", "walk"),
        ("cmu_more", "13_15", ""),
    ],
)
def test_names_say_what_happens(source, name, kind):
    assert named_kind(source, name) == kind
