# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses at the times of their source's frames and in one shape, from poses that smoothing has
delayed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import Body
from ....solver.rotations import exp, log
from ...kinematics.contact_points import SOLES, contact_point_positions, with_contact_points
from ..pose import LivePose

_SAME_TIME_S = 1e-3
_SAME_SHAPE = 0.01


def at_frames(poses: Sequence[LivePose], delay_s: float) -> list[LivePose]:
    """Return the poses that the body had in their frames.

    Each given pose is that of a time ``delay_s`` before its frame. At the time of a frame, the pose
    lies between two of them; what was measured in the frame stays. The last frames, whose poses
    would have been given later, are left out.

    :param poses: in the order of their frames, at least one.
    :return: at least one.
    """
    times = np.array([pose.timestamp_s for pose in poses])
    given_at = times - delay_s
    count = max(int(np.searchsorted(times, given_at[-1] + _SAME_TIME_S)), 1)
    after = np.minimum(np.searchsorted(given_at, times[:count] - _SAME_TIME_S), len(poses) - 1)
    return [_between(poses, k, int(after[k]), times[k] - given_at) for k in range(count)]


def _between(poses: Sequence[LivePose], k: int, after: int, since: NDArray[np.float64]) -> LivePose:
    """Return the pose in frame ``k``, before which ``poses[after - 1]`` was given, and
    ``poses[after]`` was not.

    :param since: (n,) seconds since each given pose.
    """
    later = poses[after]
    earlier = poses[max(after - 1, 0)]
    span = float(since[max(after - 1, 0)] - since[after])
    share = float(np.clip(since[max(after - 1, 0)] / span, 0.0, 1.0)) if span > 0 else 1.0
    # In the world, which may have moved between the two.
    R = later.T_world_camera[:3, :3]
    t = later.T_world_camera[:3, 3]
    R_earlier = earlier.T_world_camera[:3, :3]
    t_earlier = earlier.T_world_camera[:3, 3]
    before = earlier.rotations.copy()
    before[0] = R.T @ R_earlier @ before[0]
    root_before = (R_earlier @ earlier.root_cam + t_earlier - t) @ R
    turn = log(np.swapaxes(before, 1, 2) @ later.rotations)
    return replace(
        poses[k],
        betas=later.betas,
        rotations=before @ exp(share * turn),
        root_cam=root_before + share * (later.root_cam - root_before),
        T_world_camera=later.T_world_camera,
        joints=earlier.joints + share * (later.joints - earlier.joints),
        contact=earlier.contact + share * (later.contact - earlier.contact),
    )


def in_last_shape(poses: Sequence[LivePose], body: Body) -> list[LivePose]:
    """Return the poses in the shape of the last one, raised or lowered so that their lowest sole
    stays where it was.
    """
    final = poses[-1].betas
    out = []
    for pose in poses:
        if np.abs(pose.betas - final).max(initial=0.0) > _SAME_SHAPE:
            rise = _lowest_sole(body, pose, pose.betas) - _lowest_sole(body, pose, final)
            pose = replace(
                pose, betas=final, root_cam=pose.root_cam + rise * pose.T_world_camera[2, :3]
            )
        out.append(pose)
    return out


def _lowest_sole(body: Body, pose: LivePose, betas: NDArray[np.floating[Any]]) -> float:
    """Return the height of the lowest sole of a pose in a shape, relative to the camera, metres."""
    with_points = with_contact_points(body, betas)
    R, t = with_points.forward_kinematics(
        pose.rotations, pose.root_cam - with_points.rest_joints(betas)[0], betas
    )
    return float(
        (
            contact_point_positions(with_points, R, t)[: len(SOLES)] @ pose.T_world_camera[2, :3]
        ).min()
    )
