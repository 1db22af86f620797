# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet and hands that rest on the floor and stay where they rest, for a static camera.

One camera sees directions well and depth badly. Where a foot stands, the floor and the foot's own stillness say how
far away the person is, so the depth of every frame is corrected first (``correct_depth``). What is left of sliding is
taken out by fitting each frame once more with the standing feet held at one place (``hold_feet``): the same solver, the
smoothed motion as its prior, and its picture as what is seen. Palms that rest on the floor are treated as soles are.

Not everything that carries a foot is the floor: somebody climbs stairs, or jumps off a wall. A foot that stands at
height h is taken to stand on the floor with the share s(4(1 − |h|/h_l)), s the logistic: within the noise of depth
nearly sure, beyond nearly never.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...solver import (
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
from ...solver.rotations import shortest_turn
from .frame_blocks import by_blocks
from .measure import NEAREST_M
from .smoothing import gaussian_smooth, smooth_rotations
from .supports import SOLES

CONTACT_SPEED_M_S = 0.35  # across the line of sight; a swinging foot moves at 1 m/s and more
CONTACT_HEIGHT_M = 0.05  # above the frame's lowest sole point
PALM_HEIGHT_M = 0.12  # of a palm above the lowest sole: the trunk between them is put to a wrong depth as well
CONTACT_CUTOFF_HZ = 4.0  # of a sole's way, before its speed is asked: noise must not set a standing foot going
# A foot in the air does not keep still: one that does for a second or so may be higher than the lowest because it was
# put to a wrong distance, up or down its line of sight.
STILL_M_S, STILL_CUTOFF_HZ = 0.12, 0.6
WRONG_DEPTH_M = 0.4
FLOOR_SIGMA_M = 0.03
LEVEL_M = 0.25  # h_l: feet that stand farther above or below stand on something else
DEPTH_SIGMA_M = 0.1  # how wrong a depth that fits the image may be
DEPTH_RATE_SIGMA = 0.3  # and how fast that error changes, m/s
SLIDE_SIGMA_M_S = 0.1  # a standing foot's horizontal speed
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


def along_sight(position: np.ndarray) -> np.ndarray:
    """(..., 3) unit vectors from the camera's centre to positions (..., 3) about it."""
    return position / np.maximum(np.linalg.norm(position, axis=-1, keepdims=True), 1e-9)


def standing_probability(
    soles: np.ndarray, up: np.ndarray, times: np.ndarray, center: np.ndarray | None = None
) -> np.ndarray:
    """(T, F) probability that each sole point stands: slow and lowest of its frame.

    p = s(4(1 − v/v₀)) s(4(1 − h/(h₀ + |g| d s(4(1 − v̄/v₁))))) with the logistic s. The height h is measured from the
    frame's lowest sole point, not from a floor that is not known yet. Where a camera saw the points, depth, the noisy
    direction, takes no part in the speed v; and as far as a point keeps still, it may be higher than the lowest by what
    a wrong depth d explains, g the upward part of its line of sight: v̄ is the root mean square of v over a second.

    :param soles: (T, F, 3) metres;  up: (3,) unit;  times: (T,) seconds.
    :param center: (T, 3) or (3,) the camera's, in the same axes; None: no camera is known.
    """
    height = soles @ up
    height = height - height.min(axis=1, keepdims=True)
    speed, allowed = _speed(soles, times, center), np.full(height.shape, CONTACT_HEIGHT_M)
    if len(times) > 2 and center is not None:
        upwards = np.abs(along_sight(soles - np.expand_dims(center, -2)) @ up)
        mean_speed = np.sqrt(gaussian_smooth(np.square(speed), times, STILL_CUTOFF_HZ))
        allowed += WRONG_DEPTH_M * upwards * _logistic(4 * (1 - mean_speed / STILL_M_S))
    return _logistic(4 * (1 - speed / CONTACT_SPEED_M_S)) * _logistic(4 * (1 - height / allowed))


def resting_probability(supports: np.ndarray, up: np.ndarray, times: np.ndarray, center: np.ndarray) -> np.ndarray:
    """(T, 6) probability that each sole and palm rests on something: soles as `standing_probability` has them.

    A palm rests where it is slow and not higher than the lowest sole: p = s(4(1 − v/v₀)) s(4(1 − h/h_p)), h the height
    above that. Soles that are far above a palm, of one who stands on the hands, do not stand: their p is multiplied by
    s(8(1 − d/2h_l)) / s(8), d ≥ 0 the height of the lowest sole over the lowest palm.

    :param supports: (T, 6, 3) metres, seen from ``center`` (T, 3) or (3,);  up: (3,) unit;  times: (T,) seconds.
    """
    soles, palms = np.split(supports, [len(SOLES)], axis=1)
    height = palms @ up - (soles @ up).min(axis=1, keepdims=True)
    stands = standing_probability(soles, up, times, center)
    slow = _logistic(4 * (1 - _speed(palms, times, center) / CONTACT_SPEED_M_S))
    over_hands = np.maximum(-height.min(axis=1, keepdims=True), 0.0)
    stands *= _logistic(8 * (1 - over_hands / (2 * LEVEL_M))) / _logistic(8)
    return np.concatenate([stands, slow * _logistic(4 * (1 - height / PALM_HEIGHT_M))], axis=1)


def _speed(points: np.ndarray, times: np.ndarray, center: np.ndarray | None) -> np.ndarray:
    """(T, F) m/s, across the line of sight where there is a camera; 0 in clips of one or two frames."""
    if len(times) <= 2:
        return np.zeros(points.shape[:2])
    velocity = np.gradient(gaussian_smooth(points, times, CONTACT_CUTOFF_HZ), times, axis=0)
    if center is None:
        return np.linalg.norm(velocity, axis=-1)
    sight = along_sight(points - np.expand_dims(center, -2))
    return np.linalg.norm(velocity - sight * (velocity * sight).sum(-1, keepdims=True), axis=-1)


def correct_depth(
    root_cam: np.ndarray, points_cam: np.ndarray, contact: np.ndarray, T_world_camera: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """(T,) metres by which to move each frame's body along its root's line of sight.

    With the ray's upward and horizontal parts g and d (world), heights h and horizontal steps s of the points,
    minimizes over δ
        Σ_t max(2 c_t − 1, 0) f_t (h_t + g_t δ_t)²/σ_h² + δ_t²/σ_δ²
        + Σ_t c_t |s_t + d_t (δ_t+1 − δ_t)|²/(σ_s Δt)² + (δ_t+1 − δ_t)²/(σ_r Δt)²,
    c_t the contact (of a step, the smaller one of its ends), f_t the share with which this height is the floor's: a
    tridiagonal system, solved in O(T).

    :param root_cam: (T, 3), about the camera's centre;  points_cam: (T, F, 3);  contact: (T, F);  times: (T,).
    """
    T = len(times)
    R, height0 = T_world_camera[:3, :3], T_world_camera[2, 3]
    ray_world = along_sight(root_cam) @ R.T
    points_world = points_cam @ R.T
    height = points_world[..., 2] + height0
    # A foot in the air, doubtful as it may be, says nothing about the floor.
    sure = np.clip(2 * contact - 1, 0, 1) * on_floor(height)
    g, d = ray_world[:, 2], ray_world[:, :2]

    diagonal = np.full(T, 1 / DEPTH_SIGMA_M**2) + sure.sum(1) * g**2 / FLOOR_SIGMA_M**2
    right = -(sure * height).sum(1) * g / FLOOR_SIGMA_M**2
    off = np.zeros(max(T - 1, 0))
    if T > 1:
        step = np.maximum(np.diff(times), 1e-6)
        pair = np.minimum(contact[1:], contact[:-1])
        moved = np.diff(points_world[..., :2], axis=0)
        along = 0.5 * (d[1:] + d[:-1])
        slide = 1 / (SLIDE_SIGMA_M_S * step) ** 2
        stiffness = 1 / (DEPTH_RATE_SIGMA * step) ** 2 + slide * pair.sum(1) * (along**2).sum(1)
        pull = slide * (pair[..., None] * moved * along[:, None]).sum((1, 2))
        diagonal[:-1] += stiffness
        diagonal[1:] += stiffness
        off -= stiffness
        right[:-1] += pull
        right[1:] -= pull
    return _solve_tridiagonal(diagonal, off, right)


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


def _solve_tridiagonal(diagonal: np.ndarray, off: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Thomas's algorithm for a symmetric positive definite tridiagonal matrix."""
    n = len(diagonal)
    c, x = np.zeros(n), np.zeros(n)
    pivot = diagonal[0]
    x[0] = right[0] / pivot
    for k in range(1, n):
        c[k - 1] = off[k - 1] / pivot
        pivot = diagonal[k] - off[k - 1] * c[k - 1]
        x[k] = (right[k] - off[k - 1] * x[k - 1]) / pivot
    for k in range(n - 2, -1, -1):
        x[k] -= c[k] * x[k + 1]
    return x


def on_floor(height: np.ndarray) -> np.ndarray:
    """The share with which a foot that stands at these heights stands on the floor, see above."""
    return _logistic(4 * (1 - np.abs(height) / LEVEL_M))


def _logistic(x: np.ndarray | float) -> np.ndarray:
    return np.asarray(1 / (1 + np.exp(-np.clip(x, -30, 30))))
