# SPDX-License-Identifier: GPL-3.0-or-later
"""From the hands' keypoints to the solver's measurements, and the motion of fingers that are not
seen.

The keypoints are 2D keypoints. The world landmarks give directions: along every bone of the
fingers, and across the palm, which determines the wrist's rotation. Their axes are aligned with the
line of sight to the hand, so directions are rotated to camera axes. `smooth_fingers` moves the
fingers while a hand is not seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver import Body, Keypoints2D, Measurements, OrientationField, Priors
from ....solver.residuals import joint_limits
from ....solver.rotations import exp, log
from ...arrays import BoolArray, Float64Array, FloatArray, IndexArray
from ...errors import UsageError
from ...kinematics.smoothing import fill_rotation_gaps
from ..perception.hand_landmarks import HAND_NAMES, HAND_POINTS, SIDES
from ..perception.lifter import camera_towards

FINGERS = ("index", "middle", "ring", "pinky", "thumb")
HAND_KEYPOINT_NAMES = tuple(f"hand/{side}_{name}" for side in SIDES for name in HAND_NAMES)
# Weights of keypoints relative to the body's wrist: 21 lie close together, with correlated errors.
# The hand network places the wrist further into the palm than the body has its joint.
PIXEL_WEIGHT = 0.3
WRIST_PIXEL_WEIGHT = 0.05
# The weight of a bone in a hand of presence 1: twice the deviation of a bone of the body.
DIRECTION_WEIGHT = 0.25
# The smaller a hand is in the image, the less is seen of which way its palm faces, and the weight
# falls with the square of the distance from wrist to middle knuckle. In hands of 15 pixels, wrong
# palms turned the whole arm.
FULL_SIZE_PX = 100.0
# Below this presence, directions count by its cube: the place of a blurred hand is right, not its
# pose.
RELIABLE = 0.8
# Flexion of a finger joint towards the palm, at least and at most, and largest deviation from this
# axis; radians.
_KNUCKLE = (-0.5, 1.7, 0.4)
_HINGE = (-0.2, 2.0, 0.2)
_THUMB = (-0.4, 0.4, 1.2)  # rotation of a thumb joint about its own bone, and deviation from it
# The keypoints that are joints, in the keypoints' order: the wrist, then three per finger, the
# thumb first.
_JOINTS = np.array([0, *(4 * finger + k for finger in range(5) for k in (1, 2, 3))])
# Pairs of keypoints with a known direction: those of the palm, then three per finger.
_PALM_BONES = [(0, 5), (0, 9), (0, 13), (0, 17), (5, 17)]
_BONES = np.array(
    [
        *_PALM_BONES,
        *((4 * finger + k, 4 * finger + k + 1) for finger in range(5) for k in (1, 2, 3)),
    ]
)
_PIXEL_WEIGHTS = np.array([WRIST_PIXEL_WEIGHT, *[PIXEL_WEIGHT] * (HAND_POINTS - 1)])
_TIP = {f: f"{f}_tip" if f in ("pinky", "thumb") else f"{f}_finger_tip" for f in FINGERS}
_MIDDLE_KNUCKLE = HAND_NAMES.index("middle_finger_mcp")
# Unseen fingers begin to return to rest after the first time, and rest after the second.
SHORT_GAP_S = 0.3
LONG_GAP_S = 1.0


def finger_names(side: str) -> list[str]:
    """Return the names of the 15 joints of a hand's fingers, from the index finger to the thumb."""
    return [f"{side}_{finger}{k}" for finger in FINGERS for k in (1, 2, 3)]


def finger_joints(body: Body, side: str) -> list[int]:
    """Return the indices of the 15 joints of a hand's fingers, from the index finger to the thumb.

    :raises UsageError: the body has no fingers.
    """
    names = finger_names(side)
    keypoints = {f"hand/{side}_{name}" for name in HAND_NAMES}
    if not set(names) <= set(body.joint_names) or not keypoints <= set(body.keypoint_names):
        raise UsageError(
            f"body '{body.name}' has no finger joints, which capturing hands needs: use scope_h or "
            "an SMPL+H file"
        )
    return [body.joint_names.index(name) for name in names]


def require_fingers(body: Body) -> None:
    """Check that a body has finger joints.

    :raises UsageError: it has none.
    """
    for side in SIDES:
        finger_joints(body, side)


class HandMeasurer:
    """Converts hand landmarks to measurements of one body.

    :param intrinsics: (3, 3) K in pixels.
    :raises UsageError: the body has no finger joints.
    """

    def __init__(self, body: Body, intrinsics: Float64Array) -> None:
        self._body = body
        self._unproject = np.linalg.inv(intrinsics)
        self.indices = np.array(
            [body.keypoint_names.index(name) for name in HAND_KEYPOINT_NAMES]
        ).reshape(2, -1)
        self.fingers = [finger_joints(body, side) for side in SIDES]
        self.wrists = [body.joint_names.index(f"{side}_wrist") for side in SIDES]
        # Bones as (from, to): pairs of the hand's keypoints, and the solver's indices of the same
        # points.
        self._from, self._to = _BONES.T
        self._starts, self._ends = (
            np.array([self._points(side)[pairs] for side in range(len(SIDES))])
            for pairs in (self._from, self._to)
        )

    def _points(self, side: int) -> IndexArray:
        """Return the solver's (21,) indices of a hand's keypoints; joints where possible, so that
        bones share parts.
        """
        points: IndexArray = self.indices[side].copy()
        joints = [self.wrists[side], *(self.fingers[side][k] for k in (12, 13, 14, *range(12)))]
        points[_JOINTS] = len(self._body.keypoint_names) + np.array(joints)
        return points

    def add(self, measured: Measurements, hands: FloatArray) -> Measurements:
        """Add the hands to the measurements of a frame.

        :param hands: (2, 21, 7) as `Observation` has them, with undistorted pixels; confidence 0
            where not seen.
        """
        first = measured.keypoints2d
        bones = measured.orientation_field
        assert first is not None
        assert bones is not None
        seen = [side for side in range(len(SIDES)) if hands[side, 0, 2] > 0]
        if not seen:
            return measured
        confidence = hands[seen, :, 2]
        reliable = reliability(hands[seen])
        directions = self._directions(hands[seen])
        return replace(
            measured,
            keypoints2d=Keypoints2D(
                np.concatenate([first.indices, self.indices[seen].ravel()]),
                np.concatenate([first.pixels, hands[seen, :, :2].reshape(-1, 2)]),
                np.concatenate([first.confidence, (_PIXEL_WEIGHTS * confidence).ravel()]),
            ),
            orientation_field=OrientationField(
                np.concatenate([bones.starts, self._starts[seen].ravel()]),
                np.concatenate([bones.ends, self._ends[seen].ravel()]),
                np.concatenate([bones.directions, directions.reshape(-1, 3)]),
                np.concatenate(
                    [bones.confidence, DIRECTION_WEIGHT * reliable[:, self._to].ravel()]
                ),
            ),
        )

    def _directions(self, hands: FloatArray) -> FloatArray:
        """Return the (n, bones, 3) vectors along the bones of n hands (n, 21, 7), camera axes."""
        rays = hands[..., :2].mean(axis=1) @ self._unproject[:2, :2].T + self._unproject[:2, 2]
        R_virtual_camera = camera_towards(rays)
        world = hands[..., 3:6]
        return (world[:, self._to] - world[:, self._from]) @ R_virtual_camera

    def joint_confidence(self, hands: FloatArray) -> Float64Array:
        """Return (T, K+1), the confidence of the hand of each wrist and finger joint, of hands (T,
        2, 21, 7).
        """
        out = np.zeros((len(hands), self._body.K + 1))
        for side, joints in enumerate(self.fingers):
            for joint in (self.wrists[side], *joints):
                out[:, joint] = hands[:, side, 0, 2]
        return out


def reliability(hands: FloatArray) -> FloatArray:
    """Return how reliable the pose of each hand is at each keypoint (..., 21), 0..1: less where it
    is blurred or small.

    :param hands: (..., 21, 7) as `HandMeasurer.add` takes them.
    """
    confidence = hands[..., 2]
    size_px = np.linalg.norm(hands[..., _MIDDLE_KNUCKLE, :2] - hands[..., 0, :2], axis=-1)
    by_size = np.minimum(size_px / FULL_SIZE_PX, 1.0) ** 2
    reliable: FloatArray = confidence * np.minimum(confidence / RELIABLE, 1.0) ** 2
    reliable = reliable * by_size[..., None]
    return reliable


def with_finger_limits(priors: Priors, body: Body) -> Priors:
    """Add joint limits of the fingers to the priors.

    Fingers bend towards the palm, about the axis perpendicular to bone and palm normal in the rest
    pose. The normal is (index − wrist) × (little finger − wrist) on the right hand, and its
    opposite on the left. The thumb's joints have other axes: only their twist about the bone and
    their deviation from it are limited.

    :raises UsageError: the body has no finger joints.
    """
    J = body.J_template
    joints = []
    axes = []
    ranges = []
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
    ints, floats = joint_limits.pack(
        np.array(joints), np.array(axes), lower, upper, swing, ones, ones
    )
    if priors.limits is not None:
        ints = np.vstack([priors.limits[0], ints])
        floats = np.vstack([priors.limits[1], floats])
    return replace(priors, limits=(ints, floats))


def smooth_fingers(
    rotations: FloatArray, fingers: list[list[int]], seen: BoolArray, times: Float64Array
) -> FloatArray:
    """Fill in the fingers of hands that are not seen with smooth motion.

    Rotations are interpolated between the frames in which the hand was seen. The farther these are
    away in time, the closer the fingers are to the rest pose, which they reach after `LONG_GAP_S`.

    :param rotations: (T, K+1, 3, 3) of all joints.
    :param fingers: joint indices of each hand's fingers.
    :param seen: (T, 2) whether each hand was seen.
    :param times: (T,) seconds.
    :return: (T, K+1, 3, 3) rotations.
    """
    out = rotations.copy()
    for joints, hand_seen in zip(fingers, seen.T, strict=True):
        if hand_seen.all():
            continue
        if not hand_seen.any():
            out[:, joints] = np.eye(3)
            continue
        seen_s = np.concatenate([[-np.inf], times[hand_seen], [np.inf]])
        after = np.searchsorted(times[hand_seen], times)
        gap_s = np.minimum(times - seen_s[after], seen_s[after + 1] - times)
        share = np.clip((gap_s - SHORT_GAP_S) / (LONG_GAP_S - SHORT_GAP_S), 0.0, 1.0)
        keep = 1.0 - share * share * (3.0 - 2.0 * share)
        between = fill_rotation_gaps(rotations[:, joints], hand_seen, times)
        out[:, joints] = exp(keep[:, None, None] * log(between))
    return out


def without_fingers(body: Body) -> Body:
    """Return a body whose fingers are rigid parts of its palms, in the rest pose; the body itself
    if it has none.

    For people of whom no hand is seen: what a clip costs to fit grows with the cube of the number
    of joints that are fitted together, and 30 of the 51 joints of a body with fingers are theirs.
    Keypoints, vertices and their numbers stay as they are.
    """
    fingers = {name for side in SIDES for name in finger_names(side)}
    kept = [k for k, name in enumerate(body.joint_names) if name not in fingers]
    if len(kept) == len(body.joint_names):
        return body
    # For each part, the part of the body without fingers that carries it.
    part = np.zeros(len(body.joint_names), np.intp)
    for k, parent in enumerate(body.parents):
        part[k] = kept.index(k) if k in kept else part[parent]
    return replace(
        body,
        joint_names=tuple(body.joint_names[k] for k in kept),
        parents=np.array([-1 if k == 0 else part[body.parents[k]] for k in kept], np.int32),
        J_template=body.J_template[kept],
        J_shapedirs=body.J_shapedirs[kept],
        skin_joints=part[body.skin_joints].astype(body.skin_joints.dtype),
        keypoint_part=part[body.keypoint_part].astype(body.keypoint_part.dtype),
    )
