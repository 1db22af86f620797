# SPDX-License-Identifier: GPL-3.0-or-later
"""Kill commands at every write, let every write or allocation fail, and run them again:
``./scripts/fuzz --faults``.

Old files or complete new ones, one sentence, leftovers only of a killed process, and none after the
next run.
"""

from __future__ import annotations

import itertools
import math
import os
import random
import re
import sys
import tempfile
import time
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

from scope.scope_addon.footage import FOOTAGE_SUFFIXES

from .commands import CACHE, COMMANDS, INPUTS, PARENTS, Command
from .disks import DISKS, Disk, new_disk, problem_with
from .system_calls import CUT, KILL, KILL_PARENT, Traced, traced

OLD = b"an earlier result"
LONGEST_S = 10.0  # that a process may last after its parent
REMOVALS = ("unlink", "rmdir")  # what could not be removed, the next run removes
FOLDERS = ("in", "out", "tmp", "clips", "home")
# what a command that failed continues with, and then removes
UNFINISHED = "home/scope-mocap/unfinished/"
SEEN = ("out", "tmp", "home")  # folders in which nothing may be left
# may be empty
KEPT_FOLDERS = (
    *("scope-mocap", "cache", "captures", "jobs", "kernels", "1" * 32, "unfinished", "recordings"),
)
# How long the stages of the last captures took, and the empty locks of killed captures, which the
# next one removes, but not a command whose results are all there.
KEPT_FILE = re.compile(f"{CACHE}/times.json|{UNFINISHED}[0-9a-f-]*.lock")
# What a live capture that was killed leaves on purpose, until the user finishes it.
RECORDED = re.compile(r".*\.recording(\.lock)?|.*\.unfinished( \d+)?\.mp4")


class Workplace:
    """A folder with what a command needs, in which it runs again and again."""

    def __init__(self, folder: Path, command: Command, disk: Disk | None = None) -> None:
        self._folder = folder.resolve()
        self._disk = disk
        self._command = command
        self._whole = dict[str, bytes]()
        for name in FOLDERS:
            (self._folder / name).mkdir()
        for name in command.needs:
            INPUTS[name](self._folder)

    def prepare(self) -> int:
        """Run the command as a whole, and return how many of its system calls count."""
        ended = self._run(0, KILL)
        assert ended.status == 0, ended.stderr
        paths = [path for pattern in self._command.outputs for path in self._folder.glob(pattern)]
        self._whole = {str(path.relative_to(self._folder)): path.read_bytes() for path in paths}
        assert len(self._whole) >= len(self._command.outputs), (
            f"of {self._command.outputs}, {paths} were written"
        )
        assert not self.leftovers(), f"{self.leftovers()} were left without any fault"
        return len(ended.calls)

    def _run(self, n: int, action: str) -> Traced:
        command = [sys.executable, "-m", self._command.module, *self._command.arguments]
        environment = dict(
            os.environ, TMPDIR=str(self._folder / "tmp"), XDG_CACHE_HOME=str(self._folder / "home")
        )
        here = os.getcwd()
        os.chdir(self._folder)
        try:
            image = None if self._disk is None else self._disk.image
            return traced(command, self._folder, n, action, environment, image)
        finally:
            os.chdir(here)

    def fault(self, n: int, action: str) -> bool:
        """Run the command on old files with a fault at its n-th call; return whether there were
        that many calls.

        :raises AssertionError: something is not as it should be.
        """
        self._put_old_files()
        if self._disk is not None:
            self._disk.sync()
        ended = self._run(n, action)
        if len(ended.calls) < n:
            return False
        at = f"after {action} at call {n}, {ended.calls[n - 1]}"
        if self._disk is not None:
            self._disk.restart()
        self._check_files(at)
        if action == KILL_PARENT:
            assert ended.seconds < LONGEST_S, f"{at}: a process lasted {ended.seconds:.1f} s"
            assert not self._footage(), f"{at}: {self._footage()} were left"
        if action not in (KILL, CUT, KILL_PARENT):
            self._check_end(ended, at)
            left = [
                name
                for name in self.leftovers()
                if not (self._command.continues and name.startswith(UNFINISHED))
            ]
            if not ended.calls[n - 1].startswith(REMOVALS):
                assert not left, f"{at}: {left} were left"
        return True

    def check_what_was_said_to_be_there(self) -> None:
        """Cut the power after the command has ended well.

        :raises AssertionError: a result is not whole.
        """
        assert self._disk is not None
        self._put_old_files()
        ended = self._run(0, CUT)
        assert ended.status == 0, ended.stderr
        self._disk.cut()
        for name in self._whole:
            assert self._is_whole(name), f"{name} after a power cut after the end"

    def _footage(self) -> list[str]:
        """Return the images and videos in the folders for temporary files."""
        found = [path for path in (self._folder / "tmp").rglob("*") if path.is_file()]
        return [path.name for path in found if path.suffix.lower() in FOOTAGE_SUFFIXES]

    def state(self) -> object:
        """Return what the next run finds, apart from random names and the contents of leftovers."""
        left = {
            re.sub(r"[-.][^/.]*-[^/.]*|(?<=blender_)\w+", "-*", name) for name in self.leftovers()
        }
        return frozenset(left), frozenset(name for name in self._whole if self._is_old(name))

    def problems_of_next_run(self, after: str) -> list[str]:
        """Run the command without a fault, and return in sentences what is wrong with what it
        leaves.
        """
        try:
            self._run_again()
        except AssertionError as error:
            return [f"{error}, {after}"]
        return []

    def _run_again(self) -> None:
        before = self.leftovers()
        ended = self._run(0, KILL)
        assert ended.status == 0, f"the next run: {ended.stderr}"
        for name in self._whole:
            assert self._is_whole(name), f"{name} after the next run"
        assert not self.leftovers(), (
            f"{self.leftovers()} were left by the next run, {before} before it"
        )

    def _put_old_files(self) -> None:
        for name in self._whole:
            if self._command.replaces:
                (self._folder / name).write_bytes(OLD)
            else:
                (self._folder / name).unlink(missing_ok=True)

    def _check_files(self, at: str) -> None:
        for name in self._whole:
            if not (self._folder / name).is_file():
                assert not self._command.replaces, f"{at}: {name} is lost"
                continue
            assert self._is_old(name) or self._is_whole(name), (
                f"{at}: {name} is neither old nor whole"
            )

    def _is_old(self, name: str) -> bool:
        path = self._folder / name
        return not path.is_file() or path.read_bytes() == OLD

    def _is_whole(self, name: str) -> bool:
        path = self._folder / name
        return path.is_file() and self._command.is_whole(path, self._whole[name])

    def _check_end(self, ended: Traced, at: str) -> None:
        said = [line for line in ended.stderr.splitlines() if "warning:" not in line]
        assert ended.status in (0, 1), f"{at}: status {ended.status}, {ended.stderr[-2000:]}"
        assert "Traceback" not in ended.stderr, f"{at}: {ended.stderr}"
        assert "internal error" not in ended.stderr, f"{at}: {ended.stderr}"
        assert "a bug in Scope" not in ended.stderr, f"{at}: {ended.stderr}"
        if ended.status and self._command.tells:
            assert len(said) == 1, f"{at}: {ended.stderr}"
            assert said[0].startswith("scope: "), f"{at}: {ended.stderr}"

    def leftovers(self) -> list[str]:
        """Return what lies in the folders for results, caches and temporary files, besides results
        and captures.
        """
        found = [path for name in SEEN for path in (self._folder / name).rglob("*")]
        found = [path for path in found if self._folder / CACHE / "captures" not in path.parents]
        found = [path for path in found if RECORDED.fullmatch(path.name) is None]
        files = [
            path
            for path in found
            if path.is_file() or (not any(path.iterdir()) and not _may_be_empty(path))
        ]
        names = {str(path.relative_to(self._folder)) for path in files} - set(self._whole)
        return sorted(name for name in names if KEPT_FILE.fullmatch(name) is None)


def _may_be_empty(path: Path) -> bool:
    """Whether this is a folder of ours that stays, or one of a killed Blender, in whose panel a
    capture was started.
    """
    # a shell's are in a folder of ours
    of_blender = path.name.startswith("blender_") and path.parent.name == "tmp"
    return path.name in KEPT_FOLDERS or of_blender or "thumbnails" in path.parts


def check_command(
    command: Command,
    action: str,
    calls: Iterable[int] | None = None,
    kind: str = "ext4",
    longest_s: float = math.inf,
) -> tuple[int, list[str]]:
    """Run a command with a fault at each of its calls, again after each kill that leaves something
    else.

    At the end, it runs once more without a fault, unless that was the last thing it did, or only
    some calls failed of a command that finds nothing but its old results.

    :param calls: only these; negative ones count from the last.
    :param kind: of the disk whose power is cut, see `DISKS`.
    :param longest_s: after which no further fault begins; calls are then drawn at random.
    :return: how many faults there were, and what was not as it should be.
    """
    with ExitStack() as stack:
        disk = None if action != CUT else stack.enter_context(new_disk(kind))
        folder = (
            Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="scope-faults-")))
            if disk is None
            else disk.folder
        )
        place = Workplace(folder, command, disk)
        count = place.prepare()
        numbers: Iterable[int] = itertools.count(1)
        if calls is not None:
            numbers = (n if n > 0 else count + 1 + n for n in calls)
        elif longest_s < math.inf:
            numbers = random.sample(range(1, count + 1), count)
        end_s = time.monotonic() + longest_s
        done = 0
        problems = []
        seen = set[object]()
        ran_again = False
        for n in numbers:
            if time.monotonic() > end_s:
                break
            ran_again = False
            try:
                if not place.fault(n, action):
                    break
            except AssertionError as error:
                problems.append(str(error))
            done += 1
            if (action in (KILL, CUT, KILL_PARENT) or place.leftovers()) and (
                command.continues or place.state() not in seen
            ):
                seen.add(place.state())
                problems += place.problems_of_next_run(f"after {action} at call {n}")
                ran_again = True
        if disk is not None:
            try:
                place.check_what_was_said_to_be_there()
            except AssertionError as error:
                problems.append(str(error))
        if not ran_again and (calls is None or not command.replaces):
            problems += place.problems_of_next_run(f"after all faults of {action}")
        return done, problems


def chosen(names: list[str]) -> list[tuple[Command, str]]:
    """Return the commands and faults that are named; all commands if none is, and all faults if
    none is.

    :raises SystemExit: there is no command and no fault of a name.
    """
    commands = [command for command in COMMANDS if command.name in names] or list(COMMANDS)
    actions = [action for action in PARENTS if action in names] or list(PARENTS)
    known = {*(command.name for command in COMMANDS), *PARENTS}
    if unknown := sorted(set(names) - known):
        sys.exit(
            f"fuzz: no command or fault {', '.join(unknown)}; there are {', '.join(sorted(known))}"
        )
    return [
        (command, action) for command in commands for action in actions if action in command.actions
    ]


def main(names: list[str]) -> int:
    """Run all commands with all faults, or those named; return the exit status.

    :param names: a number among them is of minutes, which all have together: each command and
        fault gets an equal share of what is left, and tries as many calls as it can in it.
    """
    minutes = [float(name) for name in names if name.isdecimal()]
    runs = [
        (command, action, kind)
        for command, action in chosen([name for name in names if not name.isdecimal()])
        for kind in (DISKS if action == CUT else ("",))
    ]
    if minutes:
        random.shuffle(runs)  # as there may not be time for all
    failed = False
    total = 0
    end_s = time.monotonic() + 60 * sum(minutes)
    for number, (command, action, kind) in enumerate(runs):
        what = f"{command.name}, {action} {kind}".rstrip()
        if kind and (problem := problem_with(kind)):
            print(f"{what}: not tried, since {problem}", flush=True)
            continue
        start = time.monotonic()
        if minutes and start > end_s:
            print(f"{what}: not tried, since the time is over", flush=True)
            continue
        share_s = max(0.0, end_s - start) / (len(runs) - number) if minutes else math.inf
        count, problems = check_command(command, action, kind=kind or "ext4", longest_s=share_s)
        print(f"{what}: {count} faults in {time.monotonic() - start:.0f} s", flush=True)
        for problem in problems:
            print(f"    {problem}", flush=True)
        failed = failed or bool(problems)
        total += count
    print(f"{total} faults in all", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
