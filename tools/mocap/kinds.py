# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of motion: by a take's name where it says what happens in it, otherwise by how the body
moves.
"""

from __future__ import annotations

import re

import numpy as np

from .take import Take

KINDS = ("stand", "walk", "run", "jump", "sit", "floor", "other")
# By source: the kind of the first pattern that is found in a take's name. What no pattern names is
# measured.
NAMED = {
    "cmu_asf_amc": (
        (r"^02_0[12]$", "walk"),
        (r"^02_03$", "run"),
        (r"^02_04$", "jump"),
        (r"^02_10$", "stand"),
        (r"^0[12]_", "other"),
    ),
    "cmu_expmap": (
        (r"walking", "walk"),
        (r"running", "run"),
        (r"jumping", "jump"),
        (r"basketball_signal|traffic|washwindow", "stand"),
        (r"basketball|soccer", "other"),
    ),
    "cmu_more": (
        (r"^05_01$|^06_01$|^0[78]_|^12_0[1-3]$", "walk"),
        (r"^09_12$", "walk"),
        (r"^09_", "run"),
        (r"^13_(13|4[0-2])$", "jump"),
        (r"^0[56]_|^13_3[3-8]$", "other"),
    ),
    "deepmimic": (
        (r"stealthy|zombie", "other"),  # they walk with bent legs on purpose
        (r"walk", "walk"),
        (r"run|jog", "run"),
        (r"jump|backflip|sideflip|frontflip", "jump"),
        (r"crawl|getup|roll|fall", "floor"),
        (r"cartwheel|dance|kick|punch|spin|throw|ballet", "other"),
    ),
    "accad": (
        (r"Crouch|Crawl|Lie", "floor"),
        (r"Skip|Hop|Leap|Jump", "jump"),
        (r"CartWheel|Random|Box|ChangeDirection|C24|C25|RunBackwards", "other"),
        (r"Run", "run"),
        (r"Walk|SideStep|D1_Urban", "walk"),
        (r"_A0[1-4]|_D[23]_", "stand"),
    ),
    "reactidle": ((r"", "stand"),),
    "rocketbox": (
        (r"_sit_|invite_sit", "sit"),
        (r"crouch", "floor"),
        (r"_run_|walk_to_run", "run"),
        (r"_walk|_turn_", "walk"),
        (r"cheer|danc|work|try_door|documents_take", "other"),
        (r"", "stand"),
    ),
    "style100": ((r"_ID$", "stand"), (r"_FR$", "run"), (r"", "walk")),
    "mesh2motion": (
        (r"Backflip|Jumping", "jump"),
        (r"Crawl|Meditate|Pushup|Sleeping|Kneeling", "floor"),
        (r"", "other"),
    ),
    "markers": (
        (r"_DJ", "jump"),
        (r"_STS", "sit"),
        (r"quat|DLS|tair|ballet|rom_", "other"),
        (r"static|Static|Calibration", "stand"),
        (r"_run0", "run"),
        (r"alk|PiG_Motion", "walk"),
    ),
}
# Measured, with the length of the leg as the unit of length. Median hips of people on the floor,
# and of those who sit:
FLOOR_HEIGHT = 0.45
SEAT_HEIGHT = 0.75
LEVEL_THIGH = 0.6  # of a thigh's length: what a sitting person's hip is above the knee, at most
# median speed of the hips in the horizontal plane
RUN_M_PER_S = 2.2
WALK_M_PER_S = 0.6
STAND_M_PER_S = 0.2
UPRIGHT = 0.93  # hips of people who stand, most of the time


def kind_of(take: Take) -> str:
    """Return the kind of motion of a take, one of `KINDS`."""
    return named_kind(take.source, take.name) or measured_kind(take)


def named_kind(source: str, name: str) -> str:
    """Return the kind that a take's name says, or an empty text."""
    return next((kind for pattern, kind in NAMED.get(source, ()) if re.search(pattern, name)), "")


def measured_kind(take: Take) -> str:
    """Return the kind of motion by speed and height of the hips and by the thighs; for sources
    whose floor is at 0.
    """
    hips = 0.5 * (take.joint("left_hip") + take.joint("right_hip"))
    knees = 0.5 * (take.joint("left_knee") + take.joint("right_knee"))
    thigh = float(
        np.median(np.linalg.norm(take.joint("left_hip") - take.joint("left_knee"), axis=1))
    )
    shank = float(
        np.median(np.linalg.norm(take.joint("left_knee") - take.joint("left_ankle"), axis=1))
    )
    ankles = np.minimum(take.joint("left_ankle")[:, 1], take.joint("right_ankle")[:, 1])
    height = (hips[:, 1] - np.minimum(ankles, np.median(ankles))) / (thigh + shank)
    step = max(1, min(round(take.fps / 3), len(take) - 1))
    speed = np.linalg.norm((hips[step:] - hips[:-step])[:, [0, 2]], axis=1) * take.fps / step
    middle = float(np.median(height))
    if middle < FLOOR_HEIGHT:
        return "floor"
    if middle < SEAT_HEIGHT and np.median(hips[:, 1] - knees[:, 1]) < LEVEL_THIGH * thigh:
        return "sit"
    if np.median(speed) > RUN_M_PER_S:
        return "run"
    if np.median(speed) > WALK_M_PER_S:
        return "walk"
    if np.median(speed) < STAND_M_PER_S and np.mean(height > UPRIGHT) > 0.7:
        return "stand"
    return "other"
