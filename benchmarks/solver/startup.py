# SPDX-License-Identifier: GPL-3.0-or-later
"""Time of the first call after installation, which compiles, and of the first call in a later
session.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile

_SCRIPT = """
import time
from scope.benchmarks.solver.problem import make_problem
from scope.solver import fit
p = make_problem(23, 10, 120)
start = time.perf_counter()
fit(p.body, p.measurements)
print(time.perf_counter() - start)
"""


def startup() -> dict[str, float]:
    """Return first_call_s and cached_call_s, each of a fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        times = [_run(folder), _run(folder)]
    return {"first_call_s": times[0], "cached_call_s": times[1]}


def _run(cache: str) -> float:
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    done = subprocess.run(
        [sys.executable, "-c", _SCRIPT], env=environment, capture_output=True, text=True, check=True
    )
    return float(done.stdout.strip().splitlines()[-1])
