# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands whose results the page shows, and what running them gave."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..frames import DATA, ROOT

SCRIPTS = {"bench": "scope.benchmarks", "gate": "scope.benchmarks.gate", "capture": "scope.scope_addon"}


@dataclass(frozen=True)
class Command:
    """A script of the repository with its arguments, and the section of the page that its results are."""

    title: str
    script: str
    arguments: tuple[str, ...]

    @property
    def text(self) -> str:
        """The command as it is typed."""
        return f"./scripts/{self.script} {shlex.join(self.arguments)}".strip()


@dataclass(frozen=True)
class Outcome:
    """What a command printed, its figures, how long it took and its exit status."""

    command: Command
    printed: str
    said: str
    figures: dict[str, Any]
    seconds: float
    status: int


LONG = (  # what takes hours together, and is left out of a quick run
    Command("Accuracy and speed of captures", "bench", ("perception",)),
    Command("What each part of the pipeline brings", "bench", ("ablation",)),
    Command("Rendered clips with exact truth", "bench", ("renders",)),
    Command("Rendered scenes of many people", "bench", ("scenes",)),
    Command("An optimizer in the manner of SMPLify", "bench", ("smplify",)),
    Command("How well captured bodies cover the people", "bench", ("outline",)),
    Command("Expressions and gaze on rendered faces", "bench", ("faces",)),
)


def commands(quick: bool) -> list[Command]:
    """Return the commands; those that need data which is not there say so themselves."""
    listed = [
        Command("Accuracy and ratios of times against the record", "gate", ()),
        Command("Speed of the solver", "bench", ("solver", *(("--quick",) if quick else ()))),
    ]
    return listed if quick else [*listed, *LONG]


def clips(quick: bool) -> list[tuple[str, Path]]:
    """Return names and paths of the clips that are captured for the strips: our own, and those with truth beside it."""
    from ...scope_addon.cli import SAMPLE

    found = sorted((DATA / "pose2sim").glob("cam?.mp4"))
    return [("sample", SAMPLE), *((path.stem, path) for path in (found[:1] if quick else found))]


def run(command: Command, folder: Path, say: Callable[[str], None]) -> Outcome:
    """Run a command of `commands`, which writes its figures as JSON into the folder.

    :param say: called with what is running.
    """
    path = folder / f"{'-'.join((command.script, *command.arguments)).replace('--', '')}.json"
    path.unlink(missing_ok=True)
    say(f"running {command.text}")
    arguments = [sys.executable, "-m", SCRIPTS[command.script], *command.arguments, "--json", str(path)]
    since = time.monotonic()
    done = subprocess.run(arguments, capture_output=True, text=True, cwd=ROOT, check=False)
    figures = json.loads(path.read_text("utf-8")) if path.is_file() else {}
    return Outcome(command, done.stdout, done.stderr, figures, time.monotonic() - since, done.returncode)


def run_capture(video: Path, target: Path, say: Callable[[str], None]) -> Outcome:
    """Capture a clip into the motion file ``target``; the figures are the capture's report."""
    command = Command(video.name, "capture", (str(video), "-o", str(target), "--json", "--quiet"))
    target.unlink(missing_ok=True)
    say(f"running {command.text}")
    since = time.monotonic()
    arguments = [sys.executable, "-m", SCRIPTS["capture"], "capture", *command.arguments]
    done = subprocess.run(arguments, capture_output=True, text=True, cwd=ROOT, check=False)
    figures = json.loads(done.stdout) if done.returncode == 0 else {}
    return Outcome(command, "", done.stderr, figures, time.monotonic() - since, done.returncode)
