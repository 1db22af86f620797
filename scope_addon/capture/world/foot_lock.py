# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet and palms locked where they rest on the floor.

After the depth is corrected (``ground_plane``), the sliding that is left is removed: each frame is fitted once
more with the standing feet held at one place, the same solver, the smoothed motion as its prior, and its projection as
measurements. Palms that rest on the floor are treated as soles are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ....solver import (
    Body,
    Floor,
    FootContacts,
    Keypoints2D,
    Measurements,
    Options,
    PosePriors,
    Priors,
    Stage,
    State,
    Weights,
    default_priors,
    fit_tree,
    make_tree,
)
from ....solver.rotations import shortest_turn
from ...kinematics.contact_points import SOLES
from ...kinematics.frame_blocks import by_blocks
from ...kinematics.smoothing import smooth_rotations
from ...kinematics.standing import along_sight
from ..fitting.frame_measurements import NEAREST_M
from .ground_plane import correct_depth, on_floor

PICTURE_SIGMA_M = 0.003  # by how much held feet may move a keypoint in the picture, at the person's distance
# They take off the edges where a foot or palm begins and ceases to be held: from legs and arms that do it, and from the
# rest.
STEP_CUTOFF_HZ = 8.0
REST_CUTOFF_HZ = 12.0


SupportsOf = Callable[[np.ndarray, np.ndarray], np.ndarray]


def stand_on_floor(
    body_with_supports: Body,
    rotations: np.ndarray,
    root_cam: np.ndarray,
    betas: np.ndarray,
    supports_of: SupportsOf,
    contact: np.ndarray,
    T_world_camera: np.ndarray,
    times: np.ndarray,
    center: np.ndarray | float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """The motion with its depth corrected by the floor, and standing feet held.

    :param rotations, root_cam: (T, K+1, 3, 3), (T, 3) in the camera frame, smoothed.
    :param supports_of: rotations and root positions to soles and palms (T, 6, 3), camera frame.
    :param contact: (T, 6) probability that each rests on something.
    :param center: (T, 3) of the camera, where it travels.
    :return: rotations and root positions.
    """
    supports = supports_of(rotations, root_cam)
    away = correct_depth(root_cam - center, supports, contact, T_world_camera, times)
    root_cam = root_cam + away[:, None] * along_sight(root_cam - center)
    R, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
    held = anchors(supports_of(rotations, root_cam) @ R.T + t, contact)
    indices = np.arange(len(body_with_supports.keypoint_names) - held.shape[1], len(body_with_supports.keypoint_names))
    lowest = np.minimum(held[..., 2].min(axis=1), 0.0)
    floor = R[2], lowest * (1 - on_floor(lowest)) - float(t[2])  # far below it, there is no floor
    targets = indices, (held - t) @ R, contact
    rotations, root_cam = hold_feet(body_with_supports, rotations, root_cam, betas, targets, floor, center)
    names = body_with_supports.joint_names
    holding = _LEG + _ARM if (contact[:, len(SOLES) :] > 0.5).any() else _LEG
    holds = np.array([k == 0 or any(part in name for part in holding) for k, name in enumerate(names)])
    for joints, cutoff_hz in ((holds, STEP_CUTOFF_HZ), (~holds, REST_CUTOFF_HZ)):
        rotations[:, joints] = smooth_rotations(rotations[:, joints], times, cutoff_hz)
    return rotations, root_cam


def hold_feet(
    body: Body,
    rotations: np.ndarray,
    root_cam: np.ndarray,
    betas: np.ndarray,
    targets: tuple[np.ndarray, np.ndarray, np.ndarray],
    floor: tuple[np.ndarray, np.ndarray],
    center: np.ndarray | float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Fit each frame once more with held points above a floor, everything else staying at the given motion.

    What the camera saw of head, arms, hips and knees stays where it was in the picture, but for wrists whose palms are
    held: a body gives way along the line of sight, whose length is known worst, rather than across it. Each frame is
    fitted in the axes of a camera that looks straight at the pelvis.

    :param rotations: (T, K+1, 3, 3);  root_cam: (T, 3): the motion to stay at, camera frame.
    :param targets: keypoint indices (6,), positions (T, 6, 3) in the camera frame, weights (T, 6) 0..1.
    :param floor: its unit normal (3,), upwards, and offset (T,): normal . p = offset on it, camera frame.
    :param center: (T, 3) of the camera, where it travels.
    :return: rotations and root positions as given.
    """
    tree = make_tree(body)
    indices, positions, weights = targets
    center = np.broadcast_to(center, root_cam.shape)
    turns = shortest_turn(root_cam - center, np.array([0.0, 0.0, 1.0]))
    seen = [body.keypoint_set("blazepose")[name] for name in _SEEN]
    at_palms = np.array([_SEEN.index(f"{side}_wrist") for side in ("left", "right")])
    at_rest = body.rest_joints(betas)[0]

    def shown(rotations: np.ndarray, root_cam: np.ndarray) -> tuple[np.ndarray]:
        return (body.keypoints(*body.forward_kinematics(rotations, root_cam - at_rest, betas), betas, seen),)

    (points,) = by_blocks(shown, rotations, root_cam)
    priors = replace(
        default_priors(body),
        shape_mean=betas,
        shape_information=np.eye(body.P) * 1e8,
        joint_weights=np.ones(body.K),
    )
    options = Options(stages=(Stage(_HOLD, 1e-3, 8),))
    free = np.zeros(len(indices))  # contact decides where a sole is; the floor alone where it cannot be
    pelvis, turn_weight, place_weight = np.zeros(1, int), np.array([1 / 0.01**2]), np.array([1 / 0.02**2])
    rotations, root_cam = rotations.copy(), np.array(root_cam, float)
    for t in np.flatnonzero(weights.max(1) > 0.05):
        turn = turns[t]
        root = turn @ (root_cam[t] - center[t])
        state = State(turn @ rotations[t, 0], root, rotations[t, 1:], betas)
        ahead = (points[t] - center[t]) @ turn.T
        certain = np.full(len(seen), np.square(root[2] / PICTURE_SIGMA_M))
        certain[at_palms] *= 1 - weights[t, len(SOLES) :]
        measurements = Measurements(
            intrinsics=np.eye(3),
            keypoints2d=Keypoints2D(seen, ahead[:, :2] / np.maximum(ahead[:, 2:], NEAREST_M), certain),
            foot_contacts=FootContacts(indices, (positions[t] - center[t]) @ turn.T, weights[t]),
            floor=Floor(indices, turn @ floor[0], float(floor[1][t] - floor[0] @ center[t]), free),
            pose_priors=PosePriors(pelvis, state.R_camera_root[None], root[None], turn_weight, place_weight),
        )
        here: Priors = replace(priors, joint_mean=rotations[t, 1:])
        found = fit_tree(tree, measurements, state, here, options).state
        rotations[t, 0], rotations[t, 1:] = turn.T @ found.R_camera_root, found.Omega
        root_cam[t] = turn.T @ found.t_camera_root + center[t]
    return rotations, root_cam


# A standing foot is held to 5 mm, no sole may be far below the floor; the pelvis may give 2 cm and half a degree, every
# joint alike two degrees, what is seen 3 mm across the line of sight. Legs that give more follow a sole's every error:
# with ten times the freedom, knees and ankles are 1 to 2 mm worse on footage and renders with known truth, and feet
# slide no less. A pelvis that is held to 5 mm in every direction, and nothing seen beside it, draws the whole body off
# the footage, by 2 cm where the floor is wrong.
_HOLD = Weights(
    foot_contact=1 / 0.005**2,
    floor=1 / 0.02**2,
    keypoints2d=1.0,
    joint_prior=1 / 0.03**2,
    joint_limits=2000.0,
    shape=1.0,
)
_SIDED = ("shoulder", "elbow", "wrist", "hip", "knee")
_SEEN = ("nose", *(f"{side}_{name}" for side in ("left", "right") for name in _SIDED))
_LEG, _ARM = ("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")


def anchors(points_world: np.ndarray, contact: np.ndarray) -> np.ndarray:
    """(T, F, 3) where each sole point stands: the mean of the span of contact it is in, on the floor if that is near.

    Frames outside any span get the sole's own position.
    """
    out = points_world.copy()
    for f in range(contact.shape[1]):
        standing = contact[:, f] > 0.5
        edges = np.flatnonzero(np.diff(np.r_[False, standing, False]))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            w = contact[start:end, f, None]
            out[start:end, f] = (w * points_world[start:end, f]).sum(0) / w.sum()
            out[start:end, f, 2] *= 1 - on_floor(out[start, f, 2])
    return out
