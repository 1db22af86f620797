# SPDX-License-Identifier: GPL-3.0-or-later
"""A package whose kernels compile in a second, with what the solver compiles its kernels with."""

import shutil
from pathlib import Path

import scope.solver.compiled

FILES = ("kernel", "pipeline", "code_cache", "code_files", "code_folders")


def make_package(folder: Path) -> Path:
    """Make ``package`` in a folder, as yet without kernels."""
    package = folder / "package"
    (package / "compiled").mkdir(parents=True)
    for name in ("__init__", "compiled/__init__"):
        (package / f"{name}.py").touch()
    for name in FILES:
        shutil.copy(Path(scope.solver.compiled.__file__).with_name(f"{name}.py"), package / "compiled")
    return package
