# SPDX-License-Identifier: GPL-3.0-or-later
"""A package whose kernels compile in a second, with what the solver compiles its kernels with."""

import shutil
from pathlib import Path

import scope.solver

FILES = tuple(
    f"compiled/{name}.py"
    for name in ("kernel", "pipeline", "code_cache", "code_files", "code_folders")
)
# The callee is too long to be inlined: calls count much where LLVM decides that.
_LINES = "".join(f"    total += math.sin(x + {k}.0)\n" for k in range(30))
LONG_CALLEE = f"""
import math
from .compiled.kernel import kernel

@kernel
def inner(x):
    total = 0.0
{_LINES}    return total

@kernel
def outer(x):
    return inner(x) + inner(2.0 * x)
"""


def make_package(folder: Path) -> Path:
    """Make ``package`` in a folder, as yet without kernels."""
    package = folder / "package"
    (package / "compiled").mkdir(parents=True)
    for name in ("__init__", "compiled/__init__"):
        (package / f"{name}.py").touch()
    for name in (*FILES, "processes.py"):
        shutil.copy(Path(scope.solver.__file__).parent / name, package / name)
    return package
