# SPDX-License-Identifier: GPL-3.0-or-later
"""Character Studio's marker files (.csm), and joint centres from optical markers on the skin.

Markers have the names of Vicon's Plug-in Gait. Hip centres lie in the pelvis as Harrington et al.
2007 found by magnetic resonance (Journal of Biomechanics 40, 595-602), knees half a joint's width
inside their markers, shoulders below theirs, elbows at theirs. Ankles lie above the foot: the right
ankle's marker of the recording that this is for is on the calf.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.errors import MotionFileError
from .joint_centres import R_Y_UP_Z_UP, SIDES, frame

Points = NDArray[np.float64]
KNEE_M = 0.055  # half a knee's width and half a marker
# share of the way from heel to forefoot, and height above it
ANKLE_AT = 0.3
ANKLE_M = 0.045
SHOULDER_M = 0.05  # below the marker on the acromion


def parse_csm(text: str, name: str = "markers") -> tuple[dict[str, Points], float]:
    """Return the positions (T, 3) of all markers, millimetres, z up, and frames per second.

    :raises MotionFileError: when the file is malformed, or a marker is missing in a frame.
    """
    try:
        head, points = text.split("$Points", 1)
        fps = float(head.split("$Rate", 1)[1].split()[0])
        order = head.split("$Order", 1)[1].split("$", 1)[0].split()
        rows = [line.split()[1:] for line in points.splitlines() if line.strip()]
        values = np.array(rows, float).reshape(len(rows), len(order), 3)
    except (ValueError, IndexError) as error:
        raise MotionFileError(f"{name}: malformed .csm file ({error})") from error
    return {marker: values[:, k] for k, marker in enumerate(order)}, fps


def joint_centres(markers: Mapping[str, Points]) -> tuple[dict[str, Points], Points]:
    """Return the joints that `take_from_joints` takes, metres, y up, and the direction to the left
    of the head.

    :param markers: (T, 3) millimetres each, z up.
    """
    m = {key: 0.001 * value @ R_Y_UP_Z_UP.T for key, value in markers.items()}
    front = 0.5 * (m["LFWT"] + m["RFWT"])
    back = 0.5 * (m["LBWT"] + m["RBWT"])
    wide = float(np.median(np.linalg.norm(m["LFWT"] - m["RFWT"], axis=1)))
    deep = float(np.median(np.linalg.norm(front - back, axis=1)))
    left = m["LFWT"] - m["RFWT"]
    ahead = front - back
    R = frame(left, np.cross(ahead, left))  # x left, y up, z ahead
    ribs = 0.5 * (m["T10"] + m["STRN"])
    joints = {
        "pelvis": front + R @ [0.0, -0.30 * wide - 0.0109, -0.24 * deep - 0.0099],
        "pelvis_up": R[..., 1],
    }
    joints |= {
        "chest": ribs,
        "neck": 0.5 * (m["C7"] + m["CLAV"]),
        "head_end": _mean(m, "LFHD", "RFHD", "LBHD", "RBHD"),
    }
    chest = frame(m["LSHO"] - m["RSHO"], joints["neck"] - ribs)
    for side in SIDES:
        s = side[0].upper()
        sign = 1.0 if side == "left" else -1.0
        hip = joints["pelvis"] + R @ [sign * (0.33 * wide + 0.0073), 0.0, 0.0]
        knee = _inward(hip, m[f"{s}THI"], m[f"{s}KNE"], KNEE_M)
        heel = m[f"{s}HEL"]
        forefoot = 0.5 * (m[f"{s}TOE"] + m[f"{s}MT5"])
        sole = heel + ANKLE_AT * (forefoot - heel)
        ankle = sole + ANKLE_M * (knee - sole) / np.linalg.norm(knee - sole, axis=1, keepdims=True)
        shoulder = m[f"{s}SHO"] - SHOULDER_M * chest[..., 1]
        wrist = 0.5 * (m[f"{s}WRA"] + m[f"{s}WRB"])
        joints |= {f"{side}_hip": hip, f"{side}_knee": knee, f"{side}_ankle": ankle}
        joints |= {
            f"{side}_heel": heel,
            f"{side}_foot_end": forefoot,
            f"{side}_elbow": m[f"{s}ELB"],
        }
        joints |= {
            f"{side}_collar": m[f"{s}SHO"],
            f"{side}_shoulder": shoulder,
            f"{side}_wrist": wrist,
        }
    return joints, m["LFHD"] + m["LBHD"] - m["RFHD"] - m["RBHD"]


def _inward(upper: Points, beside: Points, marker: Points, by_m: float) -> Points:
    """Return a marker moved away from the side of the bone on which another marker is, at right
    angles to the bone.
    """
    bone = (marker - upper) / np.linalg.norm(marker - upper, axis=1, keepdims=True)
    out = beside - upper
    out = out - bone * (out * bone).sum(axis=1, keepdims=True)
    return np.asarray(marker - by_m * out / np.linalg.norm(out, axis=1, keepdims=True))


def _mean(markers: Mapping[str, Points], *names: str) -> Points:
    return np.asarray(np.mean([markers[name] for name in names], axis=0))
