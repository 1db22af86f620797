# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame fitted once more with feet and palms locked where they rest.

The motion is the fit's prior, and the projection of that motion its measurement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from ....solver.compiled.tree import Tree
from ....solver.rotations import shortest_turn
from ...capture.fitting.frame_measurements import NEAREST_M
from ...capture.world.placement import PlacedTrack
from ...kinematics.contact_points import CONTACT_POINTS, SOLES
from ...kinematics.frame_blocks import by_blocks

PICTURE_SIGMA_M = 0.003  # by how much locking may move a keypoint in the image, at the person's distance
MIN_CONTACT = 0.05  # contact probability from which on a frame is fitted again
_SIDED = ("shoulder", "elbow", "wrist", "hip", "knee")
_VISIBLE = ("nose", *(f"{side}_{name}" for side in ("left", "right") for name in _SIDED))
_WRISTS = np.array([_VISIBLE.index(f"{side}_wrist") for side in ("left", "right")])

# Standard deviations: a locked foot 5 mm, a sole below the floor 2 cm, the pelvis 2 cm and half a degree, every joint
# two degrees, projected keypoints 3 mm across the line of sight. Softer legs follow every error of a sole: with ten
# times these deviations, knees and ankles are 1 to 2 mm worse on footage and renders with ground truth, and feet slide
# no less. If the pelvis is fixed to 5 mm in every direction and the projections are left out, the whole body moves off
# the footage by 2 cm where the floor is wrong.
_WEIGHTS = Weights(
    foot_contact=1 / 0.005**2,
    floor=1 / 0.02**2,
    keypoints2d=1.0,
    joint_prior=1 / 0.03**2,
    joint_limits=2000.0,
    shape=1.0,
)


@dataclass(frozen=True)
class LockedPoints:
    """Locked positions of soles and palms, and the plane that none of them goes below; camera frame, metres."""

    positions: NDArray[np.floating[Any]]  # (T, 6, 3)
    weights: NDArray[np.floating[Any]]  # (T, 6) 0..1
    floor_normal: NDArray[np.floating[Any]]  # (3,) unit, upwards
    floor_offset: NDArray[np.floating[Any]]  # (T,) normal . p on the floor


def lock_points(
    placed: PlacedTrack, locked: LockedPoints, tree: Tree | None = None
) -> tuple[NDArray[np.floating[Any]], NDArray[np.float64]]:
    """Fit each frame once more with locked points above a floor; everything else stays close to the given motion.

    The projections of head, arms, hips and knees keep their positions, except for wrists whose palms are locked. The
    body therefore moves along the line of sight, the least certain direction, rather than across it. Each frame is
    fitted in the axes of a camera that looks straight at the pelvis.

    :param tree: of the motion's body, if it was made already.
    :return: rotations (T, K+1, 3, 3) and root positions (T, 3), camera frame.
    """
    frames = _LockedFrames(placed, locked, tree or make_tree(placed.body))
    rotations, root = placed.rotations.copy(), np.array(placed.root, float)
    for t in np.flatnonzero(locked.weights.max(1) > MIN_CONTACT):
        turn, found = frames.turns[t], frames.fit(t)
        rotations[t, 0], rotations[t, 1:] = turn.T @ found.R_camera_root, found.Omega
        root[t] = turn.T @ found.t_camera_root + placed.center[t]
    return rotations, root


class _LockedFrames:
    """The single-frame problems of `lock_points`."""

    def __init__(self, placed: PlacedTrack, locked: LockedPoints, tree: Tree) -> None:
        body = placed.body
        self._placed, self._locked = placed, locked
        self._tree = tree
        self._contact_points = np.arange(len(body.keypoint_names) - len(CONTACT_POINTS), len(body.keypoint_names))
        self._visible = [body.keypoint_set("blazepose")[name] for name in _VISIBLE]
        self._points = _keypoints(body, placed, self._visible)
        self._priors = replace(
            default_priors(body),
            shape_mean=placed.betas,
            shape_information=np.eye(body.P) * 1e8,
            joint_weights=np.ones(body.K),
        )
        self._options = Options(stages=(Stage(_WEIGHTS, 1e-3, 8),))
        self.turns = shortest_turn(placed.root - placed.center, np.array([0.0, 0.0, 1.0]))

    def fit(self, t: int) -> State:
        """Fit frame ``t`` in the axes of a camera that looks straight at the pelvis."""
        placed, turn = self._placed, self.turns[t]
        root = turn @ (placed.root[t] - placed.center[t])
        state = State(turn @ placed.rotations[t, 0], root, placed.rotations[t, 1:], placed.betas)
        priors: Priors = replace(self._priors, joint_mean=placed.rotations[t, 1:])
        return fit_tree(self._tree, self._measure(t, state), state, priors, self._options).state

    def _measure(self, t: int, state: State) -> Measurements:
        placed, locked, turn = self._placed, self._locked, self.turns[t]
        center, root = placed.center[t], state.t_camera_root
        local = (self._points[t] - center) @ turn.T
        information = np.full(len(self._visible), np.square(root[2] / PICTURE_SIGMA_M))
        information[_WRISTS] *= 1 - locked.weights[t, len(SOLES) :]
        offset = float(locked.floor_offset[t] - locked.floor_normal @ center)
        # Contacts determine where a sole is; the floor only where it cannot be.
        no_contact = np.zeros(len(self._contact_points))
        pelvis, turn_weight, place_weight = np.zeros(1, int), np.array([1 / 0.01**2]), np.array([1 / 0.02**2])
        return Measurements(
            intrinsics=np.eye(3),
            keypoints2d=Keypoints2D(self._visible, local[:, :2] / np.maximum(local[:, 2:], NEAREST_M), information),
            foot_contacts=FootContacts(
                self._contact_points, (locked.positions[t] - center) @ turn.T, locked.weights[t]
            ),
            floor=Floor(self._contact_points, turn @ locked.floor_normal, offset, no_contact),
            pose_priors=PosePriors(pelvis, state.R_camera_root[None], root[None], turn_weight, place_weight),
        )


def _keypoints(body: Body, placed: PlacedTrack, which: list[int]) -> NDArray[np.floating[Any]]:
    """Return the (T, n, 3) keypoints with these indices, camera frame."""
    pelvis_at_rest = body.rest_joints(placed.betas)[0]

    def keypoints(
        rotations: NDArray[np.floating[Any]], root: NDArray[np.floating[Any]]
    ) -> tuple[NDArray[np.floating[Any]]]:
        R, t = body.forward_kinematics(rotations, root - pelvis_at_rest, placed.betas)
        return (body.keypoints(R, t, placed.betas, which),)

    return by_blocks(keypoints, placed.rotations, placed.root)[0]
