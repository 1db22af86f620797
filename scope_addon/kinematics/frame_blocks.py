# SPDX-License-Identifier: GPL-3.0-or-later
"""Saving memory with long clips: a few thousand frames are processed at a time, and results are
stored in single precision.

An hour at 30 frames per second has 108,000 frames: the rotation matrices of one person take 190 MB
in double precision, and numpy's intermediate results several times that. Frames are computed in
double precision and stored in single precision, which moves a joint 10 m away by a micrometre.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

BLOCK_FRAMES = 4096
Record = TypeVar("Record", bound=Any)


def by_blocks(
    compute: Callable[..., tuple[NDArray[Any], ...]],
    *arrays: NDArray[Any],
    frames: int | None = None,
) -> tuple[NDArray[Any], ...]:
    """Evaluate ``compute(*arrays)`` one block of frames at a time, for functions that treat frames
    independently.

    :param compute: maps arrays (t, ...) to a tuple of arrays (t, ...), for any number t of frames.
    :param arrays: (T, ...) each.
    :param frames: number of frames in a block; by default `BLOCK_FRAMES`.
    :return: arrays (T, ...).
    """
    T = len(arrays[0])
    frames = frames or BLOCK_FRAMES
    out: list[NDArray[Any]] = []
    for start in range(0, max(T, 1), frames):
        block = slice(start, start + frames)
        results = compute(*(array[block] for array in arrays))
        if not out:
            out = [np.empty((T, *result.shape[1:]), result.dtype) for result in results]
        for whole, result in zip(out, results, strict=True):
            whole[block] = result
    return tuple(out)


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
