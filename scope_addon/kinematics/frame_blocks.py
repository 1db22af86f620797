# SPDX-License-Identifier: GPL-3.0-or-later
"""Long clips a few thousand frames at a time.

Rotation matrices of an hour's 108,000 frames take 190 MB, and numpy's intermediate results several times that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

BLOCK_FRAMES = 4096


def by_blocks(compute: Callable[..., tuple[np.ndarray, ...]], *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
    """``compute(*arrays)`` a block of frames at a time, for what treats each frame on its own.

    :param compute: arrays (t, ...) to a tuple of arrays (t, ...), for any number t of frames.
    :param arrays: (T, ...) each.
    """
    T = len(arrays[0])
    out: list[np.ndarray] = []
    for start in range(0, max(T, 1), BLOCK_FRAMES):
        block = slice(start, start + BLOCK_FRAMES)
        parts = compute(*(array[block] for array in arrays))
        if not out:
            out = [np.empty((T, *part.shape[1:]), part.dtype) for part in parts]
        for whole, part in zip(out, parts, strict=True):
            whole[block] = part
    return tuple(out)
