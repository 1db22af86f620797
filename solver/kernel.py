# SPDX-License-Identifier: Apache-2.0
"""How every kernel of the solver is compiled, and how its machine code is kept."""

import hashlib
import logging
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import njit

from .code_keeper import CodeKeeper, use_keeper
from .shipped_code import KernelCache

# Reordering sums and fusing multiplications is allowed; assuming that no NaN or infinity occurs is
# not, because the optimizer must recognise them. The GIL is released, so that frames can be solved
# in threads.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"reassoc", "contract", "arcp", "nsz"},
    "no_cfunc_wrapper": True,  # no C code calls a kernel; to compile an entry for it takes long
}
_LOG = logging.getLogger(__name__)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel on its first call, and keep the machine code for later sessions.

    It may not create arrays; views of those it is given are fine. So no references need to be
    counted, which would be two atomic operations for every array at every call.

    Kernels are inlined into their callers in other files, so that a change of any file of the
    solver makes all of their code stale. Where no folder can be written to, nothing is kept.
    """
    return cached(_compiled(function, _nrt=False))


def allocating_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that creates arrays; otherwise as `kernel`."""
    return cached(_compiled(function, _nrt=True))


def inlined_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that only others call: as `kernel`, but kept on disk within its callers
    alone.

    For functions made in a loop, which numba's cache cannot tell apart. Python cannot call it.
    """
    return _compiled(function, _nrt=False, no_cpython_wrapper=True)


def expanded_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that only others call, expanded into their code before LLVM sees it.

    For pieces of a hot loop that pass many numbers to each other: a call might pass them through
    memory.
    """
    return _compiled(function, _nrt=False, inline="always")


def cached(compiled: Any) -> Any:
    """Keep the machine code of a function that `numba.njit` compiles, as that of a kernel.

    A change of any source in its folder, or of the solver, makes it stale.
    """
    if hasattr(compiled, "enable_caching"):  # not where numba is configured not to compile at all
        _kept.append(compiled)
        _keeper.keep(compiled)
    return compiled


def is_compiled(compiled: Any) -> bool:
    """Whether a kernel's machine code is in memory or, as it seems, on disk; or whether none is to
    be made, where numba is configured not to compile at all.
    """
    if not hasattr(compiled, "signatures"):
        return True
    return bool(compiled.signatures) or _keeper.has_code(compiled)


def announce_compilation(*kernels: Any) -> None:
    """Log why the coming calls of kernels take long; warnings go to stderr unless logging is
    configured.

    Once in a process: further threads that come meanwhile wait for the same machine code.
    """
    missing = {compiled for compiled in kernels if not is_compiled(compiled)} - _announced
    if missing:
        _announced.update(missing)
        _LOG.warning("Compiling the solver's part that this needs, once: a minute or two.")


class NumbaCache:
    """Numba's own cache, which heeds all files of the solver, and code that came with a wheel."""

    def __init__(self) -> None:
        digest = hashlib.sha256()
        for path in sorted(Path(__file__).parent.rglob("*.py")):
            digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
        self._sources = digest.hexdigest()

    def prepare(self, kernel: Any) -> None:
        """Leave a kernel as it is."""

    def keep(self, kernel: Any) -> None:
        """Switch the cache on, if there is a folder for it."""
        with suppress(RuntimeError):  # no folder can be written to
            kernel._cache = KernelCache(kernel.py_func, self._sources)

    def has_code(self, kernel: Any) -> bool:
        """Whether the cache has code of any signature."""
        return isinstance(kernel._cache, KernelCache) and kernel._cache.has_code()


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    compiled = njit(**_OPTIONS, **options)(function)
    if hasattr(compiled, "enable_caching"):
        _prepared.append(compiled)
        _keeper.prepare(compiled)
    return compiled


def ship_code(folder: Path) -> None:
    """Write the code of all kernels that this process has compiled to a folder of shipped code,
    which exists.
    """
    for compiled in _kept:
        for signature, result in compiled.overloads.items():
            compiled._cache.ship(signature, result, folder)


def _use(keeper: CodeKeeper) -> None:
    """Let a keeper take care of all kernels."""
    global _keeper
    _keeper = keeper
    for compiled in _prepared:
        keeper.prepare(compiled)
    for compiled in _kept:
        keeper.keep(compiled)


_announced: set[Any] = set()
_prepared: list[Any] = []  # the kernels of this process
_kept: list[Any] = []  # those whose machine code is kept on disk
_keeper: CodeKeeper = NumbaCache()
use_keeper(_use)
