# SPDX-License-Identifier: GPL-3.0-or-later
"""How the motion of a live capture differs from the offline one of the same footage; rows are
matched by frame number.

Frames that a live capture has dropped are filled in between poses, and say nothing of it: only the
frames that both motions contain and in which both are valid count.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.contact_points import (
    SOLES,
    contact_point_positions,
    with_contact_points,
)
from ...scope_addon.motion import Motion
from ...solver import Body, rotations

Rows = NDArray[np.intp]


def common_rows(live: Motion, offline: Motion) -> tuple[Rows, Rows]:
    """Return the rows (n,) of both motions that count."""
    _, ours, theirs = np.intersect1d(live.frames, offline.frames, return_indices=True)
    both = live.valid[ours] & offline.valid[theirs]
    return ours[both], theirs[both]


def world_joints(motion: Motion) -> NDArray[np.float64]:
    """Return the joints (T, K+1, 3) in the world, whose camera may move, metres."""
    T = motion.world_from_camera
    joints: NDArray[np.float64] = (
        np.einsum("tij,tkj->tki", T[:, :3, :3], motion.joints_cam) + T[:, None, :3, 3]
    )
    return joints


def seen_from_the_world(motion: Motion) -> Motion:
    """Return the motion as seen by a camera at the world's origin, in which feet slide as they do
    in the world.
    """
    return replace(
        motion,
        joints_cam=world_joints(motion),
        world_from_camera=np.tile(np.eye(4), (len(motion), 1, 1)),
    )


def jerk(joints: NDArray[np.floating[Any]], times_s: NDArray[np.floating[Any]]) -> float:
    """Return the mean length of the third derivative of joints over time, m/s³.

    By divided differences, d³x/dt³ = 6 x[t_k, t_k+1, t_k+2, t_k+3], since frames may be missing.

    :param joints: (n, J, 3).
    :param times_s: (n,), at least four.
    """
    x = joints
    for order in (1, 2, 3):
        x = np.diff(x, axis=0) / (times_s[order:] - times_s[:-order])[:, None, None]
    return float(6 * np.linalg.norm(x, axis=-1).mean())


def lowest_sole_m(motion: Motion, rows: Rows, body: Body) -> float:
    """Return the height of the lowest point of the soles over the floor in some rows, metres."""
    with_points = with_contact_points(body, motion.betas)
    lowest = np.inf
    for row in rows:
        R = rotations.exp(motion.poses[row].reshape(-1, 3).astype(float))
        R_parts, t_parts = with_points.forward_kinematics(
            R, motion.trans[row].astype(float), motion.betas
        )
        lowest = min(
            lowest, contact_point_positions(with_points, R_parts, t_parts)[: len(SOLES), 2].min()
        )
    return float(lowest)


def compared(live: Motion, offline: Motion, body: Body) -> dict[str, float]:
    """Return the measures of two motions of the same footage; lengths in millimetres.

    ``difference``: median over frames and joints of how far the joints are apart relative to the
    pelvis, camera axes; ``jitter``, ``jitter_world``: jerk of the live motion over that of the
    offline one, relative to the pelvis and in the world; ``lowest_sole``: of the live motion.
    """
    ours, theirs = common_rows(live, offline)
    times = live.timestamps[ours]
    relative = [
        m.joints_cam[rows] - m.joints_cam[rows][:, :1]
        for m, rows in ((live, ours), (offline, theirs))
    ]
    world = [world_joints(m)[rows] for m, rows in ((live, ours), (offline, theirs))]
    return {
        "frames": len(ours),
        "difference": 1e3 * float(np.median(np.linalg.norm(relative[0] - relative[1], axis=-1))),
        "jitter": jerk(relative[0], times) / jerk(relative[1], times),
        "jitter_world": jerk(world[0], times) / jerk(world[1], times),
        "lowest_sole": 1e3 * lowest_sole_m(live, ours, body),
    }
