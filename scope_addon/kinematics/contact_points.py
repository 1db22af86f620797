# SPDX-License-Identifier: GPL-3.0-or-later
"""The points of feet and hands that rest on the floor. Numpy alone: work on a motion in Blender needs them too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...solver.body import Body

FOOT_PARTS = ("left_ankle", "left_foot", "right_ankle", "right_foot")
SOLES = ("sole/left_heel", "sole/left_toe", "sole/right_heel", "sole/right_toe")
PALMS = ("palm/left", "palm/right")
CONTACT_POINTS = SOLES + PALMS


def _hand_parts(body: Body) -> tuple[str, str]:
    """The parts with the palms: of a body with fingers, these belong to the wrists."""
    left, right = (
        f"{side}_hand" if f"{side}_hand" in body.joint_names else f"{side}_wrist" for side in ("left", "right")
    )
    return left, right


def with_contact_points(body: Body, betas: np.ndarray) -> Body:
    """The body with six more keypoints, `CONTACT_POINTS`.

    Each lies on the ankle, foot or hand part, in the middle of the part's lowest centimetre at rest, where it presses
    on the floor: rest poses hold their palms down. Exact for these betas; the points keep their place relative to the
    joint for others.
    """
    v, J = body.rest_vertices(betas), body.rest_joints(betas)
    strongest = body.skin_joints[np.arange(len(v)), body.skin_weights.argmax(1)]
    parts = np.array([body.joint_names.index(name) for name in FOOT_PARTS + _hand_parts(body)], np.int32)
    local = np.zeros((len(parts), 3))
    for k, part in enumerate(parts):
        own = v[strongest == part] if (strongest == part).any() else J[part : part + 1]
        lowest = own[own[:, 1] <= own[:, 1].min() + 0.01].mean(0)
        lowest[1] = own[:, 1].min()
        local[k] = lowest - J[part]
    return replace(
        body,
        keypoint_names=(*body.keypoint_names, *CONTACT_POINTS),
        keypoint_part=np.concatenate([body.keypoint_part, parts]),
        keypoint_template=np.concatenate([body.keypoint_template, body.J_template[parts] + local]),
        keypoint_shapedirs=np.concatenate([body.keypoint_shapedirs, body.J_shapedirs[parts]]),
    )


def contact_point_positions(body_with_supports: Body, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """(T, 6, 3) the contact_points of ``with_contact_points``'s body.

    :param R, t: (T, K+1, 3, 3), (T, K+1, 3) part poses in any frame; the result is in that frame.
    """
    return body_with_supports.keypoints(R, t, which=slice(-len(CONTACT_POINTS), None))
