# SPDX-License-Identifier: GPL-3.0-or-later
"""The points of feet and hands that may rest on the floor: heels, toes and palms. They are
keypoints that are added to a body, after those that the solver numbers itself.

Depends on numpy and the solver only, because motions are also edited where nothing else is
installed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...solver.body import Body
from ..arrays import FloatArray

FOOT_PARTS = ("left_ankle", "left_foot", "right_ankle", "right_foot")
SOLES = ("sole/left_heel", "sole/left_toe", "sole/right_heel", "sole/right_toe")
PALMS = ("palm/left", "palm/right")
CONTACT_POINTS = SOLES + PALMS


def with_contact_points(body: Body, betas: FloatArray) -> Body:
    """Add six keypoints to a body, `CONTACT_POINTS`.

    Each is attached to an ankle, foot or hand part, in the centre of the part's lowest centimetre
    in the rest pose, which is where it touches the floor: rest poses have their palms down. The
    points are exact for these betas; for others, they keep their positions relative to the joints.

    :param betas: (P,) shape coefficients.
    """
    v = body.rest_vertices(betas)
    J = body.rest_joints(betas)
    # The palms are on the hands, or on the wrists of a body with fingers.
    kind = "hand" if "left_hand" in body.joint_names else "wrist"
    names = (*FOOT_PARTS, f"left_{kind}", f"right_{kind}")
    parts = np.array([body.joint_names.index(name) for name in names], np.int32)
    local = np.zeros((len(parts), 3))
    for k, part in enumerate(parts):
        own = v[body.strongest_joints == part]
        own = own if len(own) else J[part : part + 1]
        lowest = own[own[:, 1] <= own[:, 1].min() + 0.01].mean(0)
        lowest[1] = own[:, 1].min()
        local[k] = lowest - J[part]
    return with_points_on_parts(body, CONTACT_POINTS, parts, local)


def contact_point_positions(
    body_with_contact_points: Body, R: FloatArray, t: FloatArray
) -> FloatArray:
    """Return the (T, 6, 3) positions of the contact points of a posed body.

    :param body_with_contact_points: from `with_contact_points`.
    :param R, t: (T, K+1, 3, 3) and (T, K+1, 3) part poses in any frame; the result is in that
        frame.
    """
    return body_with_contact_points.keypoints(R, t, which=slice(-len(CONTACT_POINTS), None))


def with_keypoints(
    body: Body, names: Iterable[str], parts: ArrayLike, template: ArrayLike, shapedirs: ArrayLike
) -> Body:
    """Add n keypoints to a body, after those that it has.

    :param parts: (n,) the joints that carry them.
    :param template, shapedirs: (n, 3) metres, (n, 3, P): their places in the rest pose, and how the
        shape moves them.
    """
    return replace(
        body,
        keypoint_names=(*body.keypoint_names, *names),
        keypoint_part=np.concatenate([body.keypoint_part, np.asarray(parts, np.int32)]),
        keypoint_template=np.concatenate([body.keypoint_template, template]),
        keypoint_shapedirs=np.concatenate([body.keypoint_shapedirs, shapedirs]),
    )


def with_points_on_parts(
    body: Body,
    names: Iterable[str],
    parts: NDArray[np.integer[Any]],
    offsets: FloatArray,
) -> Body:
    """Add n keypoints that keep their offsets (n, 3) from the joints of their parts (n,), whatever
    the shape.
    """
    return with_keypoints(
        body, names, parts, body.J_template[parts] + offsets, body.J_shapedirs[parts]
    )
