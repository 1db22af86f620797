# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions and gaze of a face over a clip, from its landmarks: fitted, or a network's where it was seen briefly.

They are found when all frames have been observed: only then is it known whether a face was seen for long enough, and
the expression network, which few captures need, does not run for the others.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...perception.face.expression_network import EXPRESSION_POINTS, ExpressionNetwork
from ...perception.face.face_record import kept_landmarks, landmarks_of, with_expression
from ...perception.face.gaze import gaze
from .expression_fit import fitted, is_known


def with_expressions(rows: NDArray[np.floating[Any]], times: NDArray[np.float64]) -> NDArray[np.floating[Any]]:
    """Return rows of one person with weights and gaze.

    :param rows: (T, RECORD) see `face_record`.
    :param times: (T,) seconds.
    :raises SetupError: the expression network is needed and has not been built.
    :raises ModelFileError: what they are found with is damaged.
    """
    seen = np.flatnonzero(rows[:, 0] > 0)
    if is_known(rows, times):
        return fitted(rows, times)
    if not len(seen):
        return rows
    network = ExpressionNetwork()  # on the CPU, whatever the other networks run on: it takes a millisecond
    landmarks = landmarks_of(rows[seen], np.array(EXPRESSION_POINTS))[..., :2]
    weights = np.array([network.estimate(face) for face in landmarks])
    directions = np.array([gaze(kept_landmarks(row)) for row in rows[seen]])
    out = rows.copy()
    out[seen] = with_expression(rows[seen], weights, directions)
    return out
