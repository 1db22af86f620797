# SPDX-License-Identifier: GPL-3.0-or-later
"""Processing long clips a few thousand frames at a time.

The rotation matrices of an hour's 108,000 frames take 190 MB, and numpy's intermediate results
several times that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

BLOCK_FRAMES = 4096


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
