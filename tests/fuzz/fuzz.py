# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the targets on damaged inputs: ``./scripts/fuzz [SECONDS]``, ``./scripts/fuzz --bytes [N]``.

What fails is kept in build/fuzz/.

Each target runs in a process of its own, because a library may crash; the input is on disk before
it is read.
"""

from __future__ import annotations

import hashlib
import os
import random
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from scope.solver.errors import ScopeError

from .mutate import mutate
from .targets import TARGETS

ROOT = Path(__file__).resolve().parents[2]
CORPUS = Path(__file__).with_name("corpus")
FOUND = ROOT / "build" / "fuzz"
RANDOM_BYTES = 10_000_000  # for every target, before a release
SLOWEST_S = 20.0  # of one input; a hang ends the process
LARGEST_MB = 2600.0  # of a target's process; the largest picture that is read takes 2200
_STACKED = 0.3  # share of inputs that are damaged again
_LARGEST_NOISE = 16.0  # of a file of random bytes, in powers of two


@cache
def seeds(name: str) -> list[bytes]:
    """Return a target's valid inputs, which are made once in a process."""
    with tempfile.TemporaryDirectory(prefix="scope-fuzz-") as folder:
        return TARGETS[name].seeds(Path(folder))


def inputs(name: str, folder: Path, seed: int) -> Iterator[Path]:
    """Yield a target's past findings, then damaged inputs without end, each as a file."""
    target = TARGETS[name]
    chance = random.Random(f"{name} {seed}")
    pool = [
        *seeds(name),
        *(path.read_bytes() for path in sorted(CORPUS.glob(f"{name}-*"))),
    ]
    for data in pool:
        for suffix in target.suffixes:
            yield _written(folder, suffix, data)
    while True:
        data = mutate(chance.choice(pool), chance)
        while chance.random() < _STACKED:
            data = mutate(data, chance)
        yield _written(folder, chance.choice(target.suffixes), data)


def random_inputs(name: str, folder: Path, seed: int, count: int) -> Iterator[Path]:
    """Yield files of random bytes, and valid inputs of which a part is replaced by random bytes,
    ``count`` in all.
    """
    target = TARGETS[name]
    chance = random.Random(f"{name} {seed}")
    pool = seeds(name)
    while count > 0:
        noise = chance.randbytes(min(count, round(2 ** chance.uniform(0, _LARGEST_NOISE))))
        count -= len(noise)
        data = noise
        if chance.random() < 0.5:
            whole = chance.choice(pool)
            start = chance.randrange(len(whole) + 1)
            data = whole[:start] + noise + whole[start + len(noise) :]
        yield _written(folder, chance.choice(target.suffixes), data)


def _written(folder: Path, suffix: str, data: bytes) -> Path:
    path = folder / f"input{suffix}"
    path.write_bytes(data)
    return path


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


def run_target(name: str, seconds: float, seed: int, count: int = 0) -> None:
    """Read inputs; the last one stays when the process ends by an exception or a crash.

    :param seconds: for how long damaged inputs are read.
    :param count: of random bytes to read instead.
    """
    import faulthandler

    folder = FOUND / name
    folder.mkdir(parents=True, exist_ok=True)
    end = time.monotonic() + seconds
    done = 0
    for path in random_inputs(name, folder, seed, count) if count else inputs(name, folder, seed):
        faulthandler.dump_traceback_later(SLOWEST_S, exit=True)
        check(name, path)
        faulthandler.cancel_dump_traceback_later()
        assert _peak_megabytes() < LARGEST_MB, f"{_peak_megabytes():.0f} MB of memory"
        done += 1
        if not count and time.monotonic() > end:
            break
    random_bytes = f" with {count} random bytes" if count else ""
    print(
        f"{name}: {done} inputs{random_bytes}, at most {_peak_megabytes():.0f} MB of memory",
        flush=True,
    )


def _peak_megabytes() -> float:
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (
        1e6 if sys.platform == "darwin" else 1e3
    )


def main(seconds: float) -> int:
    """Run every target for its share of the time; return how many failed."""
    failed = 0
    for name in TARGETS:
        end = time.monotonic() + seconds / len(TARGETS)
        while (left := end - time.monotonic()) > 0:
            if _is_good(name, str(left)):
                break
            failed += 1
    return failed


def read_random_bytes(count: int) -> int:
    """Have every target read so many random bytes; return how many failed."""
    return sum(not _is_good(name, "0", str(count)) for name in TARGETS)


def _is_good(name: str, *limits: str) -> bool:
    """Run a target in a process of its own; keep the input that it failed on."""
    # In CI the inputs are the same every time, so that what fails is the change and not the luck of
    # the day.
    seed = "2" if os.environ.get("CI") else str(int.from_bytes(os.urandom(4), "little"))
    command = [sys.executable, "-m", __spec__.name, name, limits[0], seed, *limits[1:]]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, errors="replace", check=False)
    if done.returncode == 0:
        return True
    last = max((FOUND / name).glob("input.*"), key=lambda path: path.stat().st_mtime)
    kept = FOUND / f"{name}-{hashlib.sha256(last.read_bytes()).hexdigest()[:12]}{last.suffix}"
    kept.write_bytes(last.read_bytes())
    print(f"{name}: status {done.returncode} on {kept}\n{done.stderr[-1500:]}", flush=True)
    return False


if __name__ == "__main__":
    if sys.argv[1:2] == ["--bytes"]:
        sys.exit(min(read_random_bytes(int(sys.argv[2]) if len(sys.argv) > 2 else RANDOM_BYTES), 1))
    if len(sys.argv) >= 4:
        run_target(sys.argv[1], float(sys.argv[2]), int(sys.argv[3]), int(*sys.argv[4:]))
        os._exit(0)  # without Blender's exit handlers
    sys.exit(min(main(float(sys.argv[1]) if len(sys.argv) > 1 else 120.0), 1))
