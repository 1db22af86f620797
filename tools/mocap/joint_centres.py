# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes from joint positions alone: segments get their orientation from the joints around them.

Hips, shoulders and the spine turn pelvis and chest. A thigh or an upper arm lies along its bone and
turns about it so that knee or elbow bends about the segment's x axis; a limb that is nearly
straight leaves that open, and follows pelvis or chest. Forearms and hands have no twist of their
own. Segments and joints have the names of DeepMimic's humanoid, whose correspondence with the body
is used.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import exp
from .retarget import HEAD_PITCH, MAX_HEAD_PITCH
from .take import Take

Points = NDArray[np.float64]
FPS = 30.0
SIDES = ("left", "right")
# of knee or elbow: below, its axis says nothing; above, all
STRAIGHT = np.radians(8.0)
BENT = np.radians(35.0)
JOINTS = (
    "pelvis",
    "chest",
    "neck",
    *(f"{s}_{j}" for s in SIDES for j in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")),
)
TIPS = ("head_end", "left_foot_end", "right_foot_end")
R_Y_UP_Z_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # z up -> y up


def take_from_joints(
    name: str,
    performer: str,
    source: str,
    fps: float,
    joints: Mapping[str, Points],
    head: Points | None = None,
    lefts: Mapping[str, Points] | None = None,
) -> Take:
    """Return a take of 30 frames/s from joint positions.

    :param joints: (T, 3) metres each, y up: ``pelvis``, ``chest`` (lower end of the rib cage),
        ``neck``, ``head_end``, and for ``left_`` and ``right_`` the ``hip``, ``knee``, ``ankle``,
        ``foot_end`` (toes), ``collar`` (a point on the shoulder girdle's line), ``shoulder``,
        ``elbow`` and ``wrist``; ``heel`` where it is known, and ``pelvis_up`` and ``chest_up``, the
        directions that are up in pelvis and rib cage.
    :param head: (T, 3) metres, from the right to the left of the head; None: the head turns as the
        chest does.
    :param lefts: (T, 3) directions to the left of segments, where they are known: of ``left_`` and
        ``right_`` ``hip`` and ``shoulder``, about which a straight limb would bend, and of
        ``ankle``, by which a foot turns apart from the shank.
    """
    points = {key: resampled(value, fps) for key, value in joints.items()}
    turned = {key: resampled(value, fps) for key, value in (lefts or {}).items()}
    segments = _segments(points, None if head is None else resampled(head, fps), turned)
    names = (*JOINTS, *TIPS)
    of_tip = {"head_end": "neck", "left_foot_end": "left_ankle", "right_foot_end": "right_ankle"}
    orientations = np.stack([segments[of_tip.get(n, n)] for n in names], axis=1)
    positions = np.stack([points[n] for n in names], axis=1)
    return Take(name, performer, FPS, names, positions, source, orientations=orientations)


def resampled(values: Points, fps: float) -> Points:
    """Return values (T, 3) of a rate at 30 frames/s, linearly interpolated."""
    at = np.arange(0.0, len(values) - 1 + 1e-9, fps / FPS)
    low = np.minimum(at.astype(int), len(values) - 2)
    share = (at - low)[:, None]
    return np.asarray((1 - share) * values[low] + share * values[low + 1])


def _segments(
    points: Mapping[str, Points], head: Points | None, lefts: Mapping[str, Points]
) -> dict[str, Points]:
    """Return R_world_segment (T, 3, 3) of every joint's segment."""
    middle = 0.5 * (points["left_hip"] + points["right_hip"])
    pelvis = frame(
        points["left_hip"] - points["right_hip"],
        points["pelvis_up"] if "pelvis_up" in points else points["chest"] - middle,
    )
    chest = frame(
        points["left_collar"] - points["right_collar"],
        points["chest_up"] if "chest_up" in points else points["neck"] - points["chest"],
    )
    found = {"pelvis": pelvis, "chest": chest}
    skull = along(points["head_end"] - points["neck"], chest[..., 0] if head is None else head)
    found["neck"] = _looking_ahead(skull)
    for side in SIDES:
        hip, knee, ankle = (points[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle"))
        hinge = _hinge(hip - knee, knee - ankle, lefts.get(f"{side}_hip", pelvis[..., 0]), 1.0)
        found[f"{side}_hip"] = along(hip - knee, hinge)
        found[f"{side}_knee"] = along(knee - ankle, hinge)
        forward = points[f"{side}_foot_end"] - points.get(f"{side}_heel", ankle)
        across = lefts.get(f"{side}_ankle", hinge)
        found[f"{side}_ankle"] = frame(across, np.cross(forward, across))  # up: forward × left
        shoulder, elbow, wrist = (
            points[f"{side}_{joint}"] for joint in ("shoulder", "elbow", "wrist")
        )
        straight = lefts.get(f"{side}_shoulder")
        straight = _carried(chest, shoulder - elbow) if straight is None else straight
        hinge = _hinge(shoulder - elbow, elbow - wrist, straight, -1.0)
        found[f"{side}_shoulder"] = along(shoulder - elbow, hinge)
        found[f"{side}_elbow"] = along(elbow - wrist, hinge)
        found[f"{side}_wrist"] = found[f"{side}_elbow"]
    return found


def frame(left: Points, up: Points) -> Points:
    """Return rotations (T, 3, 3) whose x axis is ``left`` and whose y axis is ``up`` made
    perpendicular to it.
    """
    x = unit(left)
    y = unit(up - x * dot(up, x))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def along(up: Points, left: Points) -> Points:
    """Return rotations (T, 3, 3) whose y axis is ``up`` and whose x axis is ``left`` made
    perpendicular to it.
    """
    y = unit(up)
    x = unit(left - y * dot(left, y))
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _hinge(upper: Points, lower: Points, straight: Points, sign: float) -> Points:
    """Return the axis (T, 3), to the left, about which two bones bend, both given from their lower
    to their upper end.

    :param straight: the axis where the limb is straight; ``sign``: 1 for knees, -1 for elbows.
    """
    normal = sign * np.cross(upper, lower)
    bend = np.arctan2(np.linalg.norm(normal, axis=1, keepdims=True), dot(upper, lower))
    share = np.clip((bend - STRAIGHT) / (BENT - STRAIGHT), 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    y = unit(upper)
    rest = unit(straight - y * dot(straight, y))
    mixed = (
        share * normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        + (1.0 - share) * rest
    )
    return np.asarray(np.where(np.linalg.norm(mixed, axis=1, keepdims=True) > 1e-3, mixed, rest))


def _carried(chest: Points, up: Points) -> Points:
    """Return the chest's x axis (T, 3) turned as the arm is from hanging, by the smallest
    rotation.
    """
    y = unit(up)
    axis = np.cross(chest[..., 1], y)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, dot(chest[..., 1], y))
    turned: Points = np.einsum(
        "tij,tj->ti", exp(axis / np.maximum(sine, 1e-9) * angle), chest[..., 0]
    )
    return turned


def _looking_ahead(skull: Points) -> Points:
    """Return head rotations (T, 3, 3) with a constant pitch of the bone from neck to head, which
    leans, taken out.
    """
    # of the forward axis, upwards
    pitch = float(np.median(np.arctan2(skull[:, 1, 2], np.abs(skull[:, 1, 1]))))
    return skull @ exp(
        np.array([np.clip(HEAD_PITCH + pitch, -2 * MAX_HEAD_PITCH, 2 * MAX_HEAD_PITCH), 0.0, 0.0])
    )


def unit(v: Points) -> Points:
    """Return unit vectors (..., 3)."""
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12))


def dot(a: Points, b: Points) -> Points:
    """Return a · b (..., 1) of vectors (..., 3)."""
    return np.asarray((a * b).sum(axis=-1, keepdims=True))
