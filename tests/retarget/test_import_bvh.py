# SPDX-License-Identifier: GPL-3.0-or-later
"""BVH files of other tools against the motion that they were made from: names, rest poses, axes,
units, orders of channels, and files that are damaged.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError
from scope.solver.rotations import exp, shortest_turn

from ..edit.walking import NAMES
from .made_bvh import (
    AT_REST,
    FRAMES,
    PARENTS,
    TOOLS,
    assert_is_the_motion,
    bvh,
    imported,
)


@pytest.mark.parametrize("tool", TOOLS)
def test_joints_are_recognized_by_the_names_of_common_tools(tmp_path, tool):
    found = imported(tmp_path, bvh(TOOLS[tool]))
    assert_is_the_motion(found)
    assert [note.code for note in found.notes] == ["other_skeleton"]


@pytest.mark.parametrize(
    ("order", "unit", "up"),
    [
        ("XYZ", 1.0, [1, 0, 0]),
        ("YZX", 1 / 0.0254, [-1, 0, 0]),
        ("ZYX", 1000.0, [0, 0, 1]),
    ],
)
def test_any_order_of_channels_unit_and_axis(tmp_path, order, unit, up):
    R_file = np.round(exp(np.pi / 2 * np.array(up, float)))
    found = imported(tmp_path, bvh(TOOLS["cmu"], order=order, unit=unit, R_file=R_file))
    assert_is_the_motion(found)


def rest_of(arms: float, bent: float = 0.0, spread: float = 0.0) -> np.ndarray:
    """Rotations from the T-pose: arms lowered, elbows and knees bent, legs spread."""
    S = np.tile(np.eye(3), (len(NAMES), 1, 1))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        lowered = exp(np.array([0.0, 0.0, -sign * arms]))
        elbow = lowered @ exp(np.array([0.0, -sign * bent, 0.0]))
        thigh = exp(np.array([0.0, 0.0, sign * spread]))
        parts = {"shoulder": lowered, "elbow": elbow, "wrist": elbow, "hand": elbow}
        parts |= {"hip": thigh, "knee": thigh}
        for part, turn in parts.items():
            S[NAMES.index(f"{side}_{part}")] = turn
    return S


@pytest.mark.parametrize("rest", [rest_of(0.8), rest_of(1.4, 0.3, 0.2)])
def test_limbs_keep_their_directions_whatever_the_rest_pose(tmp_path, rest):
    assert_is_the_motion(imported(tmp_path, bvh(TOOLS["mixamo"], rest)))


def test_a_rest_pose_that_is_no_person(tmp_path):
    """Every chain lies along x, as in files that keep the bones' axes."""
    S = np.tile(np.eye(3), (len(NAMES), 1, 1))
    for joint, name in enumerate(NAMES):
        children = [k for k, parent in enumerate(PARENTS) if parent == joint]
        if children and name not in ("pelvis", "spine3"):
            S[joint] = shortest_turn(AT_REST[children[0]] - AT_REST[joint], np.array([1.0, 0, 0]))
        elif joint:
            S[joint] = S[PARENTS[joint]]
    S[0] = exp(np.array([0.0, 0.0, -np.pi / 2]))
    found = imported(tmp_path, bvh(TOOLS["cmu"], S))
    assert_is_the_motion(found)
    assert [note.code for note in found.notes] == ["no_rest_pose", "other_skeleton"]


WHOLE = bvh(TOOLS["cmu"])


@pytest.mark.parametrize(
    ("step", "rate"),
    [
        ("0.017", 60.0),
        ("0.0166", 60.0),  # cut off
        ("0.016683", 60000 / 1001),
        ("0.02", 50.0),
        ("0.008", 125.0),
        ("0.0083", 120.0),
        ("5e-2", 20.0),
        ("0.012400", 1 / 0.0124),
    ],
)
def test_a_rounded_frame_time_is_that_of_the_usual_rate(tmp_path, step, rate):
    found = imported(tmp_path, WHOLE.replace("Frame Time: 0.033333", f"Frame Time: {step}"))
    assert found.motion.mocap_framerate == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no MOTION"),
        (WHOLE[:-500], "numbers can be read"),
        (WHOLE.replace("Frame Time: 0.033333", "Frame Time: 0"), "frame time is 0"),
        (WHOLE.replace("Frame Time: 0.033333", "Frame Time: 0,033"), "'0,033'"),
        (WHOLE.replace(f"Frames: {FRAMES}", "Frames: 0"), "0 frames"),
        (WHOLE.replace("CHANNELS 6", "CHANNELS 99", 1), "99 channels"),
        (WHOLE.replace("OFFSET", "OFFSET nan", 1), "'nan'"),
        (WHOLE.replace("}", "", 1), "not expected|does not end"),
        (WHOLE.rstrip().rpartition(" ")[0] + " inf\n", "infinity"),
        ("HIERARCHY\n" + "ROOT a {\n" * 5000 + "MOTION\nFrames: 1\nFrame Time: 0.1\n", "no place"),
        (
            "HIERARCHY\nROOT box {\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\n}\n"
            "MOTION\nFrames: 1\nFrame Time: 0.1\n0 0 0\n",
            "recognized as pelvis; they are box",
        ),
    ],
)
def test_files_that_cannot_be_used_say_why(tmp_path, text, says):
    with pytest.raises(MotionFileError, match=says) as raised:
        imported(tmp_path, text)
    assert str(raised.value).count("walk.bvh") == 1
    assert len(str(raised.value)) < 500


def test_the_time_to_read_grows_with_the_size_alone(tmp_path):
    """Each of these took longer than any test may, when it grew with the square or the cube."""
    with pytest.raises(MotionFileError, match="no MOTION"):
        imported(tmp_path, "HIERARCHY\n" + "\n" * 300_000)
    joint = "JOINT a {\nOFFSET 0 1 0\nCHANNELS 0\n"
    depth = 2000
    chain = f"HIERARCHY\nROOT a {{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n{joint * depth}"
    with pytest.raises(MotionFileError, match=r"they are a, a\.1, a\.2"):
        imported(tmp_path, chain + "}" * (depth + 1) + "\nMOTION\nFrames: 1\nFrame Time: 0.1\n0\n")


def test_another_rate_than_the_file_states_is_said_to_be_ignored(tmp_path):
    found = imported(tmp_path, WHOLE, rate=12.0)
    assert found.motion.mocap_framerate == pytest.approx(30.0, rel=1e-3)
    assert [note.code for note in found.notes].count("rate_stated") == 1
    found = imported(tmp_path, WHOLE, rate=30.0)
    assert "rate_stated" not in [note.code for note in found.notes]
