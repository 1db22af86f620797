# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a pinned joint can follow its pin.

A pin that is farther away than the limb is long would otherwise be met by moving the whole body. So
the pin is moved towards the limb's first joint, on the straight line, until the stretched limb and
a small slack reach it. The slack is what shoulder girdle, trunk and pelvis may add. Pins of the
pelvis and the hips are not limited: they move the body.

A pin of the pelvis in the image keeps the person at their depth. Were the depth free, the body
could meet a pin below the pelvis by moving away from a camera that is lower than it, rather than by
bending the knees.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .pose_refit import PoseRefit, limb_of
from .rays import Camera, nearest_on_ray, pixel_of, point_at_depth

SLACK_M = 0.03
_MOVES_BODY = ("pelvis", "left_hip", "right_hip")


def within_reach(
    refit: PoseRefit,
    joint: str,
    target: NDArray[np.float64],
    places: tuple[NDArray[np.float64], Mapping[str, NDArray[np.float64]]],
    camera: Camera | None,
    slack: float = SLACK_M,
) -> NDArray[np.float64]:
    """Return where a pin can be met: the pin itself, or a place on the way to it.

    :param target: (3,) metres in the world, or (2,) pixels.
    :param places: the joints before the correction (K+1, 3), world, and other joints that are
        pinned in space, (3,).
    :param camera: world_from_camera (4, 4) and intrinsics (3, 3), for a target in pixels.
    :param slack: metres that may be added to the limb's length.
    :return: the place in the form of ``target``; for the pelvis always (3,).
    """
    at, pinned = places
    if joint == "pelvis" and len(target) == 2 and camera is not None:
        return point_at_depth(camera, target, at[refit.joint(joint)])
    if joint in _MOVES_BODY:
        return target
    first, reach = _first_joint(refit, joint, pinned)
    origin = pinned.get(first, at[refit.joint(first)])
    nearest = (
        target if len(target) == 3 or camera is None else nearest_on_ray(camera, target, origin)
    )
    distance = float(np.linalg.norm(nearest - origin))
    if distance <= reach + slack:
        return target
    place: NDArray[np.float64] = origin + (nearest - origin) * ((reach + slack) / distance)
    return place if len(target) == 3 or camera is None else pixel_of(camera, place)


def _first_joint(
    refit: PoseRefit, joint: str, pinned: Mapping[str, NDArray[np.float64]]
) -> tuple[str, float]:
    """Return the joint that a limb turns about, or a pinned one nearer to its end, and the limb's
    length from there.
    """
    rest = refit.body.rest_joints(refit.betas)
    parents = refit.body.parents
    side = joint.partition("_")[0]
    ends = {f"{side}_arm": f"{side}_shoulder", f"{side}_leg": f"{side}_hip"}
    root = (
        "pelvis" if joint.endswith(("shoulder", "collar")) else ends.get(limb_of(joint), "pelvis")
    )
    part = refit.joint(joint)
    length = 0.0
    while True:
        parent = int(parents[part])
        length += float(np.linalg.norm(rest[part] - rest[parent]))
        part = parent
        if part == 0 or refit.names[part] == root or refit.names[part] in pinned:
            return refit.names[part], length
