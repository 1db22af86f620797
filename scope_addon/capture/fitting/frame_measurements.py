# SPDX-License-Identifier: GPL-3.0-or-later
"""From a frame's landmarks to the solver's measurements: 2D keypoints, 3D keypoints, part orientation field.

Weights are inverse variances. The lifting network's points P are centred at the hips; their place in the camera
follows from the 2D landmarks, t = argmin Σ c |(P_j + t)_xy − x_j (P_j + t)_z|². How far each is trusted, from the
standard deviation that the network foretells.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ....solver import Body, Keypoints2D, Keypoints3D, Measurements, OrientationField, PosePriors
from ..perception.landmark_network import KEYPOINT_NAMES

# How far a landmark is trusted beside a wrist or knee: the face and fingers lie close together and say little about
# the body, and what the network calls hip lies elsewhere from person to person.
_TRUST = {"hip": 0.7, "nose": 0.5, "ear": 0.5, "heel": 0.5, "foot": 0.5}
_TRUST |= {"pinky": 0.3, "index": 0.3, "thumb": 0.3, "eye": 0.2, "mouth": 0.2}
_BONES = ("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")
DEPTH_SIGMA_M = 0.1  # standard deviation of a 3D keypoint of confidence 1
DIRECTION_SIGMA = 0.3  # the same of a bone's direction
MOST_CONFIDENCE = 2.0  # of a direction
SURE_CONFIDENCE, CONTRADICTION = 0.3, np.cos(np.radians(60.0))  # of a direction, and of the angle to what is fitted
ROOT_SIGMA_M = 0.12  # of a pelvis above feet that stand on the floor
NEAREST_M = 0.3  # a person closer to the camera than this is a mistake


class Measurer:
    """Makes measurements for one body from landmark arrays; the maps between the two are found once."""

    def __init__(self, body: Body, intrinsics: np.ndarray) -> None:
        self.body, self.intrinsics = body, intrinsics
        at = body.keypoint_set("blazepose")
        self.indices = np.array([at[name] for name in KEYPOINT_NAMES])
        self.trust = np.array([_trust(name) for name in KEYPOINT_NAMES])
        pairs = [(f"{s}_{a}", f"{s}_{b}") for s in ("left", "right") for a, b in _BONES] + [("right_hip", "left_hip")]
        first_joint = len(body.keypoint_names)  # the solver numbers the joints after the keypoints
        # Limbs are lifted to their joints, wherever the picture shows them; face, hands and feet to where it does.
        joints = {name: first_joint + k for k, name in enumerate(body.joint_names)}
        self.is_joint = np.array([name in joints for name in KEYPOINT_NAMES])
        self.lifted_indices = np.array([joints.get(name, at[name]) for name in KEYPOINT_NAMES])
        self.bone_starts, self.bone_ends = (
            np.array([first_joint + body.joint_names.index(pair[k]) for pair in pairs]) for k in (0, 1)
        )
        self.from_landmark, self.to_landmark = (np.array([KEYPOINT_NAMES.index(p[k]) for p in pairs]) for k in (0, 1))

    @cached_property
    def _unproject(self) -> np.ndarray:
        return np.linalg.inv(self.intrinsics)

    def rays(self, pixels: np.ndarray) -> np.ndarray:
        """(J, 2) pixels without distortion -> (J, 2) normalized image coordinates."""
        return pixels @ self._unproject[:2, :2].T + self._unproject[:2, 2]

    def measure(
        self,
        pixels: np.ndarray,
        confidence: np.ndarray,
        points: np.ndarray,
        sigma: np.ndarray,
        root_cam: np.ndarray | None = None,
    ) -> Measurements:
        """Measurements of one frame.

        :param pixels: (33, 2) without lens distortion;  confidence: (33,) 0..1;  points: (33, 3) metres, hip-centred,
            camera axes;  sigma: (33,) metres, the standard deviation of their depth.
        :param root_cam: (3,) where the pelvis is known to be, metres, camera frame; places the 3D keypoints and is a
            prior of ``ROOT_SIGMA_M``.
        """
        rays = self.rays(pixels)
        place_cam = place(points, rays, confidence)
        if root_cam is not None:
            place_cam = place_cam * (root_cam[2] / max(place_cam[2], NEAREST_M))
        placed = points + place_cam
        placed[:, 2] = np.maximum(placed[:, 2], NEAREST_M)
        bones = points[self.to_landmark] - points[self.from_landmark]
        slope = np.hypot(sigma[self.to_landmark], sigma[self.from_landmark])
        slope /= np.maximum(np.linalg.norm(bones, axis=1), 0.1)
        return Measurements(
            intrinsics=self.intrinsics,
            keypoints2d=Keypoints2D(self.indices, pixels, confidence * self.trust),
            keypoints3d=Keypoints3D(self.lifted_indices, placed, (DEPTH_SIGMA_M / sigma) ** 2),
            orientation_field=OrientationField(
                self.bone_starts,
                self.bone_ends,
                bones,
                np.minimum((DIRECTION_SIGMA / slope) ** 2, MOST_CONFIDENCE),
            ),
            pose_priors=None if root_cam is None else _root_prior(root_cam),
        )

    def contradicts(self, measurements: Measurements, joints_cam: np.ndarray) -> bool:
        """Whether some bone of a fit, joints (K+1, 3), points elsewhere than it was lifted to, for sure."""
        field, first_joint = measurements.orientation_field, len(self.body.keypoint_names)
        if field is None:
            return False
        own = slice(len(self.bone_starts))  # those of the fingers follow, where hands are looked for
        directions, confidence = np.asarray(field.directions)[own], np.asarray(field.confidence)[own]
        bones = joints_cam[self.bone_ends - first_joint] - joints_cam[self.bone_starts - first_joint]
        lengths = np.linalg.norm(bones, axis=1) * np.linalg.norm(directions, axis=1)
        away = (bones * directions).sum(axis=1) < CONTRADICTION * lengths
        return bool((away & (confidence > SURE_CONFIDENCE)).any())

    def joint_confidence(self, confidence: np.ndarray) -> np.ndarray:
        """(T, 33) landmark confidences -> (T, K+1): how far landmarks, not priors, fix each joint's rotation.

        A joint's rotation shows in the keypoints of its own part, away from the joint; failing these, in those of the
        nearest parts below it. A part with neither is fixed by priors alone: 0.
        """
        body = self.body
        part = body.keypoint_part[self.indices]
        children = [np.flatnonzero(body.parents == i) for i in range(body.K + 1)]
        out = np.zeros((len(confidence), body.K + 1))
        for i in range(body.K + 1):
            fixing = np.flatnonzero((part == i) & ~self.is_joint)
            below = children[i]
            while len(fixing) == 0 and len(below):
                fixing = np.flatnonzero(np.isin(part, below))
                below = np.concatenate([children[b] for b in below])
            if len(fixing):
                out[:, i] = confidence[:, fixing].mean(1)
        return out


def place(world: np.ndarray, rays: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(3,) translation that moves hip-centred points onto their rays, by the least squares of the module's equation."""
    n = len(world)
    A = np.zeros((2 * n, 3))
    A[:n, 0] = A[n:, 1] = 1.0
    A[:n, 2], A[n:, 2] = -rays[:, 0], -rays[:, 1]
    b = np.concatenate([rays[:, 0] * world[:, 2] - world[:, 0], rays[:, 1] * world[:, 2] - world[:, 1]])
    w = np.tile(np.sqrt(weight), 2)
    return np.linalg.lstsq(A * w[:, None], b * w, rcond=None)[0]


def _root_prior(root_cam: np.ndarray) -> PosePriors:
    return PosePriors([0], np.eye(3)[None], root_cam[None], [0.0], [1 / ROOT_SIGMA_M**2])


def _trust(name: str) -> float:
    return next((value for key, value in _TRUST.items() if key in name), 1.0)
