# SPDX-License-Identifier: GPL-3.0-or-later
"""Cached machine code is dropped when any file of the solver changes, not only the kernel's own."""

import subprocess
import sys

from .small_package import make_package

SOURCE = {
    "__init__.py": "",
    "inner.py": "from .compiled.kernel import kernel\n\n\n@kernel\ndef inner(x):\n    return x + {value}.0\n",
    "outer.py": (
        "from .compiled.kernel import kernel\nfrom .inner import inner\n\n@kernel\ndef outer(x):\n    return inner(x)\n"
    ),
}


def test_a_changed_callee_reaches_its_cached_caller(tmp_path):
    package = make_package(tmp_path)
    found = []
    for value in (1, 22):
        for name, text in SOURCE.items():
            if value == 1 or name == "inner.py":
                (package / name).write_text(text.format(value=value))
        code = "from package.outer import outer; print(outer(0.0), len(outer.stats.cache_hits))"
        for _ in range(2):
            run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
            found.append(run.stdout.split())
    assert found == [["1.0", "0"], ["1.0", "1"], ["22.0", "0"], ["22.0", "1"]]


def test_compiling_is_announced_once(tmp_path):
    """The first session says why it waits; the next one finds the machine code and says nothing."""
    package = make_package(tmp_path)
    for name, text in SOURCE.items():
        (package / name).write_text(text.format(value=1))
    code = """
from package.compiled.kernel import announce_compilation
from package.outer import outer
announce_compilation(outer); announce_compilation(outer); outer(0.0); announce_compilation(outer)
"""

    def said():
        run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
        return run.stderr.count("Compiling the solver")

    assert [said(), said()] == [1, 0]
    (package / "inner.py").write_text(SOURCE["inner.py"].format(value=22))
    assert [said(), said()] == [1, 0]
