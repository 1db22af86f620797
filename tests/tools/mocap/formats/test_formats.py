# SPDX-License-Identifier: GPL-3.0-or-later
"""The parsers, on small files written here whose poses follow from geometry."""

import json

import numpy as np
import pytest
from scope.solver.rotations import exp
from scope.tools.mocap.formats import asf_amc, deepmimic, expmap

ASF = """# made for this test
:version 1.10
:units
  length 0.5
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name upper
     direction 1 0 0
     length 10
     axis 0 0 90 XYZ
     dof rx ry rz
     limits (-1 1)
            (-1 1)
  end
  begin
     id 2
     name lower
     direction 2 0 0
     length 5
     axis 0 0 0 XYZ
     dof ry
  end
:hierarchy
  begin
    root upper
    upper lower
  end
"""


def amc(*frames: str) -> str:
    body = "".join(f"{i}\n{f}\n" for i, f in enumerate(frames, 1))
    return "#!comment\n:FULLY-SPECIFIED\n:DEGREES\n" + body


def ends(frame: str) -> np.ndarray:
    skeleton = asf_amc.parse_asf(ASF)
    M, root = asf_amc.parse_amc(amc(frame), skeleton)
    return skeleton.forward_kinematics(M, root)[1][0] / skeleton.metres_per_unit


def test_length_unit_is_inches_over_the_unit():
    assert asf_amc.parse_asf(ASF).metres_per_unit == pytest.approx(0.0508)


def test_zero_pose_follows_the_directions():
    np.testing.assert_allclose(
        ends("root 1 2 3 0 0 0\nupper 0 0 0\nlower 0"), [[1, 2, 3], [11, 2, 3], [16, 2, 3]]
    )


def test_a_dof_turns_about_the_axes_of_the_bone():
    # The bone's frame is turned 90 degrees about z, so its x is the skeleton's y: x goes to -z.
    got = ends("root 0 0 0 0 0 0\nupper 90 0 0\nlower 0")
    np.testing.assert_allclose(got[1:], [[0, 0, -10], [0, 0, -15]], atol=1e-9)


def test_euler_angles_turn_about_fixed_axes_x_first():
    # x stays under rx, then rz takes it to y: an order from z to x would leave it on z.
    got = ends("root 0 0 0 90 0 90\nupper 0 0 0\nlower 0")
    np.testing.assert_allclose(got[1], [0, 10, 0], atol=1e-9)
    # the child turns about y of the moved frame: forward kinematics is root first
    got = ends("root 0 0 0 0 0 90\nupper 0 0 0\nlower 90")
    np.testing.assert_allclose(got[2] - got[1], [0, 0, -5], atol=1e-9)


def test_expmap_leaves_out_the_reference_frame_and_transposes():
    skeleton = asf_amc.parse_asf(
        ASF.replace("upper", "lowerback").replace("lower\n", "upperback\n")
    )
    bones = ("root", "lowerback", "upperback")
    rows = np.zeros((2, expmap.COLUMNS))
    rows[1, :3] = 1, 2, 3
    rows[1, 3 + 3 * expmap.BONES.index("lowerback") + 2] = -np.pi / 2
    phi, root = expmap.parse_expmap("\n".join(",".join(map(str, r)) for r in rows))
    assert phi.shape == (1, 38, 3)
    np.testing.assert_allclose(root, [[1, 2, 3]])
    full = asf_amc.replace(skeleton, bones=(*bones, *sorted(set(expmap.BONES) - {*bones, ""})))
    M = expmap.bone_rotations(phi, full)
    np.testing.assert_allclose(M[0, 1], exp([0, 0, np.pi / 2]), atol=1e-12)
    assert len(expmap.BONES) == 38


def character() -> str:
    """An L-shaped leg: hip 0.1 to the right of the root, knee 0.4 below, ankle 0.4 below that."""

    def joint(name, kind, parent, x, y, z):
        return {
            "Name": name,
            "Type": kind,
            "Parent": parent,
            "AttachX": x,
            "AttachY": y,
            "AttachZ": z,
        }

    def shape(name):
        return {
            "Name": name,
            "AttachX": 0,
            "AttachY": 0,
            "AttachZ": 0,
            "Param0": 0.2,
            "Param1": 0.2,
            "Param2": 0.1,
        }

    joints = [
        joint("root", "none", -1, 0, 0, 0),
        joint("neck", "fixed", 0, 0, 0.5, 0),
        joint("left_ankle", "fixed", 0, 0, -0.8, -0.1),
        joint("right_hip", "spherical", 0, 0, 0, 0.1),
        joint("right_knee", "revolute", 3, 0, -0.4, 0),
        joint("right_ankle", "fixed", 4, 0, -0.4, 0),
    ]
    bodies = [shape(n) for n in ("neck", "left_ankle", "right_ankle")]
    return json.dumps({"Skeleton": {"Joints": joints}, "BodyDefs": bodies})


def test_deepmimic_bends_the_knee_backwards_and_turns_to_the_shared_frame():
    frame = [1 / 30, 0, 0.8, 0, 1, 0, 0, 0, 1, 0, 0, 0, -np.pi / 2]
    motion = json.dumps({"Frames": [frame, frame]})
    take = deepmimic.read_take(motion, deepmimic.parse_character(character()), "walk_mirror")
    assert take.fps == pytest.approx(30)
    assert take.mirrored
    np.testing.assert_allclose(take.joint("pelvis")[0], [0, 0.8, 0], atol=1e-12)
    # right is -x
    np.testing.assert_allclose(take.joint("right_knee")[0], [-0.1, 0.4, 0], atol=1e-12)
    # backwards is -z
    np.testing.assert_allclose(take.joint("right_ankle")[0], [-0.1, 0.4, -0.4], atol=1e-12)
    # the toes point to +z
    np.testing.assert_allclose(take.joint("left_foot_end")[0], [0.1, 0, 0.1], atol=1e-12)
    np.testing.assert_allclose(take.joint("right_foot_end")[0], [-0.1, 0.3, -0.4], atol=1e-12)
