# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving a motion and its camera in the world by a rigid transform."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ....solver.rotations import exp, log
from ...motion import Motion
from ..clip import Clip


def moved_motion(motion: Motion, body: Body, transform: NDArray[np.float64]) -> Motion:
    """Move a motion and its camera in the world; what its corrections say stays as it is.

    :param transform: (4, 4) rigid.
    """
    rest = body.rest_joints(motion.betas)[0]
    changed: dict[str, Any] = {"world_from_camera": transform @ motion.world_from_camera}
    for poses, trans in (("poses", "trans"), ("poses_raw", "trans_raw")):
        changed[poses], changed[trans] = _moved(
            getattr(motion, poses), getattr(motion, trans), rest, transform
        )
    return replace(motion, **changed)


def moved_clip(clip: Clip, transform: NDArray[np.float64]) -> Clip:
    """Move a clip in the world; ``transform`` (4, 4) is rigid."""
    rotations = clip.rotations.copy()
    rotations[:, 0] = transform[:3, :3] @ rotations[:, 0]
    return Clip(clip.times, rotations, clip.root @ transform[:3, :3].T + transform[:3, 3])


def _moved(
    poses: NDArray[np.floating[Any]],
    trans: NDArray[np.floating[Any]],
    rest: NDArray[np.float64],
    transform: NDArray[np.float64],
) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]:
    """Move poses (T, 3(K+1)) and translations (T, 3) of a body whose pelvis rests at ``rest``
    (3,).
    """
    new = poses.copy()
    new[:, :3] = log(transform[:3, :3] @ exp(poses[:, :3].astype(float)))
    pelvis = (rest + trans) @ transform[:3, :3].T + transform[:3, 3]
    return new, (pelvis - rest).astype(trans.dtype)
