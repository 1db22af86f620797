# SPDX-License-Identifier: Apache-2.0
"""The loops over columns and joints that all fits run: those of `fast`.

With ten shape coefficients, a Gauss-Newton step with those of plain_rows.py, which compute the same
in plain numba, takes about twice as long. To do without `fast`, delete its folder and its tests,
and import from `.plain_rows` here.
"""

from ..fast.rows import (
    add_origin,
    add_point,
    add_to_parent,
    in_lanes,
    place_origin,
    scale_rows,
    subtract_eliminated,
    take_moment,
)

__all__ = [
    "add_origin",
    "add_point",
    "add_to_parent",
    "in_lanes",
    "place_origin",
    "scale_rows",
    "subtract_eliminated",
    "take_moment",
]
