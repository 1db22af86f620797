# SPDX-License-Identifier: Apache-2.0
"""The loops over columns and joints that all fits run: those of `fast`, or the same in plain numba.

With ten shape coefficients, a Gauss-Newton step in plain numba takes about twice as long as with
`fast`. To do without it, delete its folder, its tests, and all of this file but the second import.
"""

USE_FAST = True

if USE_FAST:
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
else:
    from .plain_rows import (
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
