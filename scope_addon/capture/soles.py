# SPDX-License-Identifier: GPL-3.0-or-later
"""The points of the feet that stand on the floor. Numpy alone: work on a motion in Blender needs them too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...solver.body import Body

FOOT_PARTS = ("left_ankle", "left_foot", "right_ankle", "right_foot")
SOLES = ("sole/left_heel", "sole/left_toe", "sole/right_heel", "sole/right_toe")


def with_soles(body: Body, betas: np.ndarray) -> Body:
    """The body with four more keypoints: ``sole/left_heel``, ``sole/left_toe`` and the right ones.

    Each lies on the ankle or foot part, in the middle of the part's lowest centimetre at rest, where it presses on the
    floor. Exact for these betas; the points keep their place relative to the joint for others.
    """
    v, J = body.rest_vertices(betas), body.rest_joints(betas)
    strongest = body.skin_joints[np.arange(len(v)), body.skin_weights.argmax(1)]
    parts = np.array([body.joint_names.index(name) for name in FOOT_PARTS], np.int32)
    local = np.zeros((len(parts), 3))
    for k, part in enumerate(parts):
        own = v[strongest == part] if (strongest == part).any() else J[part : part + 1]
        sole = own[own[:, 1] <= own[:, 1].min() + 0.01].mean(0)
        sole[1] = own[:, 1].min()
        local[k] = sole - J[part]
    return replace(
        body,
        keypoint_names=(*body.keypoint_names, *SOLES),
        keypoint_part=np.concatenate([body.keypoint_part, parts]),
        keypoint_template=np.concatenate([body.keypoint_template, body.J_template[parts] + local]),
        keypoint_shapedirs=np.concatenate([body.keypoint_shapedirs, body.J_shapedirs[parts]]),
    )


def sole_points(body_with_soles: Body, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """(T, 4, 3) the soles of ``with_soles``'s body.

    :param R, t: (T, K+1, 3, 3), (T, K+1, 3) part poses in any frame; the result is in that frame.
    """
    return body_with_soles.keypoints(R, t, which=slice(-len(SOLES), None))
