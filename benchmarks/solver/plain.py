# SPDX-License-Identifier: GPL-3.0-or-later
"""What `solver/fast` brings: the same solver without that folder, in plain numba, in a process of
its own.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...solver import fit, fit_clip
from . import steps
from .problem import make_problem
from .timing import take_turns

ROOT = Path(__file__).resolve().parents[2]
CLIP_FRAMES = 30
TURNS = 3  # of each of the two processes, one after the other
_SCRIPT = "from scope.benchmarks.solver.plain import print_times; print_times({rounds})"


def against_plain(rounds: int) -> dict[str, float]:
    """Return the time without `solver/fast` over that with it, of steps, a frame and a clip."""
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder) / "scope"
        package.mkdir()
        for entry in ROOT.iterdir():
            if entry.name != "solver" and not entry.name.startswith("."):
                (package / entry.name).symlink_to(entry)
        leave_out = shutil.ignore_patterns("fast", "__pycache__")
        shutil.copytree(ROOT / "solver", package / "solver", ignore=leave_out)
        rows = package / "solver" / "gauss_newton" / "rows.py"
        switched = rows.read_text().replace("..fast.rows", ".plain_rows")
        rows.write_text(switched)
        plain = []
        fast = []
        for _ in range(TURNS):
            plain.append(_times(Path(folder), rounds))
            fast.append(_times(None, rounds))
    return {
        name: float(np.median([each[name] for each in plain]))
        / float(np.median([each[name] for each in fast]))
        for name in fast[0]
    }


def _times(folder: Path | None, rounds: int) -> dict[str, float]:
    """Return the times in another process, of the package in a folder; None: of this one."""
    environment = dict(os.environ)
    if folder is not None:
        environment["PYTHONPATH"] = str(folder)
    done = subprocess.run(
        [sys.executable, "-c", _SCRIPT.format(rounds=rounds)],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    times: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return times


def print_times(rounds: int) -> None:
    """Print the times of steps, a frame and a clip, microseconds, as JSON."""
    problems = {
        "step K=23 P=10 N=120": make_problem(23, 10, 120),
        "step K=23 P=10 N=600": make_problem(23, 10, 600),
        "step K=51 P=10 N=120": make_problem(51, 10, 120),
        "step K=23 P=0 N=120": make_problem(23, 0, 120),
    }
    runs = {name: steps.sparse_run(p) for name, p in problems.items()}
    times = take_turns(runs, dict.fromkeys(runs, steps.SPARSE_BATCH), rounds)
    p = problems["step K=23 P=10 N=120"]
    times["frame"] = _median_us(lambda: fit(p.body, p.measurements), rounds)
    seen = [p.measurements] * CLIP_FRAMES
    times["clip"] = _median_us(lambda: fit_clip(p.body, seen), max(3, rounds // 10))
    print(json.dumps(times))


def _median_us(call: Callable[[], object], rounds: int) -> float:
    call()  # compile
    found = []
    for _ in range(rounds):
        start_s = time.process_time()
        call()
        found.append(time.process_time() - start_s)
    return 1e6 * float(np.median(found))
