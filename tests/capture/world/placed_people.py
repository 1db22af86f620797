# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions in the first frame's camera axes, of people who are visible in every frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scope.scope_addon.capture.world.placement import PlacedTrack
from scope.scope_addon.kinematics.contact_points import contact_point_positions, with_contact_points
from scope.solver.body import Body
from scope.solver.body_file import load_body
from scope.solver.rotations import exp

UP = np.array([0.0, -1.0, 0.0])  # OpenCV's axes, a level camera
TRUTH = np.array([0.3, 1.2, 4.0])  # a pelvis, seen from above


def placed_track(
    body: Body, R: np.ndarray, joints: np.ndarray, rotations: np.ndarray | None = None
) -> PlacedTrack:
    """The motion of part rotations (T, K+1, 3, 3) and joints (T, K+1, 3), 30 frames per second.

    :param rotations: (T, K+1, 3, 3) relative to the parents, where they matter.
    """
    T = len(joints)
    supported = with_contact_points(body, np.zeros(body.P))
    return PlacedTrack(
        supported,
        np.zeros(body.P),
        np.arange(T) / 30,
        np.ones(T, bool),
        R if rotations is None else rotations,
        joints[:, 0],
        joints,
        contact_point_positions(supported, R, joints),
        np.ones((T, 6)),
        np.zeros((T, 3)),
    )


def bent(body: Body, degrees: dict[str, float]) -> np.ndarray:
    """The rotations (K+1, 3, 3) of a body both of whose hips, knees and so on are bent about x."""
    omega = np.tile(np.eye(3), (body.K + 1, 1, 1))
    for name, angle in degrees.items():
        for side in ("left", "right"):
            omega[body.joint_names.index(f"{side}_{name}")] = exp(np.radians([angle, 0, 0]))
    return omega


def first_frame(placed: PlacedTrack) -> PlacedTrack:
    """The motion of its first frame alone."""
    of_frames = (
        *("times", "valid", "rotations", "root", "joints"),
        *("contact_points", "contact_points_visible", "center"),
    )
    return replace(placed, **{name: getattr(placed, name)[:1] for name in of_frames})


def stands_at(root: np.ndarray, T: int = 30) -> PlacedTrack:
    """The body in rest pose at (3,), in front of a static camera."""
    body = load_body("scope")
    rotations = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    rotations[:, 0] = exp([np.pi, 0.0, 0.0])
    return placed_track(body, *body.forward_kinematics(rotations, np.tile(root, (T, 1))), rotations)
