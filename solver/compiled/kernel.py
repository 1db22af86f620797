# SPDX-License-Identifier: GPL-3.0-or-later
"""How every kernel of the solver is compiled, and how its machine code is kept."""

import logging
from collections.abc import Callable
from typing import Any

from numba import njit

from .code_cache import CodeCache
from .pipeline import KernelCompiler

# Reordering sums and fusing multiplications is allowed; assuming that no NaN or infinity occurs is
# not, because the optimizer must recognise them. The GIL is released, so that frames can be solved
# in threads.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"reassoc", "contract", "arcp", "nsz"},
    "no_cfunc_wrapper": True,  # no C code calls a kernel; to compile an entry for it takes long
    "pipeline_class": KernelCompiler,
}


_LOG = logging.getLogger(__name__)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel on its first call, and keep the machine code for later sessions.

    It may not create arrays; views of those it is given are fine. So no references need to be
    counted, which would be two atomic operations for every array at every call.

    Kernels are inlined into their callers in other files, so that a change of any file of the
    solver makes all of their code stale. Where no folder can be written to, nothing is kept.
    """
    return _compiled(function, _nrt=False)


def allocating_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that creates arrays; otherwise as `kernel`."""
    return _compiled(function, _nrt=True)


def inlined_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that only others call: as `kernel`, but kept on disk within its callers
    alone.

    For functions made in a loop, which numba's cache cannot tell apart. Python cannot call it.
    """
    options = dict(_OPTIONS, _nrt=False, no_cpython_wrapper=True)
    return njit(**options)(function)


def expanded_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that only others call, expanded into their code before LLVM sees it.

    For pieces of a hot loop that pass many numbers to each other: a call might pass them through
    memory.
    """
    options = dict(_OPTIONS, _nrt=False, inline="always")
    return njit(**options)(function)


def cached(compiled: Any) -> Any:
    """Keep the machine code of a function that `numba.njit` compiles, as that of a kernel.

    A change of any source in its folder, or of the solver, makes it stale.
    """
    if hasattr(compiled, "_cache"):  # not where numba is configured not to compile at all
        compiled._cache = CodeCache(compiled.py_func)
    return compiled


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    return cached(njit(**_OPTIONS, **options)(function))


def is_compiled(dispatcher: Any) -> bool:
    """Whether a kernel's machine code is in memory or, as it seems, on disk."""
    return bool(dispatcher.signatures) or dispatcher._cache.has_code()


_announced: set[Any] = set()


def announce_compilation(dispatcher: Any) -> None:
    """Log why the coming call takes long; warnings go to stderr unless logging is configured.

    Once in a process: further threads that come meanwhile wait for the same machine code.
    """
    if not is_compiled(dispatcher) and dispatcher not in _announced:
        _announced.add(dispatcher)
        _LOG.warning("Compiling the solver for this machine, once: a minute or two.")
