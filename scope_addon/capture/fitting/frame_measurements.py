# SPDX-License-Identifier: GPL-3.0-or-later
"""From a frame's landmarks to the solver's measurements: 2D keypoints, 3D keypoints, part
orientation field.

Weights are inverse variances. The lifting network's points P are centred on the hips; their
position in the camera follows from the 2D landmarks, t = argmin Σ c |(P_j + t)_xy − x_j (P_j +
t)_z|². The weight of each point follows from the standard deviation that the network predicts for
it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver import Body, Keypoints2D, Keypoints3D, Measurements, OrientationField, PosePriors
from ....solver.measurements import SIGMA_3D
from ...arrays import Float64Array, FloatArray, round_array
from ..perception.landmark_network import KEYPOINT_NAMES
from .weights import WEIGHTS

# Weights relative to a wrist or knee: keypoints of the face and fingers lie close together and say
# little about the body, and the position of the network's hips varies from person to person.
_RELATIVE_WEIGHT = {"hip": 0.7, "nose": 0.5, "ear": 0.5, "heel": 0.5, "foot": 0.5}
_RELATIVE_WEIGHT |= {"pinky": 0.3, "index": 0.3, "thumb": 0.3, "eye": 0.2, "mouth": 0.2}
# Weight of lifted shoulders: limbs have directions of their own, but nothing else says how the
# trunk leans. With 1, a trunk that the outline made too long leaned forward by up to 22 degrees
# more than the network said. With 30, people who stand lean less still, but one who squats has
# errors of 49 instead of 46 mm.
_SHOULDER_WEIGHT = 15.0
_BONES = ("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")
DEPTH_SIGMA_M = 0.1  # standard deviation of a 3D keypoint of confidence 1
# The same of a bone's direction. With less weight (0.3), the knees of people who stand are bent by
# 1 degree more; with more (0.42), Pose2Sim's camera 4 is worse by 1.4 mm.
DIRECTION_SIGMA = 0.36
MAX_CONFIDENCE = 3.0  # of a direction
# Confidence of the direction across a head whose face is surely seen: 1 degree, with which faces
# outweigh the body's keypoints of the head. With 0.8 degrees, heads are as accurate and tremble
# more.
HEAD_CONFIDENCE = 1.0 / (np.radians(1.0) ** 2 * WEIGHTS.orientation_field)
EARS = [KEYPOINT_NAMES.index(f"{side}_ear") for side in ("right", "left")]
# A fit contradicts a direction of at least this confidence if the angle between the two is larger
# than 60 degrees.
MIN_CONFIDENCE = 0.3
CONTRADICTION_COS = np.cos(np.radians(60.0))
ROOT_SIGMA_M = 0.12  # of a pelvis above feet on the floor
NEAREST_M = 0.3  # the least plausible distance of a person from the camera


class Measurer:
    """Converts landmarks to measurements of one body; the mapping between the two is computed once.

    :param intrinsics: (3, 3) K in pixels.
    """

    def __init__(self, body: Body, intrinsics: Float64Array) -> None:
        self.body = body
        self.intrinsics = intrinsics
        self._unproject = np.linalg.inv(intrinsics)
        at = body.keypoint_set("blazepose")
        self.indices = np.array([at[name] for name in KEYPOINT_NAMES])
        weights = _RELATIVE_WEIGHT.items()
        self.weight = np.array(
            [next((w for key, w in weights if key in name), 1.0) for name in KEYPOINT_NAMES]
        )
        is_shoulder = [name.endswith("shoulder") for name in KEYPOINT_NAMES]
        self.lifted_weight = np.where(is_shoulder, _SHOULDER_WEIGHT, 1.0)
        pairs = [(f"{s}_{a}", f"{s}_{b}") for s in ("left", "right") for a, b in _BONES] + [
            ("right_hip", "left_hip")
        ]
        first_joint = len(body.keypoint_names)  # the solver numbers the joints after the keypoints
        # Lifted points of limbs are the body's joints, wherever the network places their keypoints
        # in the image; lifted points of face, hands and feet are the keypoints themselves.
        joints = {name: first_joint + k for k, name in enumerate(body.joint_names)}
        self.is_joint = np.array([name in joints for name in KEYPOINT_NAMES])
        self.lifted_indices = np.array([joints.get(name, at[name]) for name in KEYPOINT_NAMES])
        self.bone_starts, self.bone_ends = (
            np.array([first_joint + body.joint_names.index(pair[k]) for pair in pairs])
            for k in (0, 1)
        )
        self.from_landmark, self.to_landmark = (
            np.array([KEYPOINT_NAMES.index(p[k]) for p in pairs]) for k in (0, 1)
        )

    def rays(self, pixels: FloatArray) -> FloatArray:
        """Convert undistorted pixels (..., 2) to normalized image coordinates (..., 2)."""
        return pixels @ self._unproject[:2, :2].T + self._unproject[:2, 2]

    def measure(
        self,
        pixels: FloatArray,
        confidence: FloatArray,
        points: FloatArray,
        sigma: FloatArray,
        root_cam: FloatArray | None = None,
    ) -> Measurements:
        """Return the measurements of one frame.

        :param pixels: (33, 2) without lens distortion.
        :param confidence: (33,) 0..1.
        :param points: (33, 3) metres, hip-centred, camera axes.
        :param sigma: (33,) metres, standard deviation of the points' depth.
        :param root_cam: (3,) known position of the pelvis, metres, camera frame; it determines the
            distance of the 3D keypoints and is a prior with standard deviation ``ROOT_SIGMA_M``.
        """
        rays = self.rays(pixels)
        place_cam = place(points, rays, confidence)
        if root_cam is not None:
            place_cam = place_cam * (root_cam[2] / max(place_cam[2], NEAREST_M))
        placed = round_array(points + place_cam)
        placed[:, 2] = np.maximum(placed[:, 2], NEAREST_M)
        bones = points[self.to_landmark] - points[self.from_landmark]
        slope = np.hypot(sigma[self.to_landmark], sigma[self.from_landmark])
        slope /= np.maximum(np.linalg.norm(bones, axis=1), 0.1)
        return Measurements(
            intrinsics=self.intrinsics,
            keypoints2d=Keypoints2D(self.indices, pixels, confidence * self.weight),
            keypoints3d=Keypoints3D(
                self.lifted_indices,
                placed,
                self.lifted_weight * (DEPTH_SIGMA_M / sigma) ** 2,
                SIGMA_3D,
            ),
            orientation_field=OrientationField(
                self.bone_starts,
                self.bone_ends,
                bones,
                np.minimum((DIRECTION_SIGMA / slope) ** 2, MAX_CONFIDENCE),
            ),
            pose_priors=None if root_cam is None else _root_prior(root_cam),
        )

    def with_head(
        self, measured: Measurements, across: FloatArray, certainty: float
    ) -> Measurements:
        """Add the direction (3,) from the right to the left ear, camera axes; ``certainty``:
        0..1.
        """
        field = measured.orientation_field
        if field is None or not certainty > 0:
            return measured
        start, end = self.indices[EARS]
        head = OrientationField(
            np.append(field.starts, start),
            np.append(field.ends, end),
            np.concatenate([field.directions, across[None]]),
            np.append(field.confidence, HEAD_CONFIDENCE * certainty),
        )
        return replace(measured, orientation_field=head)

    def contradicts(self, measurements: Measurements, joints_cam: FloatArray) -> bool:
        """Whether some bone of a fit contradicts a confident direction of the lifter.

        :param joints_cam: (K+1, 3) the fitted joints, camera frame.
        """
        field = measurements.orientation_field
        first_joint = len(self.body.keypoint_names)
        if field is None:
            return False
        own = slice(len(self.bone_starts))  # the directions of head and fingers come after these
        directions = np.asarray(field.directions)[own]
        confidence = np.asarray(field.confidence)[own]
        bones = (
            joints_cam[self.bone_ends - first_joint] - joints_cam[self.bone_starts - first_joint]
        )
        lengths = np.linalg.norm(bones, axis=1) * np.linalg.norm(directions, axis=1)
        away = (bones * directions).sum(axis=1) < CONTRADICTION_COS * lengths
        return bool((away & (confidence > MIN_CONFIDENCE)).any())

    def joint_confidence(self, confidence: FloatArray) -> Float64Array:
        """Return the mean confidence of the landmarks in which each joint's rotation is visible.

        These are the keypoints of its own part, away from the joint, and if there are none, those
        of the nearest descendants. Without either, nothing in the image shows it: 0. It says
        whether landmarks were seen, not how accurate the rotation is.

        :param confidence: (T, 33) of the landmarks.
        :return: (T, K+1) 0..1.
        """
        body = self.body
        part = body.keypoint_part[self.indices]
        children = [np.flatnonzero(body.parents == i) for i in range(body.K + 1)]
        out = np.zeros((len(confidence), body.K + 1))
        for i in range(body.K + 1):
            relevant = np.flatnonzero((part == i) & ~self.is_joint)
            below = children[i]
            while len(relevant) == 0 and len(below):
                relevant = np.flatnonzero(np.isin(part, below))
                below = np.concatenate([children[b] for b in below])
            if len(relevant):
                out[:, i] = confidence[:, relevant].mean(1)
        return out


def place(world: FloatArray, rays: FloatArray, weight: FloatArray) -> Float64Array:
    """Return the (3,) translation that moves hip-centred points onto their rays: t of the module's
    equation.

    :param world: (n, 3) metres.
    :param rays: (n, 2) normalized image coordinates.
    :param weight: (n,) c.
    """
    w = np.asarray(weight, float) / max(float(np.sum(weight)), 1e-300)
    b = rays * world[:, 2:] - world[:, :2]  # t_xy - x t_z
    x_mean = w @ rays
    b_mean = w @ b
    x = rays - x_mean
    b = b - b_mean
    spread = float(w @ (x * x).sum(axis=1))
    # Fewer than two points do not tell it.
    z = -float(w @ (x * b).sum(axis=1)) / spread if spread > 1e-12 else 0.0
    return np.array([*(b_mean + x_mean * z), z])


def _root_prior(root_cam: FloatArray) -> PosePriors:
    return PosePriors([0], np.eye(3)[None], root_cam[None], [0.0], [1 / ROOT_SIGMA_M**2])
