# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting one pose again to a few corrected points, with the pose as it was as the prior.

    minimize  ½ Σ w_p |r_p|² + ½ Σ w_i |log(Ω̂_iᵀ Ω_i)|² + ½ w_R |log(R̂_0ᵀ R_0)|² + ½ w_t |t_0 −
              t̂_0|²

where r_p are the corrected points, in the image or in space, and held points: other hands, feet and
the head, which should stay where they were. The joints of the corrected limb are free to turn, all
others are stiff. The skin of the feet has a one-sided residual, which keeps it above the floor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import (
    Floor,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    PosePriors,
    Priors,
    Stage,
    State,
    Weights,
    fit_tree,
    make_tree,
)
from ....solver.body import Body
from ....solver.measurements import SIGMA_3D
from ....solver.residuals import joint_limits
from ....solver.tree import with_fixed_shape
from ...errors import UsageError
from ...kinematics.contact_points import SOLES, with_contact_points
from ...kinematics.foot_skin import UNDER_FLOOR_M, FootSkin
from .rays import Camera, point_at_depth

# Inverse variances: per radian² of joints, per metre² of points and of the pelvis, per squared
# image coordinate.
FREE = 1.0
GIRDLE = 10.0
STIFF = 100.0
PELVIS_ROTATION = 400.0
PELVIS_POSITION = 400.0
# Deviations of 1 mm, and of 0.3 pixels at a focal length of 1000.
PINNED = 1e6
PINNED_2D = 1e7
# Deviations of 1 cm and 3 cm.
STANDING = 1e4
HELD = 1e3
ABOVE_FLOOR = 1e5  # A deviation of 3 mm for each point of the skin that is under the floor.
# A capture too leaves feet nearly a centimetre under the floor.
FLOOR_M = -0.8 * UNDER_FLOOR_M
_TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
_LIMBS = {
    "arm": ("collar", "shoulder", "elbow", "wrist", "hand"),
    "leg": ("hip", "knee", "ankle", "foot"),
}
_ENDS = ("left_wrist", "right_wrist", "left_ankle", "right_ankle", "head")


@dataclass
class Points:
    """Measured points of one frame; numbers as in `PoseRefit.number`."""

    numbers: list[int] = field(default_factory=list)
    values: list[NDArray[np.float64]] = field(default_factory=list)  # (3,) metres, or (2,) pixels
    weights: list[float] = field(default_factory=list)
    # The feet's skin stays above this height; None: it may be anywhere.
    floor: float | None = None

    def add(self, number: int, value: NDArray[np.float64], weight: float) -> None:
        """Add a point.

        :param value: (3,) metres in the world, or (2,) in the image.
        """
        self.numbers.append(number)
        self.values.append(np.asarray(value, float))
        self.weights.append(weight)


def limb_of(joint: str) -> str:
    """Return the limb of a joint: left_arm, right_leg, …, or trunk."""
    side, _, bare = joint.partition("_")
    for limb, names in _LIMBS.items():
        if side in ("left", "right") and bare.startswith(names):
            return f"{side}_{limb}"
    return "trunk" if joint in _TRUNK else f"{side}_arm"  # fingers


def _bent_by(joints: tuple[str, ...]) -> set[str]:
    """Return the limbs that bend where the pelvis or hips are moved: the legs, whose feet stay
    where they are.
    """
    moved = "pelvis" in joints or any(joint.endswith("hip") for joint in joints)
    return {"left_leg", "right_leg"} if moved else set()


def _options() -> Options:
    weights = Weights(
        keypoints2d=1.0,
        keypoints3d=1.0,
        joint_prior=1.0,
        joint_limits=500.0,
        shape=1.0,
        floor=ABOVE_FLOOR,
    )
    return Options(
        stages=(Stage(weights, 1e-9, 60),),
        robust_keypoints2d=math.inf,
        robust_keypoints3d=math.inf,
        damping=0.1,
        curvature=False,
    )


class PoseRefit:
    """Fits poses of one body of a fixed shape."""

    def __init__(self, body: Body, betas: NDArray[np.floating[Any]]) -> None:
        """Prepare the body.

        :param betas: (P,) shape coefficients.
        """
        self.betas = np.asarray(betas, float)
        self.skin = FootSkin(body, betas)
        self.body, self._skin_points = self.skin.as_keypoints(with_contact_points(body, betas))
        self.names = list(body.joint_names)
        self._tree = with_fixed_shape(make_tree(self.body), self.betas)
        self._options = _options()
        self._points = len(self.body.keypoint_names)
        self._priors: dict[tuple[str, ...], Priors] = {}
        self._limits = joint_limits.hinges_of(self.names)
        self.ends = [name for name in _ENDS if name in self.names]
        self.sole_names = SOLES

    def joint(self, name: str) -> int:
        """Return the number of a joint.

        :raises UsageError: the body has no such joint.
        """
        if name not in self.names:
            raise UsageError(f"the body has no joint '{name}'; it has {', '.join(self.names)}")
        return self.names.index(name)

    def number(self, name: str) -> int:
        """Return the number of a joint or sole point among the solver's points."""
        if name in SOLES:
            return self.body.keypoint_names.index(name)
        return self._points + self.joint(name)

    def soles_of(self, limb: str) -> list[str]:
        """Return the sole points of a leg; none for other limbs."""
        return [
            s for s in SOLES if limb.endswith("leg") and s.startswith(f"sole/{limb.split('_')[0]}")
        ]

    def place(
        self, rotations: NDArray[np.float64], root: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return orientations (..., K+1, 3, 3) and positions (..., K+1, 3) of all parts, and the
        soles (..., 4, 3).

        :param rotations: (..., K+1, 3, 3), the root's in the world.
        :param root: (..., 3) metres.
        """
        R, t = self.body.forward_kinematics(
            rotations, root - self.body.rest_joints(self.betas)[0], self.betas
        )
        first = self.body.keypoint_names.index(SOLES[0])
        return R, t, self.body.keypoints(R, t, self.betas, which=slice(first, first + len(SOLES)))

    def solve(
        self,
        rotations: NDArray[np.float64],
        root: NDArray[np.float64],
        joints: tuple[str, ...],
        points: Points,
        camera: Camera | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Fit one pose to points.

        :param rotations, root: (K+1, 3, 3), (3,) the pose as it was, world.
        :param joints: the corrected joints, whose limbs are free to turn.
        :param camera: world_from_camera (4, 4) and intrinsics (3, 3), for points in pixels.
        :return: the new pose.
        """
        root_prior = root + self._shift_in_image(rotations, root, points, camera)
        T = np.eye(4) if camera is None else camera[0]
        R_camera_world = T[:3, :3].T
        center = T[:3, 3]
        in_space = [k for k, v in enumerate(points.values) if len(v) == 3]
        in_image = [k for k, v in enumerate(points.values) if len(v) == 2]
        numbers = np.array(points.numbers, int)
        weights = np.array(points.weights)
        measured = Measurements(
            pose_priors=self._root_prior(
                R_camera_world @ rotations[0], R_camera_world @ (root_prior - center), joints
            )
        )
        if in_space:
            xyz = (np.array([points.values[k] for k in in_space]) - center) @ R_camera_world.T
            measured.keypoints3d = Keypoints3D(numbers[in_space], xyz, weights[in_space], SIGMA_3D)
        if in_image and camera is not None:
            uv = np.array([points.values[k] for k in in_image])
            measured.intrinsics = camera[1]
            measured.keypoints2d = Keypoints2D(numbers[in_image], uv, weights[in_image])
        if points.floor is not None:
            numbers = self._skin_points
            up = R_camera_world[:, 2]
            measured.floor = Floor(numbers, up, points.floor - center[2], np.zeros(len(numbers)))
        state = State(
            R_camera_world @ rotations[0],
            R_camera_world @ (root - center),
            rotations[1:].copy(),
            np.zeros(0),
        )
        priors = Priors(rotations[1:].copy(), self._weights(joints), limits=self._limits_of(joints))
        found = fit_tree(self._tree, measured, state, priors, self._options).state
        out = np.concatenate([(R_camera_world.T @ found.R_camera_root)[None], found.Omega])
        return out, R_camera_world.T @ found.t_camera_root + center

    def _shift_in_image(
        self,
        rotations: NDArray[np.float64],
        root: NDArray[np.float64],
        points: Points,
        camera: Camera | None,
    ) -> NDArray[np.float64]:
        """Return the shift (3,) by which hips that are measured in the image move there at their
        depth.
        """
        numbers = {self.number(name): self.joint(name) for name in ("left_hip", "right_hip")}
        pixels = [
            (numbers[n], v)
            for n, v in zip(points.numbers, points.values, strict=True)
            if n in numbers
        ]
        pixels = [(joint, value) for joint, value in pixels if len(value) == 2]
        if not pixels or camera is None:
            return np.zeros(3)
        at = self.place(rotations, root)[1]
        shifts = [point_at_depth(camera, pixel, at[joint]) - at[joint] for joint, pixel in pixels]
        mean: NDArray[np.float64] = np.mean(shifts, axis=0)
        return mean

    def _root_prior(
        self, R: NDArray[np.float64], t: NDArray[np.float64], joints: tuple[str, ...]
    ) -> PosePriors:
        """Return the prior on the pelvis, which may move where the trunk is corrected."""
        trunk = any(limb_of(j) == "trunk" or j.endswith(("hip", "collar")) for j in joints)
        # Legs bend rather than let the body move away.
        share = 0.1 if trunk and not _bent_by(joints) else 1.0
        rotation = PELVIS_ROTATION * (0.1 if trunk else 1.0)
        posed: PosePriors = PosePriors([0], R[None], t[None], [rotation], [PELVIS_POSITION * share])
        return posed

    def _weights(self, joints: tuple[str, ...]) -> NDArray[np.float64]:
        """Return the weights (K,) of the joints' prior."""
        weights = np.full(len(self.names), STIFF)
        for k, name in enumerate(self.names):
            if limb_of(name) in _bent_by(joints):
                weights[k] = FREE
        for name in joints:
            part = int(self.body.parents[self.joint(name)])
            while part > 0:
                ancestor = self.names[part]
                in_limb = limb_of(ancestor) == limb_of(name) and not ancestor.endswith("collar")
                girdle = (
                    ancestor.endswith("collar")
                    or limb_of(name) == "trunk"
                    or name.endswith(("shoulder", "collar"))
                )
                weights[part] = min(
                    weights[part], FREE if in_limb and limb_of(name) != "trunk" else STIFF
                )
                weights[part] = min(weights[part], GIRDLE if girdle else STIFF)
                part = int(self.body.parents[part])
        return weights[1:]

    def _limits_of(self, joints: tuple[str, ...]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the limits of knees and elbows of the corrected limbs: other joints stay as they
        were.
        """
        ints, floats = self._limits
        limbs = {limb_of(name) for name in joints} | _bent_by(joints)
        keep = np.array([limb_of(self.names[k]) in limbs for k in ints[:, 0]], bool)
        return ints[keep], floats[keep]
