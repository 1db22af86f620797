# SPDX-License-Identifier: GPL-3.0-or-later
"""The folders in which machine code lies, named after everything that it depends on.

Some code comes with the program (`SHIPPED`), compiled for a processor that nearly every computer's
includes (`LEVELS` of solver/shipped_code.py). What is missing there is compiled on first use, for
the computer's own processor, and kept in a folder of the user.

Each version has a folder of its own, ``<area>-<environment>-<program>``: the area is the package
whose sources count, the environment Python, system and processor, the program the sources' content
and the versions of numba and numpy. Sources count by content alone, since an installer gives files
new times.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numba.core.config
import numpy as np
from numba.misc import appdirs

from ...solver.shipped_code import can_run_shipped, host_features, machine, shipped_processor
from ..temporary import own_entries, remove

config: Any = numba.core.config  # these declare no types
llvm: Any = llvmlite.binding
user_folder: Any = appdirs.AppDirs

ROOT = Path(__file__).parents[2]
SOLVER = ROOT / "solver"
# the package that contains the solver
PACKAGE = __name__.rpartition(".scope_addon.")[0]
SHIPPED = ROOT / "assets" / "kernels"
_chosen: list[Path] = []  # at most one
_STALE_S = 14 * 24 * 3600.0  # unused for so long, another version's code is removed


def digest_of(*parts: object) -> str:
    """Return a hexadecimal digest."""
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def sources_digest(folder: Path) -> str:
    """Return a digest of the names and contents of all sources below a folder, whatever their line
    ends.
    """
    files = sorted(folder.rglob("*.py"))
    texts = [
        (f.relative_to(folder).as_posix(), f.read_bytes().replace(b"\r\n", b"\n")) for f in files
    ]
    return digest_of(*texts)


# While importing: what is changed later is not what runs. This package compiles.
_SOLVER_DIGEST = digest_of(sources_digest(SOLVER), sources_digest(Path(__file__).parent))


class Area:
    """The kernels of one package: the folders that may have their code."""

    def __init__(self, package: str, sources: Path) -> None:
        """Make the names of the folders.

        :param package: of the kernels, as `name_in_package` returns it.
        :param sources: folder of the package's sources. All of the solver's count as well.
        """
        self._name = package.rpartition(".")[2]
        own = "" if sources == SOLVER else sources_digest(sources)
        # Kernels see arrays through numba alone, so that only the rules of numpy's major version
        # matter.
        versions = numba.__version__, llvmlite.__version__, np.__version__.partition(".")[0]
        self._program = digest_of(package, _SOLVER_DIGEST, own, versions)[:12]

    def folders(self) -> Iterator[tuple[Path, bool]]:
        """Yield every folder to look in, and whether it came with the program."""
        if can_run_shipped():
            yield SHIPPED / self._folder_name(shipped_processor()), True
        for place in places():
            yield place / self._folder_name(_processor()), False

    def own_folders(self) -> list[Path]:
        """Return the folders to write to, the first that can be written to, for the processor to
        compile for.
        """
        return [place / self._folder_name(_processor()) for place in places()]

    def remove_stale(self, folder: Path) -> None:
        """Remove what lies beside the folder of an area, is of another program, and has not been
        used for long.

        :param folder: has just been used, so that its time is that of the file system's own clock.
        """
        area = re.escape(folder.name[: -len(self._program)])
        for other in own_entries(folder.parent, re.compile(f"{area}[0-9a-f]{{12}}")):
            with suppress(OSError):  # another process has removed it
                unused_s = folder.stat().st_mtime - other.stat().st_mtime
                if other != folder and unused_s > _STALE_S:
                    remove(other)

    def _folder_name(self, processor: str) -> str:
        environment = sys.implementation.cache_tag, sys.platform, machine(), processor
        return f"{self._name}-{digest_of(environment)[:8]}-{self._program}"


def name_in_package(module: str) -> str:
    """Return a module's name within the package, whose own name depends on who has loaded it; the
    name of a module of another package as it is.
    """
    return module.removeprefix(f"{PACKAGE}.")


def keep_in(folder: Path) -> None:
    """Keep what this process compiles from now on in a folder, rather than where numba would."""
    _chosen[:] = [folder]


def places() -> list[Path]:
    """Return the folders in which code may be kept: `keep_in`'s, or NUMBA_CACHE_DIR, or else
    numba's own choices.
    """
    if _chosen:
        return list(_chosen)
    if config.CACHE_DIR:
        return [Path(config.CACHE_DIR)]
    return [
        SOLVER / "__pycache__",
        Path(user_folder(appname="numba", appauthor=False).user_cache_dir),
    ]


def _processor() -> str:
    """Describe the processor that numba compiles for: the one to ship for, or this computer's."""
    if config.CPU_NAME and config.CPU_NAME == shipped_processor():
        return shipped_processor()
    features = config.CPU_FEATURES or sorted(name for name, has in host_features().items() if has)
    return digest_of(config.CPU_NAME or llvm.get_host_cpu_name(), features, config.ENABLE_AVX)


def mark_used(folder: Path) -> None:
    """Note that a folder's code is in use."""
    with suppress(OSError):
        os.utime(folder)
