# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of motion by the names of takes and by how the body moves."""

import numpy as np
import pytest
from scope.tools.mocap.kinds import KINDS, NAMED, kind_of, measured_kind, named_kind
from scope.tools.mocap.take import Take

NAMES = tuple(f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle"))


def made_take(hip_m, knee_m, m_per_s=0.0, source="elsewhere", name="a"):
    """Somebody whose hips and knees have these heights above the ankles, moving ahead."""
    z = m_per_s * np.arange(60)[:, None] / 30.0
    positions = np.zeros((60, len(NAMES), 3))
    for k, x in ((0, 0.1), (3, -0.1)):
        ahead = np.sqrt(0.42**2 - min(0.42, hip_m - knee_m) ** 2)
        for j, (y, forwards) in enumerate(((hip_m, 0.0), (knee_m, ahead), (0.0, ahead))):
            positions[:, k + j] = np.hstack(
                [np.full((60, 1), x), np.full((60, 1), y + 0.08), z + forwards]
            )
    return Take(name, "s", 30.0, NAMES, positions, source)


@pytest.mark.parametrize(
    ("take", "kind"),
    [
        (made_take(0.84, 0.42), "stand"),
        (made_take(0.84, 0.42, 1.2), "walk"),
        (made_take(0.82, 0.42, 3.0), "run"),
        (made_take(0.45, 0.42), "sit"),
        (made_take(0.2, 0.1), "floor"),
        (made_take(0.7, 0.42), "other"),
    ],
)
def test_what_no_name_says_is_measured(take, kind):
    assert measured_kind(take) == kind
    assert kind_of(take) == kind


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


def test_every_named_kind_is_known():
    assert {kind for patterns in NAMED.values() for _, kind in patterns} <= set(KINDS)
