# SPDX-License-Identifier: GPL-3.0-or-later
"""Kill commands at every write, let every write or allocation fail, and run them again: ``./scripts/fuzz --faults``.

Old files or complete new ones, one sentence, leftovers only of a killed process, and none after the next run.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scope.solver.loaders.body_file import load_body

from ..made_motion import made_motion
from .system_calls import FULL, KILL, NO_MEMORY, Traced, traced

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = (sys.executable, "-m", "scope.scope_addon")
OLD = b"an earlier result"
ACTIONS = (KILL, FULL, NO_MEMORY)
SIZES = 0.05  # by which a format may differ that states times
TIMES_OF = (".fbx", ".blend", ".usdc", ".html", ".json")  # formats that differ each time


class Command(NamedTuple):
    """A command to kill.

    :param arguments: of Scope; relative paths are below the folder of the test.
    :param outputs: what it writes.
    """

    name: str
    arguments: tuple[str, ...]
    outputs: tuple[str, ...]


def _import(suffix: str) -> Command:
    return Command(suffix[1:], ("import", "in/walk.npz", "-o", f"out/walk{suffix}"), (f"out/walk{suffix}",))


COMMANDS = (
    *map(_import, (".npz", ".bvh", ".glb", ".usdc", ".blend", ".fbx")),
    Command(
        "capture",
        ("capture", "in/still.png", "-o", "out/still.npz", "--overlay", "out/still.png", "--report", "out/still.html"),
        ("out/still.npz", "out/still.png", "out/still.html"),
    ),
    Command(
        "batch",
        ("batch", "clips", "--out", "out", "--formats", "npz", "--quality", "fast"),
        ("out/a.npz", "out/b.npz", "out/scope-batch.json"),
    ),
    Command(
        "overlay",
        ("capture", "in/short.mp4", "-o", "out/short.npz", "--overlay", "out/short.mp4", "--quality", "fast"),
        ("out/short.npz", "out/short.mp4"),
    ),
)


class Workplace:
    """A folder with a motion, a picture and two clips, in which a command runs again and again."""

    def __init__(self, folder: Path, command: Command) -> None:
        self._folder, self._command = folder.resolve(), command
        self._temporary, self._whole = self._folder / "tmp", dict[str, bytes]()
        for name in ("in", "out", "tmp", "clips"):
            (self._folder / name).mkdir()
        body = load_body("scope")
        made_motion(body, np.zeros((2, 3 * (body.K + 1))), np.zeros((2, 3))).save(self._folder / "in" / "walk.npz")
        self._make_footage()

    def _make_footage(self) -> None:
        if self._command.name not in ("capture", "batch", "overlay"):
            return
        sample = str(ROOT / "assets" / "sample" / "sample.mp4")
        _, picture = cv2.VideoCapture(sample).read()
        cv2.imwrite(str(self._folder / "in" / "still.png"), picture)
        for name in "ab":
            shutil.copy(self._folder / "in" / "still.png", self._folder / "clips" / f"{name}.png")
        shutil.copy(sample, self._folder / "in" / "short.mp4")

    def _arguments(self) -> list[str]:
        extra = ["--end", "0.2"] if self._command.name == "overlay" else []
        return [*PROGRAM, *self._command.arguments, *extra]

    def prepare(self) -> int:
        """Run the command as a whole, and return how many of its system calls count."""
        ended = self._run(0, KILL)
        assert ended.status == 0, ended.stderr
        self._whole = {name: (self._folder / name).read_bytes() for name in self._command.outputs}
        return len(ended.calls)

    def _run(self, n: int, action: str) -> Traced:
        environment = dict(os.environ, TMPDIR=str(self._temporary))
        here = os.getcwd()
        os.chdir(self._folder)
        try:
            return traced(self._arguments(), self._folder, n, action, environment)
        finally:
            os.chdir(here)

    def fault(self, n: int, action: str) -> bool:
        """Run the command on old files with a fault at its n-th call; return whether there were that many calls.

        :raises AssertionError: something is not as it should be.
        """
        self._put_old_files()
        ended = self._run(n, action)
        if len(ended.calls) < n:
            return False
        at = f"after {action} at call {n}, {ended.calls[n - 1]}"
        self._check_files(at)
        left = self._others()
        if action != KILL:
            self._check_end(ended, at)
            assert not left, f"{at}: {left} were left"
        return True

    def problems_of_next_run(self, after: str) -> list[str]:
        """Run the command without a fault, and return in sentences what is wrong with what it leaves."""
        try:
            self._run_again()
        except AssertionError as error:
            return [f"{error}, {after}"]
        return []

    def _run_again(self) -> None:
        before = self._others()
        ended = self._run(0, KILL)
        assert ended.status == 0, f"the next run: {ended.stderr}"
        for name in self._command.outputs:
            assert self._is_whole(name), f"{name} after the next run"
        assert not self._others(), f"{self._others()} were left by the next run, {before} before it"

    def _put_old_files(self) -> None:
        for path in (self._folder / "out").iterdir():
            path.unlink()
        for name in self._command.outputs:
            (self._folder / name).write_bytes(OLD)

    def _check_files(self, at: str) -> None:
        for name in self._command.outputs:
            path = self._folder / name
            assert path.is_file(), f"{at}: {name} is lost"
            assert path.read_bytes() == OLD or self._is_whole(name), f"{at}: {name} is neither old nor whole"

    def _is_whole(self, name: str) -> bool:
        found, whole = (self._folder / name).read_bytes(), self._whole[name]
        if name.endswith(".json"):
            return all(entry["status"] in ("done", "skipped", "failed") for entry in json.loads(found)["files"])
        if name.endswith(TIMES_OF):
            return abs(len(found) - len(whole)) < SIZES * len(whole)
        return found == whole

    def _check_end(self, ended: Traced, at: str) -> None:
        said = [line for line in ended.stderr.splitlines() if "warning:" not in line]
        assert ended.status in (0, 1), f"{at}: status {ended.status}, {ended.stderr[-2000:]}"
        assert "Traceback" not in ended.stderr, f"{at}: {ended.stderr}"
        assert "internal error" not in ended.stderr, f"{at}: {ended.stderr}"
        if ended.status and self._command.name != "batch":
            assert len(said) == 1, f"{at}: {ended.stderr}"
            assert said[0].startswith("scope: "), f"{at}: {ended.stderr}"

    def _others(self) -> list[str]:
        """Return what lies in the output folder and in that for temporary files, besides the results."""
        found = [path for name in ("out", "tmp") for path in (self._folder / name).rglob("*")]
        names = {str(path.relative_to(self._folder)) for path in found} - set(self._command.outputs)
        return sorted(name for name in names if not _is_blenders(self._folder / name))


def _is_blenders(path: Path) -> bool:
    """Whether this is the empty folder that Blender makes, whose name does not tell whose it is."""
    return path.name.startswith("blender_") and path.is_dir() and not any(path.iterdir())


def check_command(command: Command, action: str, calls: Iterable[int] | None = None) -> tuple[int, list[str]]:
    """Run a command with a fault at each of its calls, and again after each.

    :param calls: only these; negative ones count from the last.
    :return: how many faults there were, and what was not as it should be.
    """
    with tempfile.TemporaryDirectory(prefix="scope-faults-") as folder:
        place = Workplace(Path(folder), command)
        count = place.prepare()
        chosen = itertools.count(1) if calls is None else (n if n > 0 else count + 1 + n for n in calls)
        done, problems = 0, []
        for n in chosen:
            try:
                if not place.fault(n, action):
                    break
            except AssertionError as error:
                problems.append(str(error))
            done += 1
            if action == KILL:  # what the others leave is checked at once
                problems += place.problems_of_next_run(f"after {action} at call {n}")
        return done, problems + place.problems_of_next_run(f"after all faults of {action}")


def main(names: list[str]) -> int:
    """Run all commands with all faults, or those named; return the exit status."""
    failed = False
    for command, action in itertools.product(COMMANDS, ACTIONS):
        if any(name not in (command.name, action) for name in names):
            continue
        start = time.monotonic()
        count, problems = check_command(command, action)
        print(f"{command.name}, {action}: {count} faults in {time.monotonic() - start:.0f} s", flush=True)
        for problem in problems:
            print(f"    {problem}", flush=True)
        failed = failed or bool(problems)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
