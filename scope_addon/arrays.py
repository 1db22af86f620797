# SPDX-License-Identifier: GPL-3.0-or-later
"""Names for arrays in signatures; their shapes and units stand beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating[Any]]  # single or double precision
Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Uint8Array = NDArray[np.uint8]  # mostly images (H, W, 3)
BoolArray = NDArray[np.bool_]
IndexArray = NDArray[np.intp]
