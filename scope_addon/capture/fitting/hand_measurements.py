# SPDX-License-Identifier: GPL-3.0-or-later
"""From the hands' keypoints to the solver's measurements, and what is known of fingers without any.

Each keypoint is a 2D keypoint. The world landmarks give directions: along every bone of the fingers, and across the
palm, which tells the wrist's rotation. They are in axes that look along the line of sight to the hand, so they are
turned into the camera's. Between hands seen, fingers keep calm: `smooth_fingers`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver import Body, Keypoints2D, Measurements, OrientationField, Priors
from ....solver.residuals import joint_limits
from ....solver.rotations import exp, log
from ...errors import UsageError
from ...kinematics.smoothing import fill_rotation_gaps
from ..perception.hand_landmarks import HAND_NAMES, HAND_POINTS
from ..perception.hand_region import SIDES
from ..perception.lifter import KEYPOINT_COUNT, virtual_camera

FINGERS = ("index", "middle", "ring", "pinky", "thumb")
HAND_KEYPOINT_NAMES = tuple(f"hand/{side}_{name}" for side in SIDES for name in HAND_NAMES)
PIXEL_TRUST = 0.3  # of a hand's keypoint beside the body's wrist: 21 lie close together and err together
WRIST_PIXEL_TRUST = 0.05  # the hand's network puts the wrist further into the palm than the body has its joint
DIRECTION_TRUST = 0.25  # of a bone's direction of presence 1: twice the deviation of a bone of the body
# Radians that a joint of a finger bends towards the palm, at least and at most, and how far it swings off that.
_KNUCKLE, _HINGE = (-0.5, 1.7, 0.4), (-0.2, 2.0, 0.2)
_THUMB = (-0.4, 0.4, 1.2)  # the same about its own bone: how far it twists, and swings
SHORT_GAP_S, LONG_GAP_S = 0.3, 1.0  # fingers that are not seen move on until the one, and are at rest from the other


def finger_joints(body: Body, side: str) -> list[int]:
    """The numbers of the 15 joints of a hand's fingers, from the index to the thumb.

    :raises UsageError: the body has no fingers.
    """
    names = [f"{side}_{finger}{k}" for finger in FINGERS for k in (1, 2, 3)]
    keypoints = {f"hand/{side}_{name}" for name in HAND_NAMES}
    if not set(names) <= set(body.joint_names) or not keypoints <= set(body.keypoint_names):
        raise UsageError(
            f"body '{body.name}' has no finger joints, which capturing hands needs: use scope_h or an SMPL+H file"
        )
    return [body.joint_names.index(name) for name in names]


def require_fingers(body: Body) -> None:
    """:raises UsageError: the body has no fingers."""
    for side in SIDES:
        finger_joints(body, side)


class HandMeasurer:
    """Makes measurements of one body's hands."""

    def __init__(self, body: Body, intrinsics: np.ndarray) -> None:
        self._body, self._unproject = body, np.linalg.inv(intrinsics)
        self.indices = np.array([body.keypoint_names.index(name) for name in HAND_KEYPOINT_NAMES]).reshape(2, -1)
        self.fingers = [finger_joints(body, side) for side in SIDES]
        self.wrists = [body.joint_names.index(f"{side}_wrist") for side in SIDES]
        # Bones as (from, to): pairs of the hand's keypoints, and the solver's numbers of the same points.
        self._from, self._to = np.array(_bones()).T
        self._starts, self._ends = (
            np.array([self._points(side)[pairs] for side in range(len(SIDES))]) for pairs in (self._from, self._to)
        )

    def _points(self, side: int) -> np.ndarray:
        """(21,) the solver's numbers of a hand's keypoints: joints where they can be, so that bones share a part."""
        points = self.indices[side].copy()
        joints = [self.wrists[side], *(self.fingers[side][k] for k in (12, 13, 14, *range(12)))]
        points[_JOINTS] = len(self._body.keypoint_names) + np.array(joints)
        return points

    def add(self, measured: Measurements, hands: np.ndarray) -> Measurements:
        """The measurements of a frame with its hands (2, 21, 6): pixels without distortion, confidence, landmarks."""
        first, bones = measured.keypoints2d, measured.orientation_field
        assert first is not None
        assert bones is not None
        seen = [side for side in range(len(SIDES)) if hands[side, 0, 2] > 0]
        if not seen:
            return measured
        confidence = hands[seen, :, 2]
        directions = self._directions(hands[seen])
        return replace(
            measured,
            keypoints2d=Keypoints2D(
                np.concatenate([first.indices, self.indices[seen].ravel()]),
                np.concatenate([first.pixels, hands[seen, :, :2].reshape(-1, 2)]),
                np.concatenate([first.confidence, (_PIXEL_TRUST * confidence).ravel()]),
            ),
            orientation_field=OrientationField(
                np.concatenate([bones.starts, self._starts[seen].ravel()]),
                np.concatenate([bones.ends, self._ends[seen].ravel()]),
                np.concatenate([bones.directions, directions.reshape(-1, 3)]),
                np.concatenate([bones.confidence, DIRECTION_TRUST * confidence[:, self._to].ravel()]),
            ),
        )

    def _directions(self, hands: np.ndarray) -> np.ndarray:
        """(n, bones, 3) along the bones of n hands, camera axes."""
        rays = hands[..., :2].mean(axis=1) @ self._unproject[:2, :2].T + self._unproject[:2, 2]
        R_virtual_camera = virtual_camera(np.repeat(rays[:, None], KEYPOINT_COUNT, axis=1))
        return (hands[:, self._to, 3:] - hands[:, self._from, 3:]) @ R_virtual_camera

    def joint_confidence(self, hands: np.ndarray) -> np.ndarray:
        """Hands of T frames (T, 2, 21, 6) -> (T, K+1) how far they fix each joint's rotation; 0 beyond the hands."""
        out = np.zeros((len(hands), self._body.K + 1))
        for side, joints in enumerate(self.fingers):
            for joint in (self.wrists[side], *joints):
                out[:, joint] = hands[:, side, 0, 2]
        return out


def _bones() -> list[tuple[int, int]]:
    """Pairs of keypoints whose direction is known: the palm's, then three a finger."""
    palm = [(0, 5), (0, 9), (0, 13), (0, 17), (5, 17)]
    return palm + [(k, k + 1) for finger in range(5) for k in range(4 * finger + 1, 4 * finger + 4)]


# The keypoints that are joints: the wrist, then each finger's three, the thumb first, in the keypoints' order.
_JOINTS = np.array([0, *(4 * finger + k for finger in range(5) for k in (1, 2, 3))])


_PIXEL_TRUST = np.full(HAND_POINTS, PIXEL_TRUST)
_PIXEL_TRUST[0] = WRIST_PIXEL_TRUST


def with_finger_limits(priors: Priors, body: Body) -> Priors:
    """The priors and how far fingers bend: towards the palm, about the axis that is across bone and palm at rest.

    The palm's side is that of (index − wrist) × (little finger − wrist) on the right hand, the other on the left. The
    thumb's joints turn about axes of their own: they are only kept from twisting about their bones and going too far.
    """
    J, joints, axes, ranges = body.J_template, [], [], []
    for side, sign in (("left", -1.0), ("right", 1.0)):
        fingers = finger_joints(body, side)
        wrist = J[body.joint_names.index(f"{side}_wrist")]
        palm = sign * np.cross(J[fingers[0]] - wrist, J[fingers[9]] - wrist)
        tips = {f: body.keypoint_names.index(f"hand/{side}_{_TIP[f]}") for f in FINGERS}
        for number, finger in enumerate(FINGERS):
            three = fingers[3 * number : 3 * number + 3]
            ends = [J[three[1]], J[three[2]], body.keypoint_template[tips[finger]]]
            for k, (joint, end) in enumerate(zip(three, ends, strict=True)):
                bone = end - J[joint]
                axis = bone if finger == "thumb" else np.cross(bone, palm)
                joints.append(joint)
                axes.append(axis / np.linalg.norm(axis))
                ranges.append(_THUMB if finger == "thumb" else _KNUCKLE if k == 0 else _HINGE)
    lower, upper, swing = np.array(ranges).T
    ones = np.ones(len(joints))
    ints, floats = joint_limits.pack(np.array(joints), np.array(axes), lower, upper, swing, ones, ones)
    if priors.limits is not None:
        ints, floats = np.vstack([priors.limits[0], ints]), np.vstack([priors.limits[1], floats])
    return replace(priors, limits=(ints, floats))


_TIP = {f: f"{f}_tip" if f in ("pinky", "thumb") else f"{f}_finger_tip" for f in FINGERS}


def smooth_fingers(rotations: np.ndarray, fingers: list[list[int]], seen: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Rotations (T, K+1, 3, 3) in which the fingers of a hand that is not seen move calmly.

    They go on between the frames in which they were seen, and the longer ago or ahead that is, the closer they are to
    rest: wholly from `LONG_GAP_S` on.

    :param seen: (T, 2) whether each hand was seen.
    """
    out = rotations.copy()
    for joints, there in zip(fingers, seen.T, strict=True):
        if there.all():
            continue
        if not there.any():
            out[:, joints] = np.eye(3)
            continue
        known = np.concatenate([[-np.inf], times[there], [np.inf]])
        after = np.searchsorted(times[there], times)
        away = np.minimum(times - known[after], known[after + 1] - times)
        share = np.clip((away - SHORT_GAP_S) / (LONG_GAP_S - SHORT_GAP_S), 0.0, 1.0)
        keep = 1.0 - share * share * (3.0 - 2.0 * share)
        between = fill_rotation_gaps(rotations[:, joints], there, times)
        out[:, joints] = exp(keep[:, None, None] * log(between))
    return out
