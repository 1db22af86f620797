# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for arrays in signatures, whose shapes and units stand beside them; unit vectors; and the
rounding of what one stage of a capture hands to the next.

The last bits of sums and products differ between versions of numpy and its libraries. Trackers and
fits amplify them: without rounding, the same clip was captured up to 1.1 m differently with Python
3.11 and 3.13. Rounded far more coarsely than these bits, and far more finely than anything that can
be measured, both versions hand on the same numbers.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating[Any]]  # single or double precision
Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Uint8Array = NDArray[np.uint8]  # mostly images (H, W, 3)
BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.intp]
# Of rounded arrays: metres, coefficients, and inputs of networks, which are about 1.
STEP = 2.0**-20


def round_number(value: float, step: float) -> float:
    """Return the multiple of a step, a power of two, that is nearest to a value; values that are
    not finite as they are.
    """
    return round(value / step) * step if math.isfinite(value) else value


def round_array(values: FloatArray) -> FloatArray:
    """Return the multiples of `STEP` that are nearest to values."""
    return np.round(values / STEP) * STEP


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """Return vectors (..., n) with length 1; one of length 0 stays 0."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
