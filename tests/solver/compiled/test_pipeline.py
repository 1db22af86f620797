# SPDX-License-Identifier: GPL-3.0-or-later
"""A kernel's machine code shows other code only what is its own, not its copies of its callees."""

import os
import subprocess
import sys

from .small_package import make_package

# The callee is too long to be inlined: calls count much where LLVM decides that.
KERNELS = """
import math
from .compiled.kernel import kernel

@kernel
def inner(x):
    total = 0.0
{lines}
    return total

@kernel
def outer(x):
    return inner(x) + inner(2.0 * x)
"""
RUN = """
import math
from package.kernels import inner, outer
assert outer(0.5) == inner(0.5) + inner(1.0)
assert math.isclose(outer(0.5), sum(math.sin(x + k) for x in (0.5, 1.0) for k in range(30)), rel_tol=1e-12)
for kernel in (inner, outer):
    assert sum(kernel.stats.cache_hits.values()) == 0
    (made,) = kernel.overloads.values()
    defined = [f for f in made.library._final_module.functions if not f.is_declaration]
    print(sorted({(f.linkage.name, "outer" if "outer" in f.name else "inner") for f in defined}))
"""


def test_copies_of_callees_are_not_shared(tmp_path):
    """If they were, results would depend on which kernels a process has compiled or called before."""
    lines = "".join(f"    total += math.sin(x + {k}.0)\n" for k in range(30))
    (make_package(tmp_path) / "kernels.py").write_text(KERNELS.format(lines=lines))
    environment = dict(os.environ, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    command = [sys.executable, "-c", RUN]
    done = subprocess.run(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    inner, outer = map(eval, done.stdout.splitlines())
    assert inner == [("external", "inner")]
    assert outer == [("external", "outer"), ("internal", "inner")]
    again = RUN.replace("== 0", "== 1").partition("    (made,)")[0]
    subprocess.run([sys.executable, "-c", again], cwd=tmp_path, env=environment, check=True)
