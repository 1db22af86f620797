# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint angles, by where joints and points of the body are in single poses, and the files."""

import csv
from dataclasses import replace

import mathutils
import numpy as np
import pytest
from scope.scope_addon.kinematics.axes import R_OPENSIM_WORLD, R_WORLD_MODEL
from scope.scope_addon.scene.export.bvh import euler_zyx_degrees
from scope.scope_addon.scene.export.without_scene import joint_angles, write_angles
from scope.solver.rotations import exp, log

# By joint: a rotation about an axis of the rest pose (x to the left, y up, z forward), degrees, and
# the angles that it is, by OpenSim's names. Arms are spread in the rest pose.
POSES = {
    "right_hip": (("x", -40.0), {"hip_flexion_r": 40.0}),
    "left_hip": (("z", 25.0), {"hip_adduction_l": -25.0}),
    "right_knee": (("x", 70.0), {"knee_angle_r": 70.0}),
    "left_ankle": (("x", -15.0), {"ankle_angle_l": 15.0}),
    "spine1": (("x", 30.0), {"lumbar_extension": -30.0}),
    "spine2": (("y", 20.0), {"lumbar_rotation": 20.0}),
    "left_elbow": (("y", -90.0), {"elbow_flex_l": 90.0}),
    "right_elbow": (("y", 90.0), {"elbow_flex_r": 90.0}),
    "right_shoulder": (("z", 90.0), {"arm_add_r": 0.0, "arm_flex_r": 0.0, "arm_rot_r": 0.0}),
    "left_shoulder": (("z", -60.0), {"arm_add_l": -30.0}),
    "left_wrist": (("z", -35.0), {"wrist_flex_l": 35.0}),
    "right_wrist": (("x", 30.0), {"pro_sup_r": 120.0}),
}


@pytest.fixture
def posed(whole_body, make_motion):
    """Return what gives a motion of one pose, upright in the world and turned about z."""

    def pose(turns, heading=0.0):
        motion = make_motion(whole_body, 3)
        vectors = np.zeros((3, whole_body.K + 1, 3))
        vectors[:, 0] = log(exp(np.array([0.0, 0.0, heading])) @ R_WORLD_MODEL)
        for name, (axis, degrees) in turns.items():
            vectors[:, whole_body.joint_names.index(name), "xyz".index(axis)] = np.radians(degrees)
        return replace(motion, poses=vectors.reshape(3, -1).astype(np.float32))

    return pose


def test_a_joint_that_turns_has_the_angle_that_is_named(posed, whole_body):
    at_rest = joint_angles(posed({}), whole_body)
    for joint, (turn, expected) in POSES.items():
        angles = joint_angles(posed({joint: turn}), whole_body)
        for name, degrees in expected.items():
            np.testing.assert_allclose(angles[name], degrees, atol=1e-3, err_msg=joint)
        side = {"left": "_l", "right": "_r"}.get(joint.partition("_")[0], "")
        others = [n for n in angles if not n.endswith(side) and not n.startswith("lumbar")]
        for name in others if side else ():
            np.testing.assert_allclose(angles[name], at_rest[name], atol=1e-3, err_msg=joint)


def test_flexion_is_where_the_limbs_go(posed, whole_body):
    """A thigh that flexes goes to the front, a shin to the back, whichever way a person faces."""
    turns = {"right_hip": ("x", -40.0), "right_knee": ("x", 70.0)}
    for heading in (0.0, 1.0, -2.5):
        motion = posed(turns, heading)
        vectors = motion.poses[0].reshape(-1, 3).astype(float)
        at = whole_body.forward_kinematics(exp(vectors), motion.trans[0], motion.betas)[1]
        hip, knee, ankle, left = (
            at[whole_body.joint_names.index(name)]
            for name in ("right_hip", "right_knee", "right_ankle", "left_hip")
        )
        front = np.cross(np.array([0.0, 0.0, 1.0]), hip - left)
        assert front @ (knee - hip) > 0
        assert front @ (ankle - knee) < 0
        angles = joint_angles(motion, whole_body)
        assert angles["hip_flexion_r"][0] == pytest.approx(40.0, abs=1e-3)
        assert angles["knee_angle_r"][0] == pytest.approx(70.0, abs=1e-3)


def test_the_pelvis_is_in_the_world(posed, whole_body, joints_world):
    """In the rest pose a person faces the world's −y, which is backwards for OpenSim."""
    motion = posed({}, heading=np.pi + 0.3)
    angles = joint_angles(motion, whole_body)
    np.testing.assert_allclose(angles["pelvis_rotation"] % 360.0, np.degrees(0.3), atol=1e-3)
    np.testing.assert_allclose(angles["pelvis_tilt"], 0.0, atol=1e-3)
    place = joints_world(motion)[:, 0] @ R_OPENSIM_WORLD.T
    for k, axis in enumerate("xyz"):
        np.testing.assert_allclose(angles[f"pelvis_t{axis}"], place[:, k], atol=1e-5)


def test_a_turn_through_a_half_does_not_jump(make_motion, whole_body):
    motion = make_motion(whole_body, 40)
    poses = np.zeros((40, whole_body.K + 1, 3))
    headings = np.linspace(0.0, 3.0 * np.pi, 40)
    turned = exp(headings[:, None] * np.array([0.0, 0.0, 1.0])) @ R_WORLD_MODEL
    poses[:, 0] = log(turned)
    angles = joint_angles(replace(motion, poses=poses.reshape(40, -1)), whole_body)
    np.testing.assert_allclose(np.diff(angles["pelvis_rotation"]), 540.0 / 39, atol=1e-2)


def test_an_arm_that_is_raised_sideways_does_not_fold_at_the_shoulder(make_motion, whole_body):
    """From hanging to 30° beside the head: in the rest pose, arms are spread."""
    motion = make_motion(whole_body, 40)
    poses = np.zeros((40, whole_body.K + 1, 3))
    raised = np.linspace(0.0, 150.0, 40)
    poses[:, whole_body.joint_names.index("right_shoulder"), 2] = np.radians(90.0 - raised)
    angles = joint_angles(replace(motion, poses=poses.reshape(40, -1)), whole_body)
    np.testing.assert_allclose(angles["arm_add_r"], -raised, atol=1e-3)
    np.testing.assert_allclose(angles["arm_flex_r"], 0.0, atol=1e-3)
    np.testing.assert_allclose(angles["arm_rot_r"], 0.0, atol=1e-3)


def test_angles_are_those_of_blenders_decomposition_nearest_to_the_frame_before():
    rng = np.random.default_rng(4)
    turned = np.cumsum(rng.normal(0.0, 0.1, (200, 1, 3)), axis=0)
    found = euler_zyx_degrees(exp(turned))[:, 0]
    before = mathutils.Euler(np.radians(found[0, ::-1]))
    for R, angles in zip(exp(turned)[:, 0], found, strict=True):
        before = mathutils.Matrix(R).to_euler("XYZ", before)
        np.testing.assert_allclose(angles, np.degrees(before)[::-1], atol=1e-2)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_angles_do_not_jump_where_a_joint_passes_gimbal_lock(side):
    """As when an arm is raised to exactly 90° and on: a made turn, of which one frame is locked."""
    angles = np.tile([120.0, 0.0, side * 110.0], (13, 1))
    angles[:, 1] = side * np.arange(60.0, 125.0, 5.0)
    R = [np.array(mathutils.Euler(np.radians(each[::-1])).to_matrix(), float) for each in angles]
    exact = np.round(np.array(R), 6)[:, None]
    assert abs(exact[6, 0, 2, 0]) == 1.0
    np.testing.assert_allclose(euler_zyx_degrees(exact)[:, 0], angles, atol=1e-2)


def test_the_files_hold_the_angles_at_one_rate(tmp_path, posed, whole_body):
    motion = posed({"right_knee": ("x", 50.0)})
    expected = joint_angles(motion, whole_body)
    write_angles(tmp_path / "a.mot", motion, whole_body)
    write_angles(tmp_path / "a.csv", motion, whole_body)
    header, _, table = (tmp_path / "a.mot").read_text().partition("endheader\n")
    assert header.split("\n")[1:-1] == [
        "version=1",
        "nRows=3",
        f"nColumns={len(expected) + 1}",
        "inDegrees=yes",
    ]
    of_mot = [line.split("\t") for line in table.splitlines()]
    of_csv = list(csv.reader((tmp_path / "a.csv").read_text().splitlines()))
    assert of_mot == of_csv
    assert of_csv[0] == ["time", *expected]
    values = np.array(of_csv[1:], float)
    np.testing.assert_allclose(values[:, 0], motion.timestamps, atol=1e-6)
    np.testing.assert_allclose(values[:, 1:], np.array([*expected.values()]).T, atol=1e-5)


def test_a_table_has_blanks_where_the_person_was_not_seen(tmp_path, posed, whole_body):
    motion = replace(posed({}), valid=np.array([True, False, True]))
    write_angles(tmp_path / "a.csv", motion, whole_body)
    rows = list(csv.reader((tmp_path / "a.csv").read_text().splitlines()))
    assert [row.count("") for row in rows[1:]] == [0, len(rows[0]) - 1, 0]
