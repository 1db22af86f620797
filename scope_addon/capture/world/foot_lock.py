# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet and palms locked where they rest on the floor.

After the depth is corrected (``ground_plane``), the sliding that is left is removed: each frame is fitted once
more with the standing feet held at one place, the same solver, the smoothed motion as its prior, and its projection as
measurements. Palms that rest on the floor are treated as soles are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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
from ...kinematics.contact_points import CONTACT_POINTS, SOLES
from ...kinematics.frame_blocks import by_blocks
from ...kinematics.smoothing import smooth_rotations
from ...kinematics.standing import line_of_sight
from ..fitting.frame_measurements import NEAREST_M
from .ground_plane import correct_depth, on_floor
from .placement import PlacedTrack

PICTURE_SIGMA_M = 0.003  # by how much held feet may move a keypoint in the picture, at the person's distance
# Low-pass that rounds off the steps where a lock begins or ends: of the limbs that are locked, and of all other joints.
STEP_CUTOFF_HZ = 8.0
REST_CUTOFF_HZ = 12.0
LEAST_WEIGHT = 0.05  # of a frame whose feet are locked at all
_SIDED = ("shoulder", "elbow", "wrist", "hip", "knee")
_SEEN = ("nose", *(f"{side}_{name}" for side in ("left", "right") for name in _SIDED))
_LEG, _ARM = ("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")
_AT_WRISTS = np.array([_SEEN.index(f"{side}_wrist") for side in ("left", "right")])

# Standard deviations: a standing foot 5 mm, a sole below the floor 2 cm, the pelvis 2 cm and half a degree, every joint
# two degrees, what is seen 3 mm across the line of sight. Softer legs follow every error of a sole: with ten times the
# freedom, knees and ankles are 1 to 2 mm worse on footage and renders with known truth, and feet slide no less. With
# the pelvis held to 5 mm in every direction and nothing else seen, the whole body leaves the footage by 2 cm where the
# floor is wrong.
_HOLD = Weights(
    foot_contact=1 / 0.005**2,
    floor=1 / 0.02**2,
    keypoints2d=1.0,
    joint_prior=1 / 0.03**2,
    joint_limits=2000.0,
    shape=1.0,
)


@dataclass(frozen=True)
class LockedPoints:
    """Where soles and palms are held, and the plane that none of them goes below; camera frame, metres."""

    positions: np.ndarray  # (T, 6, 3)
    weights: np.ndarray  # (T, 6) 0..1
    floor_normal: np.ndarray  # (3,) unit, upwards
    floor_offset: np.ndarray  # (T,) normal . p on the floor


def lock_feet(placed: PlacedTrack, contact: np.ndarray, T_world_camera: np.ndarray) -> PlacedTrack:
    """Correct the depth of a smoothed motion by the floor, and lock standing feet and resting palms.

    :param contact: (T, 6) probability that each sole and palm rests on something.
    :param T_world_camera: (4, 4) camera to world, this person's floor at z = 0.
    :return: the motion with other rotations and root; joints and contact points are still those of the given motion.
    """
    rotations, root = placed.rotations, placed.root
    contact_points = placed.place(rotations, root)[1]
    away = correct_depth(root - placed.center, contact_points, contact, T_world_camera, placed.times)
    root = root + away[:, None] * line_of_sight(root - placed.center)
    locked = _locked_points(placed.place(rotations, root)[1], contact, T_world_camera)
    rotations, root = lock_points(replace(placed, root=root), locked)
    names = placed.body.joint_names
    holding = _LEG + _ARM if (contact[:, len(SOLES) :] > 0.5).any() else _LEG
    holds = np.array([k == 0 or any(part in name for part in holding) for k, name in enumerate(names)])
    for joints, cutoff_hz in ((holds, STEP_CUTOFF_HZ), (~holds, REST_CUTOFF_HZ)):
        rotations[:, joints] = smooth_rotations(rotations[:, joints], placed.times, cutoff_hz)
    return replace(placed, rotations=rotations, root=root)


def _locked_points(contact_points: np.ndarray, contact: np.ndarray, T_world_camera: np.ndarray) -> LockedPoints:
    """Hold each support where it stands; far below the floor, on a stair down, there is no floor.

    :param contact_points, contact: (T, 6, 3) in the camera frame, metres, and (T, 6).
    """
    R, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
    held = anchors(contact_points @ R.T + t, contact)
    lowest = np.minimum(held[..., 2].min(axis=1), 0.0)
    return LockedPoints((held - t) @ R, contact, R[2], lowest * (1 - on_floor(lowest)) - float(t[2]))


def lock_points(placed: PlacedTrack, locked: LockedPoints) -> tuple[np.ndarray, np.ndarray]:
    """Fit each frame once more with points held above a floor, everything else staying at the given motion.

    The projections of head, arms, hips and knees stay where they were, except for wrists whose palms are held: the
    body gives way along the line of sight, the least certain direction, rather than across it. Each frame is fitted in
    the axes of a camera that looks straight at the pelvis.

    :return: rotations (T, K+1, 3, 3) and root positions (T, 3), camera frame.
    """
    frames = _LockedFrames(placed, locked)
    rotations, root = placed.rotations.copy(), np.array(placed.root, float)
    for t in np.flatnonzero(locked.weights.max(1) > LEAST_WEIGHT):
        turn, found = frames.turns[t], frames.fit(t)
        rotations[t, 0], rotations[t, 1:] = turn.T @ found.R_camera_root, found.Omega
        root[t] = turn.T @ found.t_camera_root + placed.center[t]
    return rotations, root


class _LockedFrames:
    """The single-frame problems of `lock_points`."""

    def __init__(self, placed: PlacedTrack, locked: LockedPoints) -> None:
        body = placed.body
        self._placed, self._locked = placed, locked
        self._tree = make_tree(body)
        self._supports = np.arange(len(body.keypoint_names) - len(CONTACT_POINTS), len(body.keypoint_names))
        self._seen = [body.keypoint_set("blazepose")[name] for name in _SEEN]
        self._points = _keypoints(body, placed, self._seen)
        self._priors = replace(
            default_priors(body),
            shape_mean=placed.betas,
            shape_information=np.eye(body.P) * 1e8,
            joint_weights=np.ones(body.K),
        )
        self._options = Options(stages=(Stage(_HOLD, 1e-3, 8),))
        self.turns = shortest_turn(placed.root - placed.center, np.array([0.0, 0.0, 1.0]))

    def fit(self, t: int) -> State:
        """Solve frame ``t`` in the axes of a camera that looks straight at the pelvis."""
        placed, turn = self._placed, self.turns[t]
        root = turn @ (placed.root[t] - placed.center[t])
        state = State(turn @ placed.rotations[t, 0], root, placed.rotations[t, 1:], placed.betas)
        priors: Priors = replace(self._priors, joint_mean=placed.rotations[t, 1:])
        return fit_tree(self._tree, self._measure(t, state), state, priors, self._options).state

    def _measure(self, t: int, state: State) -> Measurements:
        placed, locked, turn = self._placed, self._locked, self.turns[t]
        center, root = placed.center[t], state.t_camera_root
        ahead = (self._points[t] - center) @ turn.T
        certain = np.full(len(self._seen), np.square(root[2] / PICTURE_SIGMA_M))
        certain[_AT_WRISTS] *= 1 - locked.weights[t, len(SOLES) :]
        offset = float(locked.floor_offset[t] - locked.floor_normal @ center)
        # Contact decides where a sole is; the floor only where none can be.
        unweighted = np.zeros(len(self._supports))
        pelvis, turn_weight, place_weight = np.zeros(1, int), np.array([1 / 0.01**2]), np.array([1 / 0.02**2])
        return Measurements(
            intrinsics=np.eye(3),
            keypoints2d=Keypoints2D(self._seen, ahead[:, :2] / np.maximum(ahead[:, 2:], NEAREST_M), certain),
            foot_contacts=FootContacts(self._supports, (locked.positions[t] - center) @ turn.T, locked.weights[t]),
            floor=Floor(self._supports, turn @ locked.floor_normal, offset, unweighted),
            pose_priors=PosePriors(pelvis, state.R_camera_root[None], root[None], turn_weight, place_weight),
        )


def _keypoints(body: Body, placed: PlacedTrack, which: list[int]) -> np.ndarray:
    """(T, n, 3) keypoints of these numbers, camera frame."""
    at_rest = body.rest_joints(placed.betas)[0]

    def shown(rotations: np.ndarray, root: np.ndarray) -> tuple[np.ndarray]:
        R, t = body.forward_kinematics(rotations, root - at_rest, placed.betas)
        return (body.keypoints(R, t, placed.betas, which),)

    return by_blocks(shown, placed.rotations, placed.root)[0]


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
