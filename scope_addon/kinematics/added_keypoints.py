# SPDX-License-Identifier: GPL-3.0-or-later
"""Further keypoints of a body, which the solver numbers after its own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...solver.body import Body


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
    offsets: NDArray[np.floating[Any]],
) -> Body:
    """Add n keypoints that keep their offsets (n, 3) from the joints of their parts (n,), whatever
    the shape.
    """
    return with_keypoints(
        body, names, parts, body.J_template[parts] + offsets, body.J_shapedirs[parts]
    )
