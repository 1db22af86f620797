# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the targets on damaged inputs: ``./scripts/fuzz [SECONDS]``. What fails is kept in build/fuzz/.

Each target runs in a process of its own, because a library may crash; the input is on disk before it is read.
"""

from __future__ import annotations

import hashlib
import os
import random
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

from scope.solver.errors import ScopeError

from .mutate import mutate
from .targets import TARGETS

ROOT = Path(__file__).resolve().parents[2]
CORPUS = Path(__file__).with_name("corpus")
FOUND = ROOT / "build" / "fuzz"
SLOWEST_S = 20.0  # of one input; a hang ends the process
_STACKED = 0.3  # share of inputs that are damaged again


def inputs(name: str, folder: Path, seed: int) -> Iterator[Path]:
    """Yield a target's past findings, then damaged inputs without end, each as a file."""
    target, chance = TARGETS[name], random.Random(f"{name} {seed}")
    pool = [*target.seeds(folder), *(path.read_bytes() for path in sorted(CORPUS.glob(f"{name}-*")))]
    for data in pool:
        yield from _written(folder, target.suffixes, data)
    while True:
        data = mutate(chance.choice(pool), chance)
        while chance.random() < _STACKED:
            data = mutate(data, chance)
        path = folder / f"input{chance.choice(target.suffixes)}"
        path.write_bytes(data)
        yield path


def _written(folder: Path, suffixes: tuple[str, ...], data: bytes) -> Iterator[Path]:
    for suffix in suffixes:
        path = folder / f"input{suffix}"
        path.write_bytes(data)
        yield path


def check(name: str, path: Path) -> None:
    """Read an input.

    :raises Exception: whatever is not a ScopeError, or a ScopeError of several lines.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            TARGETS[name].read(path)
        except ScopeError as error:
            if "\n" in str(error).strip():
                raise AssertionError(f"several lines: {error}") from error


def run_target(name: str, seconds: float, seed: int) -> None:
    """Read inputs for some time; the last one stays when the process ends by an exception or a crash."""
    import faulthandler

    folder = FOUND / name
    folder.mkdir(parents=True, exist_ok=True)
    end, count = time.monotonic() + seconds, 0
    for path in inputs(name, folder, seed):
        faulthandler.dump_traceback_later(SLOWEST_S, exit=True)
        check(name, path)
        faulthandler.cancel_dump_traceback_later()
        count += 1
        if time.monotonic() > end:
            break
    print(f"{name}: {count} inputs", flush=True)


def main(seconds: float) -> int:
    """Run every target for its share of the time; return how many failed."""
    failed = 0
    for name in TARGETS:
        end = time.monotonic() + seconds / len(TARGETS)
        while (left := end - time.monotonic()) > 0:
            seed = int.from_bytes(os.urandom(4), "little")
            command = [sys.executable, "-m", __spec__.name, name, str(left), str(seed)]
            done = subprocess.run(command, stderr=subprocess.PIPE, text=True, errors="replace", check=False)
            if done.returncode == 0:
                break
            failed += 1
            last = max((FOUND / name).glob("input.*"), key=lambda path: path.stat().st_mtime)
            kept = FOUND / f"{name}-{hashlib.sha256(last.read_bytes()).hexdigest()[:12]}{last.suffix}"
            kept.write_bytes(last.read_bytes())
            print(f"{name}: status {done.returncode} on {kept}\n{done.stderr[-1500:]}", flush=True)
    return failed


if __name__ == "__main__":
    if len(sys.argv) == 4:
        run_target(sys.argv[1], float(sys.argv[2]), int(sys.argv[3]))
        os._exit(0)  # without Blender's exit handlers
    sys.exit(min(main(float(sys.argv[1]) if len(sys.argv) > 1 else 120.0), 1))
