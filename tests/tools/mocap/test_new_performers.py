# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of new performers: joints where the files have them, segments that bend as they do,
and the body.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError
from scope.solver.rotations import exp
from scope.tools.mocap import markers, new_performers
from scope.tools.mocap.formats import bvh
from scope.tools.mocap.joint_centres import take_from_joints

T = 40
BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 1.0 2.0 3.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Chest
  {
    OFFSET 0.0 10.0 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0.0 5.0 0.0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.01
0 90 0 0 0 0 0 0 0
5 90 7 90 0 0 0 90 0
"""


def standing(
    knee_deg: float = 0.0, elbow_deg: float = 0.0, turn_deg: float = 0.0
) -> dict[str, np.ndarray]:
    """Return the joints of somebody who faces +z with arms hanging, knees and elbows bent, and the
    body turned.
    """
    joints: dict[str, Any] = {
        "pelvis": [0.0, 1.0, 0.0],
        "chest": [0.0, 1.2, 0.0],
        "neck": [0.0, 1.5, 0.0],
        "head_end": [0.0, 1.7, 0.0],
    }
    for side, x in (("left", 0.1), ("right", -0.1)):
        knee = np.radians(knee_deg)
        elbow = np.radians(elbow_deg)
        joints[f"{side}_hip"] = [x, 0.95, 0.0]
        joints[f"{side}_knee"] = [x, 0.53, 0.0]
        ankle = joints[f"{side}_ankle"] = [x, 0.53 - 0.43 * np.cos(knee), -0.43 * np.sin(knee)]
        joints[f"{side}_foot_end"] = np.add(ankle, [0.0, -0.06, 0.15])
        joints[f"{side}_collar"] = [0.5 * x, 1.45, 0.0]
        joints[f"{side}_shoulder"] = [1.8 * x, 1.43, 0.0]
        joints[f"{side}_elbow"] = [1.8 * x, 1.15, 0.0]
        joints[f"{side}_wrist"] = [1.8 * x, 1.15 - 0.25 * np.cos(elbow), 0.25 * np.sin(elbow)]
    R = exp(np.array([0.0, np.radians(turn_deg), 0.0]))
    return {name: np.tile(R @ np.array(at, float), (T, 1)) for name, at in joints.items()}


def test_bvh_joints_follow_their_channels():
    found, fps = bvh.joint_positions(BVH)
    assert fps == pytest.approx(100.0)
    np.testing.assert_allclose(found["Hips"], [[0, 90, 0], [5, 90, 7]])
    # turned by 90 degrees about z
    np.testing.assert_allclose(found["Chest"], [[0, 100, 0], [-5, 90, 7]], atol=1e-9)
    # then about its own x
    np.testing.assert_allclose(found["Chest_end"], [[0, 105, 0], [-5, 90, 12]], atol=1e-9)


def test_somebody_who_stands_has_upright_segments_and_bends_forwards():
    straight = take_from_joints("a_0", "a", "made", 30.0, standing())
    assert straight.orientations is not None
    for name in ("pelvis", "chest", "left_hip", "right_knee", "left_shoulder", "right_elbow"):
        np.testing.assert_allclose(
            straight.orientations[0, straight.index(name)], np.eye(3), atol=1e-9, err_msg=name
        )
    bent = take_from_joints(
        "a_0", "a", "made", 30.0, standing(knee_deg=70, elbow_deg=80, turn_deg=40)
    )
    assert bent.orientations is not None
    R = exp(np.array([0.0, np.radians(40), 0.0]))
    knee, elbow = (exp(np.array([np.radians(angle), 0, 0])) for angle in (70, -80))
    for side in ("left", "right"):
        np.testing.assert_allclose(bent.orientations[0, bent.index(f"{side}_hip")], R, atol=1e-9)
        np.testing.assert_allclose(
            bent.orientations[0, bent.index(f"{side}_knee")], R @ knee, atol=1e-9
        )
        np.testing.assert_allclose(
            bent.orientations[0, bent.index(f"{side}_elbow")], R @ elbow, atol=1e-9
        )


def made_markers() -> dict[str, np.ndarray]:
    """Return Plug-in Gait markers, millimetres, z up, of somebody with outstretched arms.

    The person faces -y, with the left side towards +x. In the frame with y up, left is +z, and
    ahead is -x.
    """
    at = {
        "C7": [0, 80, 1430],
        "T10": [0, 100, 1200],
        "CLAV": [0, -60, 1420],
        "STRN": [0, -90, 1250],
    }
    for s, x in (("L", 1), ("R", -1)):
        at |= {
            f"{s}FHD": [70 * x, -80, 1650],
            f"{s}BHD": [70 * x, 80, 1650],
            f"{s}SHO": [170 * x, 0, 1470],
        }
        at |= {f"{s}UPA": [300 * x, 40, 1430], f"{s}ELB": [450 * x, 40, 1420]}
        at |= {
            f"{s}WRA": [690 * x, -40, 1420],
            f"{s}WRB": [690 * x, 40, 1420],
            f"{s}FWT": [130 * x, -90, 1000],
        }
        at |= {
            f"{s}BWT": [50 * x, 90, 1010],
            f"{s}THI": [170 * x, 0, 720],
            f"{s}KNE": [145 * x, 0, 520],
        }
        at |= {
            f"{s}SHN": [140 * x, 0, 300],
            f"{s}ANK": [130 * x, 0, 90],
            f"{s}HEL": [90 * x, 60, 50],
        }
        at |= {f"{s}TOE": [100 * x, -150, 50], f"{s}MT5": [140 * x, -130, 45]}
    return {name: np.tile(np.array(place, float), (T, 1)) for name, place in at.items()}


def test_joint_centres_lie_inside_the_markers():
    joints, head = markers.joint_centres(made_markers())
    np.testing.assert_allclose(head[0], [0.0, 0.0, 0.28], atol=1e-9)
    left = joints["left_hip"][0]
    right = joints["right_hip"][0]
    assert np.linalg.norm(left - right) == pytest.approx(2 * (0.33 * 0.26 + 0.0073), abs=1e-9)
    assert 0.88 < left[1] < 0.93  # below the markers on the iliac spines
    for side, sign in (("left", 1.0), ("right", -1.0)):
        assert sign * joints[f"{side}_knee"][0, 2] == pytest.approx(0.145 - 0.055, abs=0.005)
        ankle = joints[f"{side}_ankle"][0]
        assert 0.08 < ankle[1] < 0.11  # above the foot
        assert sign * ankle[2] > 0.08
        assert joints[f"{side}_foot_end"][0, 0] < ankle[0] < joints[f"{side}_heel"][0, 0]


def made_gait(up: int) -> dict:
    """Return the file of a gait, here of a person standing still, with ``up`` as its vertical
    axis.
    """
    joints = standing()
    order = {
        "hip": "hip",
        "knee": "knee",
        "ankle": "ankle",
        "heel": "ankle",
        "toe": "foot_end",
        "shoulder": "shoulder",
    }
    frames = []
    for t in range(T):
        place = {
            f"{s}_{j}": joints[f"{s}_{ours}"][t] * 1000
            for s in ("left", "right")
            for j, ours in order.items()
        }
        turned = {key: value if up == 1 else value[[2, 0, 1]] for key, value in place.items()}
        frames.append(
            {"landmark_positions": {key: value.tolist() for key, value in turned.items()}}
        )
    return {"angle_frames": frames, "fps": 30.0}


@pytest.mark.parametrize("up", [1, 2])
def test_gaits_stand_upright_whichever_axis_is_up(up):
    take = new_performers.gait(made_gait(up), "patient_a")
    assert take.joint("neck")[0, 1] - take.joint("pelvis")[0, 1] == pytest.approx(0.52, abs=0.01)
    assert take.joint("left_hip")[0, 0] > take.joint("right_hip")[0, 0]
    with pytest.raises(MotionFileError, match="malformed"):
        new_performers.gait(
            {"angle_frames": [{"landmark_positions": {}}], "fps": 30.0}, "patient_a"
        )
