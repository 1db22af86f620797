# SPDX-License-Identifier: GPL-3.0-or-later
"""The product around the solver: capture (video to motion), scene (motion to Blender data), ui,
command line.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, cast

from ..solver.code_keeper import keep_code_with

if TYPE_CHECKING:
    from ..solver.code_keeper import CodeKeeper


def _make_code_keeper() -> CodeKeeper:
    """Return the cache of the solver's machine code, which needs numba."""
    module = import_module(".machine_code.code_cache", __name__)
    return cast("CodeKeeper", module.ShippedOrOwnCode())


keep_code_with(_make_code_keeper)
