# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet and palms that stay where they rest, without looking ahead.

Contact is estimated as offline (`standing`), from a window that ends with the newest frame, and from the speed at which
heels and toes move in the image, which no fit can hold back. A point whose probability exceeds `BEGIN` is held where it
is then; the hold ends below `END`, or when the body has moved too far away from it. The next frame is fitted to these
places and to the floor (`Support`), from which the distance of the body follows. The legs then bridge what smoothing
has left between held feet and their places: they bend, and the rest of the body stays. A foot that is let go approaches
its own position again within `RELEASE_S`.

The places drift towards where the fits have the points, because an error in where a hold began would otherwise tilt the
body for as long as it lasts: fast while size and floor are being estimated, slowly afterwards.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import Body
from ...capture.world.ground_plane import floor_probability
from ...capture.world.placement import VISIBLE_CONFIDENCE
from ...kinematics.contact_points import (
    CONTACT_POINTS,
    FOOT_PARTS,
    SOLES,
    contact_point_positions,
    with_contact_points,
)
from ...kinematics.leg_reach import move_feet
from ...kinematics.standing import CONTACT_SPEED_M_S, logistic, resting_probability, speed_across
from ..causal_fit import SAME_SHAPE, FittedFrame
from .support import Support

WINDOW_S = 0.6
BEGIN, END = 0.5, 0.3  # probability of contact
RELEASE_S = 0.15
LONGEST_STRETCH_M = 0.15  # between a held point and where the body has it
EARLY_DRIFT_S, DRIFT_S = 0.5, 3.0  # time constants of the places, while the estimates settle and afterwards


@dataclass(frozen=True)
class _Entry:
    """One frame of the window."""

    time_s: float
    points: NDArray[np.floating[Any]]  # (6, 3) camera frame, metres
    visible: NDArray[np.floating[Any]]  # (6,) 0..1
    rays: NDArray[np.floating[Any]]  # (4, 2) where the image shows the soles, normalized image coordinates


class FootHold:
    """Holds the contact points of one body; frames are given in order."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._betas: NDArray[np.floating[Any]] | None = None
        self._with_points = body
        self._visible_parts = [body.joint_names.index(n) for n in (*FOOT_PARTS, "left_wrist", "right_wrist")]
        self.reset()

    def reset(self) -> None:
        """Let everything go, for the person was not seen."""
        n = len(CONTACT_POINTS)
        self._window: deque[_Entry] = deque()
        self._anchors = np.zeros((n, 3))  # world
        self._is_held = np.zeros(n, bool)
        self._weight = np.zeros(n)  # 1: at the anchor; it decreases while the point is let go
        self._probability: NDArray[np.floating[Any]] = np.zeros(n)

    @property
    def is_holding(self) -> bool:
        """Whether a foot or palm was held in the last frame."""
        return bool(self._is_held.any())

    def support(self, T_world_camera: NDArray[np.float64]) -> Support | None:
        """Return what the body stands on in the next frame; None before the first.

        :param T_world_camera: (4, 4) the floor at z = 0.
        """
        if not self._window:
            return None
        R, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
        on_floor = self._probability * floor_probability(self._window[-1].points @ R[2] + t[2])
        return Support((self._anchors - t) @ R, self._is_held * self._probability, on_floor, R[2], -float(t[2]))

    def hold(
        self,
        time_s: float,
        betas: NDArray[np.floating[Any]],
        frame: FittedFrame,
        T_world_camera: NDArray[np.float64],
        is_settled: bool,
    ) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]:
        """Return the frame's rotations (K+1, 3, 3) with its feet held, and the contact (6,).

        :param betas: (P,) shape.
        :param frame: smoothed.
        :param T_world_camera: (4, 4) the floor at z = 0.
        :param is_settled: whether size and floor are no longer being estimated.
        """
        self._set_shape(betas)
        body, pelvis_at_rest = self._with_points, self._with_points.rest_joints(betas)[0]
        R_parts, t_parts = body.forward_kinematics(frame.rotations, frame.root_cam - pelvis_at_rest, betas)
        points = contact_point_positions(body, R_parts, t_parts)
        visible = np.clip(frame.joint_confidence[self._visible_parts] / VISIBLE_CONFIDENCE, 0.0, 1.0)
        step_s = time_s - self._window[-1].time_s if self._window else 0.0
        self._window.append(_Entry(time_s, points, visible, frame.soles))
        while self._window[0].time_s < time_s - WINDOW_S:
            self._window.popleft()
        self._probability = self._contact(T_world_camera[2, :3])
        R, t = T_world_camera[:3, :3], T_world_camera[:3, 3]
        points_world = points @ R.T + t
        self._update(points_world, step_s, DRIFT_S if is_settled else EARLY_DRIFT_S)
        shift = self._shift(points_world) @ R
        poses = R_parts[None], t_parts[None]
        return move_feet(body, frame.rotations[None], poses, shift[None])[0], self._probability

    def _set_shape(self, betas: NDArray[np.floating[Any]]) -> None:
        if self._betas is None or np.abs(betas - self._betas).max(initial=0.0) > SAME_SHAPE:
            self._betas, self._with_points = betas, with_contact_points(self._body, betas)

    def _contact(self, up: NDArray[np.float64]) -> NDArray[np.floating[Any]]:
        """Return the contact probability (6,) of the newest frame.

        :param up: (3,) unit vector, camera frame.
        """
        times = np.array([entry.time_s for entry in self._window])
        points, visible, rays = (
            np.array([getattr(entry, name) for entry in self._window]) for name in ("points", "visible", "rays")
        )
        contact: NDArray[np.floating[Any]] = resting_probability(points, up, times, np.zeros((len(times), 3)))[-1]
        contact *= visible[-1]
        # Depth is left out: a mean one turns the motion in the image into metres.
        seen = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=2)
        seen *= points[:, : len(SOLES), 2].mean(axis=0)[:, None]
        contact[: len(SOLES)] *= logistic(4 * (1 - speed_across(seen, times, None)[-1] / CONTACT_SPEED_M_S))
        return contact

    def _update(self, points_world: NDArray[np.floating[Any]], step_s: float, drift_s: float) -> None:
        """Begin and end holds, and move their places."""
        contact = self._probability
        share = (1 - np.exp(-step_s / drift_s)) * (contact > END)
        self._anchors[:, :2] += share[:, None] * (points_world - self._anchors)[:, :2]
        begins = ~self._is_held & (contact > BEGIN)
        new = begins & (self._weight <= 0)  # one that was just let go returns to its place
        self._anchors[new] = points_world[new]
        self._anchors[new, 2] *= 1 - floor_probability(points_world[new, 2])
        far = np.linalg.norm(points_world - self._anchors, axis=1) > LONGEST_STRETCH_M
        self._is_held = (self._is_held | begins) & (contact > END) & ~far
        change = step_s / RELEASE_S
        self._weight = np.where(self._is_held, np.minimum(self._weight + change, 1.0), self._weight - change)
        self._weight = np.maximum(self._weight, 0.0)

    def _shift(self, points_world: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
        """Return by how much each foot moves (2, 3), world: to where it is held, and never below the floor."""
        feet = points_world[: len(SOLES)].reshape(2, 2, 3)
        away = (self._anchors - points_world)[: len(SOLES)].reshape(2, 2, 3)
        weight = self._weight[: len(SOLES)].reshape(2, 2, 1)
        smooth = weight * weight * (3 - 2 * weight)
        shift: NDArray[np.float64] = (weight * smooth * away).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-9)
        lowest = (feet[..., 2] + shift[:, None, 2]).min(axis=1)
        shift[:, 2] -= np.minimum(lowest, 0.0) * floor_probability(np.minimum(lowest, 0.0))
        return shift
