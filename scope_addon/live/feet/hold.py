# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet and palms that stay where they rest, without looking ahead.

Contact is estimated as offline (`standing`), from a window that ends with the newest frame. A point whose probability
exceeds `BEGIN` is held where it is then; the hold ends below `END`, or when the body has moved too far away from it. A
point that is let go approaches its own position again within `RELEASE_S`. The depth of the body follows the floor
(`ground_plane`), again within the window.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import Body, make_tree
from ...capture.world.ground_plane import correct_depth, floor_probability
from ...capture.world.placement import VISIBLE_CONFIDENCE, PlacedTrack
from ...kinematics.contact_points import (
    CONTACT_POINTS,
    FOOT_PARTS,
    SOLES,
    contact_point_positions,
    with_contact_points,
)
from ...kinematics.standing import line_of_sight, resting_probability
from .lock import LockedPoints, lock_points

WINDOW_S = 0.6
BEGIN, END = 0.5, 0.3  # probability of contact
RELEASE_S = 0.15
LONGEST_STRETCH_M = 0.15  # between a held point and where the body has it
SAME_SHAPE = 1e-3  # difference of shape coefficients below which the contact points stay the same


class FootHold:
    """Holds the contact points of one body; frames are given in order."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._betas: NDArray[np.floating[Any]] | None = None
        self._with_points, self._tree = body, make_tree(body)
        self._visible_parts = [body.joint_names.index(n) for n in (*FOOT_PARTS, "left_wrist", "right_wrist")]
        self.reset()

    def reset(self) -> None:
        """Let everything go, for the person was not seen."""
        n = len(CONTACT_POINTS)
        self._window: deque[tuple[float, NDArray[Any], NDArray[Any], NDArray[Any]]] = deque()
        self._anchors = np.zeros((n, 3))  # world
        self._is_held = np.zeros(n, bool)
        self._weight = np.zeros(n)  # 1: at the anchor; it decreases while the point is let go

    @property
    def is_holding(self) -> bool:
        """Whether a foot or palm was held in the last frame."""
        return bool(self._is_held.any())

    def hold(
        self,
        time_s: float,
        betas: NDArray[np.floating[Any]],
        rotations: NDArray[np.floating[Any]],
        root_cam: NDArray[np.floating[Any]],
        joint_confidence: NDArray[np.floating[Any]],
        T_world_camera: NDArray[np.float64],
    ) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]], NDArray[np.floating[Any]]]:
        """Return the frame's rotations (K+1, 3, 3) and pelvis (3,) with its feet held, and the contact (6,).

        :param betas: (P,) shape.
        :param rotations: (K+1, 3, 3) row 0 R_camera_root.
        :param root_cam: (3,) the pelvis, camera frame, metres.
        :param joint_confidence: (K+1,) 0..1.
        :param T_world_camera: (4, 4) the floor at z = 0.
        """
        self._set_shape(betas)
        points = self._points(betas, rotations, root_cam)
        visible = np.clip(joint_confidence[self._visible_parts] / VISIBLE_CONFIDENCE, 0.0, 1.0)
        step_s = time_s - self._window[-1][0] if self._window else 0.0
        self._window.append((time_s, root_cam, points, visible))
        while self._window[0][0] < time_s - WINDOW_S:
            self._window.popleft()
        contact, shift_m = self._contact(T_world_camera)
        root_cam = root_cam + shift_m * line_of_sight(root_cam)
        R, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
        points_world = (points + shift_m * line_of_sight(root_cam)) @ R.T + t
        targets = self._targets(points_world, contact, step_s)
        if not (self._weight > 0).any():
            return rotations, root_cam, contact
        placed = self._placed(time_s, betas, rotations, root_cam)
        lowest = min(float(targets[:, 2].min()), 0.0)
        offset = lowest * (1 - float(floor_probability(np.array(lowest)))) - float(t[2])
        held = (self._weight > 0).astype(float)
        locked = LockedPoints(((targets - t) @ R)[None], held[None], R[2], np.array([offset]))
        new_rotations, new_root = lock_points(placed, locked, self._tree)
        return new_rotations[0], new_root[0], contact

    def _set_shape(self, betas: NDArray[np.floating[Any]]) -> None:
        if self._betas is None or np.abs(betas - self._betas).max(initial=0.0) > SAME_SHAPE:
            self._betas, self._with_points = betas, with_contact_points(self._body, betas)
            self._tree = make_tree(self._with_points)

    def _points(
        self,
        betas: NDArray[np.floating[Any]],
        rotations: NDArray[np.floating[Any]],
        root_cam: NDArray[np.floating[Any]],
    ) -> NDArray[np.floating[Any]]:
        """Return the contact points (6, 3), camera frame."""
        body = self._with_points
        R, t = body.forward_kinematics(rotations, root_cam - body.rest_joints(betas)[0], betas)
        return contact_point_positions(body, R, t)

    def _contact(self, T_world_camera: NDArray[np.float64]) -> tuple[NDArray[np.floating[Any]], float]:
        """Return the contact probability (6,) of the newest frame, and by how much the body is too near, metres."""
        times = np.array([entry[0] for entry in self._window])
        root, points, visible = (np.array([entry[k] for entry in self._window]) for k in (1, 2, 3))
        contact = resting_probability(points, T_world_camera[2, :3], times, np.zeros((len(times), 3))) * visible
        shift_m = correct_depth(root, points, contact, T_world_camera, times)
        return contact[-1], float(shift_m[-1])

    def _targets(
        self, points_world: NDArray[np.floating[Any]], contact: NDArray[np.floating[Any]], step_s: float
    ) -> NDArray[np.float64]:
        """Begin and end holds; return the position (6, 3) of each point, world."""
        begins = ~self._is_held & (contact > BEGIN)
        self._anchors[begins] = points_world[begins]
        self._anchors[begins, 2] *= 1 - floor_probability(points_world[begins, 2])
        far = np.linalg.norm(points_world - self._anchors, axis=1) > LONGEST_STRETCH_M
        self._is_held = (self._is_held | begins) & (contact > END) & ~far
        change = step_s / RELEASE_S
        self._weight = np.where(self._is_held, np.minimum(self._weight + change, 1.0), self._weight - change)
        self._weight = np.maximum(self._weight, 0.0)
        weight = self._weight[:, None]
        targets: NDArray[np.float64] = points_world + weight * (self._anchors - points_world)
        return targets

    def _placed(
        self,
        time_s: float,
        betas: NDArray[np.floating[Any]],
        rotations: NDArray[np.floating[Any]],
        root_cam: NDArray[np.floating[Any]],
    ) -> PlacedTrack:
        """Return the frame as a motion of one frame."""
        nothing = np.zeros((1, 0, 3))
        return PlacedTrack(
            self._with_points,
            betas,
            np.array([time_s]),
            np.ones(1, bool),
            rotations[None],
            root_cam[None],
            nothing,
            nothing,
            np.ones((1, len(SOLES))),
            np.zeros((1, 3)),
        )
