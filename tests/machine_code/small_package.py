# SPDX-License-Identifier: GPL-3.0-or-later
"""A package whose kernels compile in a second, with what the solver compiles its kernels with."""

import shutil
from pathlib import Path

import scope

FILES = (
    "solver/code_keeper.py",
    "solver/kernel.py",
    "solver/shipped_code.py",
    "scope_addon/__init__.py",
    "scope_addon/atomic_write.py",
    "scope_addon/errors.py",
    "scope_addon/temporary.py",
    "solver/errors.py",
    *(
        f"scope_addon/machine_code/{name}.py"
        for name in ("__init__", "code_cache", "code_folders", "numba_internals")
    ),
)
# The callee is too long to be inlined: calls count much where LLVM decides that.
_LINES = "".join(f"    total += math.sin(x + {k}.0)\n" for k in range(30))
LONG_CALLEE = f"""
import math
from .kernel import kernel

@kernel
def inner(x):
    total = 0.0
{_LINES}    return total

@kernel
def outer(x):
    return inner(x) + inner(2.0 * x)
"""


def make_package(folder: Path) -> Path:
    """Make ``package`` in a folder, and return the folder of its solver, as yet without kernels.

    Kernels are imported from ``package.solver``; their code is kept as the extension does if
    ``package.scope_addon`` is imported.
    """
    package = folder / "package"
    for name in ("solver", "scope_addon/machine_code"):
        (package / name).mkdir(parents=True)
    for name in ("__init__", "solver/__init__"):
        (package / f"{name}.py").touch()
    for name in FILES:
        shutil.copy(Path(scope.__file__).parent / name, package / name)
    return package / "solver"
