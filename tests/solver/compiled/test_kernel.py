# SPDX-License-Identifier: GPL-3.0-or-later
"""Cached machine code is dropped when any file of the solver changes, not only the kernel's own;
who waits is told.
"""

import os

import pytest

from .small_package import make_package

SOURCE = {
    "__init__.py": "",
    "inner.py": "from .compiled.kernel import kernel\n\n\n@kernel\ndef inner(x):\n    return x + "
    "{value}.0\n",
    "outer.py": (
        "from .compiled.kernel import kernel\nfrom .inner import inner\n\n@kernel\ndef outer(x):\n "
        "   return inner(x)\n"
    ),
}


# Prints the kernel's result, and whether its code came from disk.
RUN = """
from package.compiled.kernel import announce_compilation
from package.outer import outer
announce_compilation(outer); announce_compilation(outer)
print(outer(0.0), len(outer.stats.cache_hits))
announce_compilation(outer)
"""


@pytest.fixture(scope="module")
def runs(run_code, tmp_path_factory):
    """What is printed, and how often it is said that the solver is compiled: twice each, before and
    after a change.
    """
    folder = tmp_path_factory.mktemp("kernels")
    package = make_package(folder)
    found = []
    for value in (1, 22):
        for name, text in SOURCE.items():
            if value == 1 or name == "inner.py":
                (package / name).write_text(text.format(value=value))
        for _ in range(2):
            run = run_code(RUN, folder, os.environ)
            found.append((run.stdout.split(), run.stderr.count("Compiling the solver")))
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
