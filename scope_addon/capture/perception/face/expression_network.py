# SPDX-License-Identifier: GPL-3.0-or-later
"""The expression network: from landmarks of a face to the weights of 52 expressions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .....solver.names import EXPRESSIONS
from ..sessions import network_path, open_session

# The landmarks that the expression network was trained on, in its order.
EXPRESSION_POINTS = (
    0, 1, 4, 5, 6, 7, 8, 10, 13, 14, 17, 21, 33, 37, 39, 40, 46, 52, 53, 54, 55, 58, 61, 63, 65, 66, 67, 70, 78, 80, 81,
    82, 84, 87, 88, 91, 93, 95, 103, 105, 107, 109, 127, 132, 133, 136, 144, 145, 146, 148, 149, 150, 152, 153, 154,
    155, 157, 158, 159, 160, 161, 162, 163, 168, 172, 173, 176, 178, 181, 185, 191, 195, 197, 234, 246, 249, 251, 263,
    267, 269, 270, 276, 282, 283, 284, 285, 288, 291, 293, 295, 296, 297, 300, 308, 310, 311, 312, 314, 317, 318, 321,
    323, 324, 332, 334, 336, 338, 356, 361, 362, 365, 373, 374, 375, 377, 378, 379, 380, 381, 382, 384, 385, 386, 387,
    388, 389, 390, 397, 398, 400, 402, 405, 409, 415, 454, 466, 468, 469, 470, 471, 472, 473, 474, 475, 476, 477,
)  # fmt: skip
# The expression network's outputs: a weight of the neutral face, then these. It knows nothing of the tongue.
_OF_NETWORK = [k for k, name in enumerate(EXPRESSIONS) if name != "tongueOut"]


class ExpressionNetwork:
    """The expression network; stateless between calls.

    :raises SetupError: the network has not been built.
    :raises ModelFileError: its file is damaged.
    """

    def __init__(self) -> None:
        # It takes a millisecond, which further threads would make longer.
        self._session = open_session(network_path("face_expression"), 1)

    def estimate(self, landmarks_px: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
        """Estimate the weights (52,) 0..1 of the expressions in the order of `EXPRESSIONS`; 0 of the tongue.

        :param landmarks_px: (146, 2) those of `EXPRESSION_POINTS`, pixels.
        """
        (found,) = self._session.run(["weights"], {"input": landmarks_px.astype(np.float32)[None]})
        weights = np.zeros(len(EXPRESSIONS))
        weights[_OF_NETWORK] = found[0, 1:]
        return weights
