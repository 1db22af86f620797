# SPDX-License-Identifier: GPL-3.0-or-later
"""What the 2D detectors find, placed on a user's body and rigidly attached to its parts (Assumption
1 of the paper).

The sets and names are those of the default body: ``blazepose/`` 33, ``coco/`` 17 and six feet
points, ``hand/`` 21 a side. Shoulders, elbows, wrists, hips, knees and ankles are the joints.
Points of the face beyond nose, eyes and ears, and finger joints that the skeleton lacks, are linear
combinations of neighbours, with the default body's proportions.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..body import Body
from ..names import BLAZEPOSE, BODY_JOINTS, COCO
from .landmarks import FINGERS, RestPoints

# MediaPipe's joints of a finger, and their positions between wrist and tip when the skeleton has no
# fingers.
_FINGER_JOINTS = {
    "thumb": (("cmc", 0.37), ("mcp", 0.56), ("ip", 0.80), ("tip", 1.0)),
    "index": (("mcp", 0.60), ("pip", 0.75), ("dip", 0.87), ("tip", 1.0)),
    "middle": (("mcp", 0.56), ("pip", 0.74), ("dip", 0.88), ("tip", 1.0)),
    "ring": (("mcp", 0.57), ("pip", 0.735), ("dip", 0.865), ("tip", 1.0)),
    "pinky": (("mcp", 0.66), ("pip", 0.79), ("dip", 0.88), ("tip", 1.0)),
}
_HAND_NAMES = {
    finger: f"{finger}_finger" if finger in ("index", "middle", "ring") else finger
    for finger in FINGERS
}

Attached = tuple[NDArray[np.float64], str]  # a point (3, 1 + P) and the part it turns with


def derive_keypoints(body: Body) -> Body:
    """Return the body with all keypoints, or with none when its tree does not have SMPL's 22 body
    joints by name.
    """
    if not set(BODY_JOINTS) <= set(body.joint_names):
        return replace(body, keypoint_shapedirs=np.zeros((0, 3, body.P)))
    points = RestPoints(body)
    hands = {side: _hand(points, side) for side in ("left", "right")}
    found = {**_face(points), **_feet(points)}
    for side, hand in hands.items():
        for name, source in (
            ("index", "index_finger_mcp"),
            ("pinky", "pinky_mcp"),
            ("thumb", "thumb_ip"),
        ):
            found[f"{side}_{name}"] = (hand[source][0], f"{side}_wrist")
    for name in (*BLAZEPOSE, *COCO):
        if name in BODY_JOINTS:
            found[name] = (points.joint(name), name)
    named = {f"blazepose/{name}": found[name] for name in BLAZEPOSE}
    named |= {f"coco/{name}": found[name] for name in COCO}
    named |= {
        f"hand/{side}_{name}": each for side, hand in hands.items() for name, each in hand.items()
    }
    stack = np.stack([point for point, _ in named.values()])
    return replace(
        body,
        keypoint_names=tuple(named),
        keypoint_part=np.array([points.joint_index[part] for _, part in named.values()], np.int32),
        keypoint_template=np.ascontiguousarray(stack[:, :, 0]),
        keypoint_shapedirs=np.ascontiguousarray(stack[:, :, 1:]),
    )


def _face(points: RestPoints) -> dict[str, Attached]:
    nose = points.landmark("nose")
    eye = {side: points.landmark(f"{side}_eye") for side in ("left", "right")}
    ear = {side: points.landmark(f"{side}_ear") for side in ("left", "right")}
    between = (eye["left"] + eye["right"]) / 2
    # the middle of the mouth
    below = nose + 1.18 * (nose - between) + 0.51 * ((ear["left"] + ear["right"]) / 2 - nose)
    face = {"nose": nose}
    for side in ("left", "right"):
        out = eye[side] - between
        face[f"{side}_eye"] = eye[side]
        face[f"{side}_ear"] = ear[side]
        face[f"{side}_eye_inner"] = between + 0.5 * out
        face[f"{side}_eye_outer"] = eye[side] + 0.48 * out + 0.11 * (ear[side] - eye[side])
        face[f"mouth_{side}"] = below + 0.83 * out
    return {name: (point, "head") for name, point in face.items()}


def _feet(points: RestPoints) -> dict[str, Attached]:
    feet: dict[str, Attached] = {}
    for side in ("left", "right"):
        big = points.landmark(f"{side}_big_toe")
        small = points.landmark(f"{side}_small_toe")
        feet[f"{side}_heel"] = (points.landmark(f"{side}_heel"), f"{side}_ankle")
        feet[f"{side}_big_toe"] = (big, f"{side}_foot")
        feet[f"{side}_small_toe"] = (small, f"{side}_foot")
        feet[f"{side}_foot_index"] = (0.85 * big + 0.15 * small, f"{side}_foot")
    return feet


def _hand(points: RestPoints, side: str) -> dict[str, Attached]:
    """Return the 21 points of one hand in MediaPipe's order."""
    wrist = points.joint(f"{side}_wrist")
    hand: dict[str, Attached] = {"wrist": (wrist, f"{side}_wrist")}
    palm = f"{side}_hand" if f"{side}_hand" in points.joint_index else f"{side}_wrist"
    for finger in FINGERS:
        tip = points.fingertip(side, finger)
        for i, (label, fraction) in enumerate(_FINGER_JOINTS[finger], start=1):
            joint = f"{side}_{finger}{min(i, 3)}"
            if joint in points.joint_index:
                each = (tip if label == "tip" else points.joint(joint), joint)
            else:
                each = (
                    wrist + fraction * (tip - wrist),
                    f"{side}_wrist" if finger == "thumb" else palm,
                )
            hand[f"{_HAND_NAMES[finger]}_{label}"] = each
    return hand
