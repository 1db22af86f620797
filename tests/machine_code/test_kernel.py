# SPDX-License-Identifier: GPL-3.0-or-later
"""Cached machine code is dropped when any file of the solver changes, not only the kernel's own;
who waits is told. With numba's own cache, and with the extension's.
"""

import os

import pytest
from scope.scope_addon.machine_code.kernel_count import kernel_count
from scope.solver.shipped_code import can_run_shipped, shipped_processor

from .small_package import make_package

SOURCE = {
    "__init__.py": "",
    "inner.py": "from .kernel import kernel\n\n\n@kernel\ndef inner(x):\n    return x + "
    "{value}.0\n",
    "outer.py": (
        "from .kernel import kernel\nfrom .inner import inner\n\n@kernel\ndef outer(x):\n "
        "   return inner(x)\n"
    ),
}


def make_solver(folder):
    """Make the package with these sources, and return the folder of its solver."""
    solver = make_package(folder)
    for name, text in SOURCE.items():
        (solver / name).write_text(text.format(value=1))
    return solver


# Prints the kernel's result, and whether its code came from disk.
RUN = """
from package.solver.kernel import announce_compilation
from package.solver.outer import inner, outer
announce_compilation(outer, inner); announce_compilation(inner)
print(outer(0.0), len(outer.stats.cache_hits))
announce_compilation(outer)
"""


@pytest.fixture(scope="module", params=["solver", "extension"])
def runs(request, run_code, tmp_path_factory):
    """What is printed, and how often it is said that the solver is compiled: twice each, before and
    after a change.
    """
    folder = tmp_path_factory.mktemp("kernels")
    solver = make_solver(folder)
    before = "import package.scope_addon" if request.param == "extension" else ""
    variables = dict(os.environ, NUMBA_CACHE_DIR=str(folder / "cache"))
    found = []
    for value in (1, 22):
        (solver / "inner.py").write_text(SOURCE["inner.py"].format(value=value))
        for _ in range(2):
            run = run_code(before + RUN, folder, variables)
            found.append((run.stdout.split(), run.stderr.count("Compiling the solver")))
    kept = {path.suffix for path in (folder / "cache").rglob("*") if path.is_file()}
    assert kept == ({".code"} if request.param == "extension" else {".nbi", ".nbc"})
    return found


def test_a_changed_callee_reaches_its_cached_caller(runs):
    assert [printed for printed, _ in runs] == [
        ["1.0", "0"],
        ["1.0", "1"],
        ["22.0", "0"],
        ["22.0", "1"],
    ]


def test_compiling_is_announced_once(runs):
    """The first session says why it waits; the next one finds the machine code and says nothing."""
    assert [said for _, said in runs] == [1, 0, 1, 0]


SHIP = """
import sys
from pathlib import Path
from package.solver import kernel, shipped_code
from package.solver.outer import outer
outer(0.0)
folder = shipped_code.shipped_folder()
folder.mkdir(parents=True)
kernel.ship_code(folder)
"""


@pytest.mark.skipif(not can_run_shipped(), reason="no code is shipped for this processor")
def test_code_that_came_with_a_wheel_is_used_until_a_source_changes(run_code, tmp_path):
    """It was compiled into another cache, for a processor that need not be this one."""
    solver = make_solver(tmp_path)
    variables = dict(os.environ, NUMBA_CACHE_DIR=str(tmp_path / "maker"))
    chosen = {"NUMBA_CPU_NAME": shipped_processor(), "NUMBA_CPU_FEATURES": ""}
    run_code(SHIP, tmp_path, variables | chosen)
    shipped = sorted(path.suffix for path in (solver / "machine_code").rglob("*.nb*"))
    assert shipped == [".nbc", ".nbc", ".nbi", ".nbi"]
    variables["NUMBA_CACHE_DIR"] = str(tmp_path / "user")
    used = run_code(RUN, tmp_path, variables)
    assert used.stdout.split() == ["1.0", "1"]
    assert used.stderr == ""
    (solver / "inner.py").write_text(SOURCE["inner.py"].format(value=22))
    stale = run_code(RUN, tmp_path, variables)
    assert stale.stdout.split() == ["22.0", "0"]
    assert stale.stderr.count("Compiling the solver") == 1


LATE = """
from package.solver.outer import outer
import package.scope_addon
print(outer(0.0), type(outer._cache).__name__, outer._compiler.pipeline_class.__name__)
"""


def test_the_extension_also_keeps_the_code_of_kernels_that_were_there_before(run_code, tmp_path):
    make_solver(tmp_path)
    variables = dict(os.environ, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    done = run_code(LATE, tmp_path, variables)
    assert done.stdout.split() == ["1.0", "CodeCache", "KernelCompiler"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no folder that nobody may write to")
def test_without_a_place_for_code_a_solver_alone_works(run_code, tmp_path):
    make_solver(tmp_path)
    (tmp_path / "file").touch()
    variables = dict(os.environ, NUMBA_CACHE_DIR=str(tmp_path / "file" / "cache"))
    assert run_code(RUN, tmp_path, variables).stdout.split() == ["1.0", "0"]


def test_kernels_are_counted_in_the_sources_of_both_packages(tmp_path):
    kernels = "\n@kernel\ndef first():\n    pass\n\n\n@kernel\ndef second():\n    pass\n"
    for package, source in (("solver", kernels), ("scope_addon/capture", "import kernel\n")):
        (tmp_path / package).mkdir(parents=True)
        (tmp_path / package / "module.py").write_text(source)
    assert kernel_count(tmp_path) == 2
