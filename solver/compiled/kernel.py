# SPDX-License-Identifier: GPL-3.0-or-later
"""How every kernel of the solver is compiled, and when its cached machine code is still good."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

# Reordering sums and fusing multiplications is allowed; assuming that no NaN or infinity occurs is not, because the
# optimizer must recognise them. The GIL is released, so that frames can be solved in threads.
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"reassoc", "contract", "arcp", "nsz"}}


def source_stamp() -> tuple[tuple[str, float, int], ...]:
    """Return name, modification time and size of every source file that kernels may come from."""
    files = sorted(Path(__file__).parent.parent.rglob("*.py"))
    return tuple((f.name, s.st_mtime, s.st_size) for f in files for s in [f.stat()])


_STAMP = source_stamp()
_LOG = logging.getLogger(__name__)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel on its first call, and keep the machine code for later sessions.

    It may not create arrays; views of those it is given are fine. So no references need to be counted, which would be
    two atomic operations for every array at every call.

    Numba throws a cached kernel away when its own file has changed, but kernels are inlined into their callers in
    other files, which would go on using the old code; so the stamp that numba compares covers all of them.
    Where no folder can be written to, nothing is kept.
    """
    return _compiled(function, _nrt=False)


def allocating_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that creates arrays; otherwise as `kernel`."""
    return _compiled(function, _nrt=True)


def inlined_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that only others call: as `kernel`, but kept on disk within its callers alone.

    For functions made in a loop, which numba's cache cannot tell apart.
    """
    options = dict(_OPTIONS, _nrt=False)
    return njit(**options)(function)


def expanded_kernel(function: Callable[..., Any]) -> Any:
    """Compile a kernel that only others call, expanded into their code before LLVM sees it.

    For pieces of a hot loop that pass many numbers to each other: a call might pass them through memory.
    """
    options = dict(_OPTIONS, _nrt=False, inline="always")
    return njit(**options)(function)


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    try:
        compiled = njit(cache=True, **_OPTIONS, **options)(function)
    except RuntimeError:  # numba found no place for its cache
        return njit(**_OPTIONS, **options)(function)
    cache_file = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    # Not part of numba's interface: without it, numba's own rule stands.
    if cache_file is not None and hasattr(cache_file, "_source_stamp"):
        cache_file._source_stamp = _STAMP
    return compiled


def is_compiled(dispatcher: Any) -> bool:
    """Whether a kernel's machine code is in memory or, still good, on disk."""
    if dispatcher.signatures:
        return True
    cache_file = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    try:
        return cache_file is not None and bool(cache_file._load_index())
    except Exception:  # not part of numba's interface: without it, or with a damaged index, say that it takes time
        return False


_announced: set[Any] = set()


def announce_compilation(dispatcher: Any) -> None:
    """Log why the coming call takes long; warnings go to stderr unless logging is configured.

    Once in a process: further threads that come meanwhile wait for the same machine code.
    """
    if not is_compiled(dispatcher) and dispatcher not in _announced:
        _announced.add(dispatcher)
        _LOG.warning("Compiling the solver for this machine, once: 10 to 20 seconds.")
