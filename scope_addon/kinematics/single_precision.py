# SPDX-License-Identifier: GPL-3.0-or-later
"""What is kept of every frame of a long clip, in single precision.

An hour at 30 frames a second has 108,000 frames: rotation matrices of one person take 190 MB in double precision. Each
frame is computed in double precision all the same; kept singly, a joint 10 m away is off by a micrometre.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

Record = TypeVar("Record", bound=Any)


def to_single_precision(record: Record) -> Record:
    """A dataclass with each (T, ...) float64 array of more than a point a frame as float32."""
    large = {}
    for field in fields(record):
        value = getattr(record, field.name)
        if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.size > 3 * len(value):
            large[field.name] = value.astype(np.float32)
    return replace(record, **large) if large else record
