# SPDX-License-Identifier: GPL-3.0-or-later
"""Per-frame results of long clips in single precision.

An hour at 30 frames per second has 108,000 frames: the rotation matrices of one person take 190 MB
in double precision. Frames are computed in double precision and stored in single precision, which
moves a joint 10 m away by a micrometre.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

Record = TypeVar("Record", bound=Any)


def to_single_precision(record: Record) -> Record:
    """Convert the float64 arrays (T, ...) of a dataclass with more than three values per frame to
    float32.

    :return: a copy of the dataclass; itself if there is nothing to convert.
    """
    large = {}
    for field in fields(record):
        value = getattr(record, field.name)
        if (
            isinstance(value, np.ndarray)
            and value.dtype == np.float64
            and value.size > 3 * len(value)
        ):
            large[field.name] = value.astype(np.float32)
    return replace(record, **large) if large else record
