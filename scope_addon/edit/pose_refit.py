# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting one pose again to a few corrected points, with the pose as it was as the prior.

    minimize  ½ Σ w_p |r_p|² + ½ Σ w_i |log(Ω̂_iᵀ Ω_i)|² + ½ w_R |log(R̂_0ᵀ R_0)|² + ½ w_t |t_0 −
              t̂_0|²

where r_p are the corrected points, in the image or in space, and held points: other hands, feet and
the head, which should stay where they were. The joints of the corrected limb are free to turn, all
others are stiff. A one-sided residual keeps the skin of the feet above the floor, and where the
trunk is moved that of all parts.

A pin can only be followed as far as the limb reaches. One that is farther away than the limb is
long would otherwise be met by moving the whole body. So the pin is moved towards the limb's first
joint, on the straight line, until the stretched limb and a small slack reach it. The slack is what
shoulder girdle, trunk and pelvis may add. Pins of the pelvis and the hips are not limited: they
move the body.

A pin of the pelvis in the image keeps the person at their depth. Were the depth free, the body
could meet a pin below the pelvis by moving away from a camera that is lower than it, rather than by
bending the knees.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...solver import (
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
from ...solver.body import Body
from ...solver.measurements import SIGMA_3D
from ...solver.residuals import joint_limits
from ...solver.tree import with_fixed_shape
from ..arrays import Float64Array, FloatArray, unit_vectors
from ..errors import UsageError
from ..kinematics.contact_points import FOOT_PARTS, SOLES, with_contact_points
from ..kinematics.foot_skin import UNDER_FLOOR_M, FootSkin

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
# A camera: world_from_camera (4, 4), metres, and intrinsics (3, 3).
Camera = tuple[Float64Array, Float64Array]
_STEEP = np.radians(45.0)  # A steep camera looks farther up or down from the horizon.
SLACK_M = 0.03
_MOVES_BODY = ("pelvis", "left_hip", "right_hip")


@dataclass
class Points:
    """Measured points of one frame; numbers as in `PoseRefit.number`."""

    numbers: list[int] = field(default_factory=list)
    values: list[Float64Array] = field(default_factory=list)  # (3,) metres, or (2,) pixels
    weights: list[float] = field(default_factory=list)
    # The skin of each of `PoseRefit.skin`'s parts stays above its height here (N,), −∞ if it may be
    # anywhere; None: all may.
    floor: Float64Array | None = None

    def add(self, number: int, value: Float64Array, weight: float) -> None:
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


def moves_trunk(joints: Iterable[str]) -> bool:
    """Return whether one of the corrected joints moves the trunk with it."""
    return any(limb_of(joint) == "trunk" or joint.endswith(("hip", "collar")) for joint in joints)


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

    def __init__(self, body: Body, betas: FloatArray) -> None:
        """Prepare the body.

        :param betas: (P,) shape coefficients.
        """
        self.betas = np.asarray(betas, float)
        self.names = body.joint_names
        # The feet come first.
        others = [name for name in self.names if name not in FOOT_PARTS]
        self.skin = FootSkin(body, betas, [*FOOT_PARTS, *others])
        self.body, self._skin_points = self.skin.as_keypoints(with_contact_points(body, betas))
        self._skin_counts = [len(points) for points in self.skin.points]
        self._tree = with_fixed_shape(make_tree(self.body), self.betas)
        self._options = _options()
        self._points = len(self.body.keypoint_names)
        self._limits = joint_limits.hinges_of(self.names)
        self.ends = [name for name in _ENDS if name in self.names]

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
        self, rotations: Float64Array, root: Float64Array
    ) -> tuple[Float64Array, Float64Array, Float64Array]:
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
        rotations: Float64Array,
        root: Float64Array,
        joints: tuple[str, ...],
        points: Points,
        camera: Camera | None = None,
    ) -> tuple[Float64Array, Float64Array]:
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
            heights = np.repeat(points.floor, self._skin_counts)
            limited = np.isfinite(heights)
            up = np.tile(R_camera_world[:, 2], (limited.sum(), 1))
            offsets = heights[limited] - center[2]
            numbers = self._skin_points[limited]
            measured.floor = Floor(numbers, up, offsets, np.zeros(len(numbers)))
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
        rotations: Float64Array,
        root: Float64Array,
        points: Points,
        camera: Camera | None,
    ) -> Float64Array:
        """Return the shift (3,) by which hips that are measured in the image move there at their
        depth.
        """
        if camera is None:
            return np.zeros(3)
        hips = {self.number(name): self.joint(name) for name in ("left_hip", "right_hip")}
        at = self.place(rotations, root)[1]
        shifts = [
            point_at_depth(camera, value, at[hips[number]]) - at[hips[number]]
            for number, value in zip(points.numbers, points.values, strict=True)
            if number in hips and len(value) == 2
        ]
        return np.array(shifts).mean(axis=0) if shifts else np.zeros(3)

    def _root_prior(self, R: Float64Array, t: Float64Array, joints: tuple[str, ...]) -> PosePriors:
        """Return the prior on the pelvis, which may move where the trunk is corrected."""
        trunk = moves_trunk(joints)
        # Legs bend rather than let the body move away.
        share = 0.1 if trunk and not _bent_by(joints) else 1.0
        rotation = PELVIS_ROTATION * (0.1 if trunk else 1.0)
        return PosePriors([0], R[None], t[None], [rotation], [PELVIS_POSITION * share])

    def _weights(self, joints: tuple[str, ...]) -> Float64Array:
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
                if in_limb and limb_of(name) != "trunk":
                    weights[part] = FREE
                elif girdle:
                    weights[part] = min(weights[part], GIRDLE)
                part = int(self.body.parents[part])
        return weights[1:]

    def _limits_of(self, joints: tuple[str, ...]) -> tuple[NDArray[np.int64], Float64Array]:
        """Return the limits of knees and elbows of the corrected limbs: other joints stay as they
        were.
        """
        ints, floats = self._limits
        limbs = {limb_of(name) for name in joints} | _bent_by(joints)
        keep = np.array([limb_of(self.names[k]) in limbs for k in ints[:, 0]], bool)
        return ints[keep], floats[keep]


def pixel_of(camera: Camera, point: Float64Array) -> Float64Array:
    """Project a point (3,), world, to a pixel (2,)."""
    T, K = camera
    p = K @ (T[:3, :3].T @ (np.asarray(point, float) - T[:3, 3]))
    return p[:2] / p[2]


def nearest_on_ray(camera: Camera, pixel: Float64Array, point: Float64Array) -> Float64Array:
    """Return the point (3,) nearest to another one of those in front of the camera that project to
    a pixel (2,).
    """
    center = camera[0][:3, 3]
    ray = _ray(camera, pixel)
    return center + max(float((point - center) @ ray), 1e-3) * ray


def _ray(camera: Camera, pixel: Float64Array) -> Float64Array:
    """Return the unit vector (3,), world, from a camera to what it sees in a pixel (2,)."""
    T, K = camera
    ray = T[:3, :3] @ np.linalg.solve(K, np.array([*pixel, 1.0]))
    return unit_vectors(ray)


def point_at_depth(camera: Camera, pixel: Float64Array, point: Float64Array) -> Float64Array:
    """Return the point (3,) that projects to a pixel (2,) and is as far away as another one, (3,).

    It is in the upright plane through the other point that faces the camera, so that somebody who
    crouches does so in place. A camera that looks steeply down or up moves it in a plane that is
    parallel to the image.
    """
    ahead = camera[0][:3, 2]
    center = camera[0][:3, 3]
    normal = ahead * [1.0, 1.0, 0.0]
    if np.linalg.norm(normal) < np.cos(_STEEP):
        normal = ahead
    ray = _ray(camera, pixel)
    along = float(ray @ normal)
    # The ray meets the plane beside or behind the camera, or nowhere.
    if along < 1e-3 * float(np.linalg.norm(normal)):
        return nearest_on_ray(camera, pixel, point)
    return center + ray * (float((point - center) @ normal) / along)


def within_reach(
    refit: PoseRefit,
    joint: str,
    target: Float64Array,
    places: tuple[Float64Array, Mapping[str, Float64Array]],
    camera: Camera | None,
    slack: float = SLACK_M,
) -> Float64Array:
    """Return where a pin can be met: the pin itself, or a place on the way to it.

    :param target: (3,) metres in the world, or (2,) pixels.
    :param places: the joints before the correction (K+1, 3), world, and other joints that are
        pinned in space, (3,).
    :param camera: world_from_camera (4, 4) and intrinsics (3, 3), for a target in pixels.
    :param slack: metres that may be added to the limb's length.
    :return: the place in the form of ``target``; for the pelvis always (3,).
    """
    at, pinned = places
    if joint == "pelvis" and len(target) == 2 and camera is not None:
        return point_at_depth(camera, target, at[refit.joint(joint)])
    if joint in _MOVES_BODY:
        return target
    first, reach = _first_joint(refit, joint, pinned)
    origin = pinned.get(first, at[refit.joint(first)])
    nearest = (
        target if len(target) == 3 or camera is None else nearest_on_ray(camera, target, origin)
    )
    distance = float(np.linalg.norm(nearest - origin))
    if distance <= reach + slack:
        return target
    place: Float64Array = origin + (nearest - origin) * ((reach + slack) / distance)
    return place if len(target) == 3 or camera is None else pixel_of(camera, place)


def _first_joint(
    refit: PoseRefit, joint: str, pinned: Mapping[str, Float64Array]
) -> tuple[str, float]:
    """Return the joint that a limb turns about, or a pinned one nearer to its end, and the limb's
    length from there.
    """
    rest = refit.body.rest_joints(refit.betas)
    parents = refit.body.parents
    side = joint.partition("_")[0]
    ends = {f"{side}_arm": f"{side}_shoulder", f"{side}_leg": f"{side}_hip"}
    root = (
        "pelvis" if joint.endswith(("shoulder", "collar")) else ends.get(limb_of(joint), "pelvis")
    )
    part = refit.joint(joint)
    length = 0.0
    while True:
        parent = int(parents[part])
        length += float(np.linalg.norm(rest[part] - rest[parent]))
        part = parent
        if part == 0 or refit.names[part] == root or refit.names[part] in pinned:
            return refit.names[part], length
