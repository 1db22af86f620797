# SPDX-License-Identifier: GPL-3.0-or-later
"""Where cameras stand, roughly, from each one's own estimate of a person in 3D."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver.rotations import nearest_rotation
from ...arrays import Float64Array
from .bundle import CameraPlace
from .seen_person import SeenPerson

_ROUNDS = 10
_FAR_M = 0.15  # from which on a lifted keypoint weighs less


def first_place(
    first: SeenPerson, second: SeenPerson, times: Float64Array, clock: CameraPlace
) -> CameraPlace | None:
    """Return the second camera's place in the first one's axes; None if both hardly see the person
    at once.

    The rotation is the one that turns all lifted bodies of the first camera into those of the
    second one, and the translation joins their hips, both by weights that fall with the distance.

    :param times: (N,) of the first camera's clock, seconds.
    :param clock: a place with the second camera's clock.
    """
    a = first.at(times)
    b = second.at(clock.own_times(times))
    both = a.seen & b.seen
    if both.sum() < 3:
        return None
    start = a.points[both].reshape(-1, 3)
    end = b.points[both].reshape(-1, 3)
    confidence = np.minimum(a.confidence, b.confidence)[both].ravel()
    weight = confidence
    R = np.eye(3)
    for _ in range(_ROUNDS):
        R = nearest_rotation((end * weight[:, None]).T @ start)
        error = np.linalg.norm(end - start @ R.T, axis=-1)
        weight = confidence / (1.0 + np.square(error / _FAR_M))
    moves = b.root[both] - a.root[both] @ R.T
    return replace(clock, R_camera_first=R, t_camera_first=np.median(moves, axis=0))
