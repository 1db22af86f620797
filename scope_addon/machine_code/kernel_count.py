# SPDX-License-Identifier: GPL-3.0-or-later
"""How many kernels there are to compile, without loading numba: the whole of a bar of progress."""

from functools import cache
from pathlib import Path

PRODUCT = Path(__file__).parents[2]
_SOURCES = ("solver", "scope_addon")


@cache
def kernel_count(product: Path = PRODUCT) -> int:
    """Return the number of kernels in the sources: a capture compiles nearly all of them.

    :param product: the folder of the packages of the product.
    """
    modules = [path for name in _SOURCES for path in (product / name).rglob("*.py")]
    return sum(path.read_text("utf-8").count("\n@kernel\n") for path in modules)
