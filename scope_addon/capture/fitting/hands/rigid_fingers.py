# SPDX-License-Identifier: GPL-3.0-or-later
"""The body without its fingers, for people of whom no hand is seen in the whole clip.

What a clip costs to fit grows with the cube of the number of joints that are fitted together, and 30 of the 51 joints
of a body with fingers are theirs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .....solver import Body
from ...perception.hand_region import SIDES
from .hand_measurements import finger_names


def without_fingers(body: Body) -> Body:
    """Return a body whose fingers are rigid parts of its palms, in the rest pose; the body itself if it has none.

    Keypoints, vertices and their numbers stay as they are.
    """
    fingers = {name for side in SIDES for name in finger_names(side)}
    kept = [k for k, name in enumerate(body.joint_names) if name not in fingers]
    if len(kept) == len(body.joint_names):
        return body
    part = np.zeros(len(body.joint_names), np.intp)  # of the body without fingers that carries each part
    for k, parent in enumerate(body.parents):
        part[k] = kept.index(k) if k in kept else part[parent]
    return replace(
        body,
        joint_names=tuple(body.joint_names[k] for k in kept),
        parents=np.array([-1 if k == 0 else part[body.parents[k]] for k in kept], np.int32),
        J_template=body.J_template[kept],
        J_shapedirs=body.J_shapedirs[kept],
        skin_joints=part[body.skin_joints].astype(body.skin_joints.dtype),
        keypoint_part=part[body.keypoint_part].astype(body.keypoint_part.dtype),
    )
