# SPDX-License-Identifier: Apache-2.0
"""Numba's own cache, and machine code that comes with a wheel of the solver.

Shipped code is compiled for a processor that nearly every computer's includes (`LEVELS`), and lies
in a folder for each system and Python beside this file. It holds for the sources and the compiler
that it was made from; where anything differs, a kernel is compiled and kept as numba does.
"""

import sys
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding
import numba.core.caching
import numba.core.config

config: Any = numba.core.config  # these declare no types
llvm: Any = llvmlite.binding
_caching: Any = numba.core.caching

# By machine: LLVM's name of the processor that shipped code is compiled for, and the features that
# it needs of another.
LEVELS = {
    "x86_64": (
        "x86-64-v3",
        ("avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sse4.2"),
    ),
    "arm64": ("apple-m1", ()),  # macOS, whose every ARM processor is this one or a later one
}
# Index of the annotated source in what numba reduces a result to: of no use, and with the paths of
# the machine.
ANNOTATION = 6


class KernelCache(_caching.FunctionCache):  # type: ignore[misc]
    """Numba's cache of one kernel, which besides the kernel's own file heeds all of the solver's,
    and looks into shipped code as well.
    """

    def __init__(self, function: Any, sources: str) -> None:
        """Find a folder to keep code in.

        :param sources: a digest of all files of the solver: a kernel contains copies of kernels in
            other files, whose changes numba would not notice.
        :raises RuntimeError: no folder can be written to.
        """
        super().__init__(function)
        own = self._cache_file
        own._source_stamp = (own._source_stamp, sources)
        self._sources = sources
        module = function.__module__.rpartition("solver.")[2]
        self._shipped_name = f"{module.rpartition('.')[0]}.{self._impl.filename_base}"

    def has_code(self) -> bool:
        """Whether there is code of any signature."""
        shipped = can_run_shipped() and self._index_in(shipped_folder())._load_index()
        return bool(shipped or self._cache_file._load_index())

    def ship(self, signature: Any, result: Any, folder: Path) -> None:
        """Write what was compiled for a signature to a folder of shipped code."""
        reduced = list(self._impl.reduce(result))
        reduced[ANNOTATION] = ""
        key = self._shipped_key(signature, result.codegen)
        self._index_in(folder).save(key, tuple(reduced))

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        found = super()._load_overload(sig, target_context)
        if found is not None or not self._enabled or not can_run_shipped():
            return found
        key = self._shipped_key(sig, target_context.codegen())
        data = self._index_in(shipped_folder()).load(key)
        return None if data is None else self._impl.rebuild(target_context, data)

    def _shipped_key(self, signature: Any, codegen: Any) -> tuple[Any, Any]:
        """Return what shipped code is looked up by: not the processor, which need not be equal."""
        _, _, function = self._index_key(signature, codegen)
        return signature, function

    def _index_in(self, folder: Path) -> Any:
        # Numba's version is part of its files. Machine code sees arrays through numba alone: by
        # which numpy it was compiled does not matter.
        stamp = self._sources, llvmlite.__version__
        return _caching.IndexDataCacheFile(str(folder), self._shipped_name, stamp)


def shipped_folder() -> Path:
    """Return the folder of the code that is shipped for this system and Python."""
    name = f"{sys.platform}-{machine()}-{sys.implementation.cache_tag}"
    return Path(__file__).with_name("machine_code") / name


@cache
def machine() -> str:
    """Return the kind of processor, by one name on all systems."""
    name = str(llvm.get_process_triple()).partition("-")[0]
    return {"amd64": "x86_64", "aarch64": "arm64"}.get(name, name)


def shipped_processor() -> str:
    """Return LLVM's name of the processor that code is shipped for; empty where none is."""
    if machine() == "arm64" and sys.platform != "darwin":
        return ""
    return LEVELS.get(machine(), ("", ()))[0]


@cache
def can_run_shipped() -> bool:
    """Whether the processor has everything that shipped code needs, and numba is not configured to
    use less.
    """
    if config.CPU_NAME not in (None, "", shipped_processor()) or not config.ENABLE_AVX:
        return False
    return bool(shipped_processor()) and all(
        host_features().get(feature) for feature in LEVELS[machine()][1]
    )


@cache
def host_features() -> dict[str, bool]:
    """Return what this computer's processor can do, by LLVM's names."""
    try:
        return dict(llvm.get_host_cpu_features())
    except RuntimeError:  # LLVM does not know this processor
        return {}
