# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands whose results the page shows, and what running them gave."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...scope_addon.capture.options import CaptureOptions
from ..frames import CACHE, DATA, ROOT

WITHOUT_TRUTH = (  # clips of people
    *(
        "run_moving_camera",
        "gesture_square",
        "squats_5fps",
        "sit_stand_close",
        "two_people_portrait",
    ),
    "walk_side_static",
)
LOAD_EVERY_S = 10.0
SCENES_OF = {  # of each split
    "development": "the development scenes",
    "test": "the test scenes",
    "new_performers": "the scenes of new performers",
}
SCRIPTS = {
    "bench": "scope.benchmarks",
    "gate": "scope.benchmarks.gate",
    "capture": "scope.scope_addon",
}


@dataclass(frozen=True)
class Command:
    """A script of the repository with its arguments, and the section of the page that its results
    are.
    """

    title: str
    script: str
    arguments: tuple[str, ...]

    @property
    def text(self) -> str:
        """The command as it is typed."""
        return f"./scripts/{self.script} {shlex.join(self.arguments)}".strip()


@dataclass(frozen=True)
class Outcome:
    """What a command printed, its figures, how long it took and its exit status.

    ``processor_seconds`` are those of the command and all that it started, in all threads. ``load``
    is the mean number of processes that ran or waited for a core meanwhile, the command's own
    included. Both are None where the system does not tell, and in runs recorded before they were
    measured.
    """

    command: Command
    printed: str
    said: str
    figures: dict[str, Any]
    seconds: float
    status: int
    processor_seconds: float | None = None
    load: float | None = None


LONG = (  # what takes hours together, and is left out of a quick run
    Command("Accuracy and speed of captures", "bench", ("perception",)),
    Command("What each part of the pipeline brings", "bench", ("ablation",)),
    Command("Rendered clips with exact truth", "bench", ("renders",)),
    Command("Rendered scenes of many people", "bench", ("scenes",)),
    Command("Single frames as images", "bench", ("stills",)),
    Command("Two people whose truth is triangulated", "bench", ("two_people",)),
    Command("Climbs onto boxes, with one floor and with uneven ground", "bench", ("climbs",)),
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
    """Return names and paths of the clips that are captured for the strips.

    Our own, those with ground truth and, unless ``quick``, those without, in which somebody is.
    """
    from ...scope_addon.cli import SAMPLE

    with_truth = sorted((DATA / "pose2sim").glob("cam?.mp4"))
    without = (
        []
        if quick
        else [path for name in WITHOUT_TRUTH if (path := DATA / "clips" / f"{name}.mp4").is_file()]
    )
    return [
        ("sample", SAMPLE),
        *((path.stem, path) for path in (with_truth[:1] if quick else with_truth) + without),
    ]


def truth_of(video: Path) -> Path | None:
    """Return the file with the true joints of a clip of one person, None if there is none."""
    for name in (f"truth_{video.stem}.npz", f"{video.stem}_truth.npz"):
        if (path := video.with_name(name)).is_file():
            with np.load(path) as file:
                return path if "joints" in file.files else None
    return None


def worst_clips(measured: Sequence[Outcome]) -> list[tuple[str, Path, str]]:
    """Return names and paths of the worst rendered clips and scenes of those measured, each once,
    and the reasons.

    Two of the renders, and of each split the scene of the worst person and one in which somebody
    was never found, with the default preset and nothing given.
    """
    found: list[tuple[Path, str]] = []
    for outcome in measured:
        if outcome.command.arguments[:1] == ("renders",) and outcome.figures:
            clips = outcome.figures[CaptureOptions().quality]["nothing given"]
            shots = {name: row for name, row in clips.items() if name not in ("mean", "sample")}
            errors = {name: row["mpjpe_root"] for name, row in shots.items() if "mpjpe_root" in row}
            for name in sorted(errors, key=lambda k: -errors[k])[:2]:
                why = (
                    f"One of the two worst of the rendered clips: MPJPE-root is {errors[name]:.1f} "
                    f"mm."
                )
                found.append((CACHE / "renders" / f"{name}.mp4", why))
        if outcome.command.arguments[:1] == ("scenes",):
            for split, figures in outcome.figures.items():
                people = [
                    row
                    for row in figures["people"]["default preset"]
                    if np.isfinite(row["mpjpe_root"])
                ]
                if people:
                    worst = max(people, key=lambda row: row["mpjpe_root"])
                    why = (
                        f"The worst person of {SCENES_OF[split]}: MPJPE-root is "
                        f"{worst['mpjpe_root']:.1f} mm."
                    )
                    found.append((CACHE / "scenes" / f"{worst['clip']}.mp4", why))
                for row in [row for row in figures["people"]["default preset"] if not row["found"]][
                    :1
                ]:
                    why = f"A person of {SCENES_OF[split]} who was not found in any frame."
                    found.append((CACHE / "scenes" / f"{row['clip']}.mp4", why))
    reasons: dict[Path, list[str]] = {}
    for path, why in found:
        reasons.setdefault(path, []).append(why)
    return [(path.stem, path, " ".join(texts)) for path, texts in reasons.items() if path.is_file()]


def motion_files(folder: Path, name: str) -> list[Path]:
    """Return the motion files of the people of a clip, the most prominent first."""
    one = folder / f"{name}.npz"
    if one.is_file():
        return [one]
    numbered = re.compile(rf"{re.escape(name)}\.person(\d+)\.npz")
    found = {
        int(match[1]): path for path in folder.iterdir() if (match := numbered.fullmatch(path.name))
    }
    return [found[number] for number in sorted(found)]


def run(command: Command, folder: Path, say: Callable[[str], None]) -> Outcome:
    """Run a command of `commands`, which writes its figures as JSON into the folder.

    :param say: called with what is running.
    """
    path = folder / f"{'-'.join((command.script, *command.arguments)).replace('--', '')}.json"
    path.unlink(missing_ok=True)
    say(f"running {command.text}")
    done = timed(command, ["-m", SCRIPTS[command.script], *command.arguments, "--json", str(path)])
    return replace(done, figures=json.loads(path.read_text("utf-8")) if path.is_file() else {})


def run_capture(video: Path, target: Path, say: Callable[[str], None]) -> Outcome:
    """Capture a clip into the motion file ``target``; the figures are the capture's report.

    Of clips without ground truth everybody is captured, each into a file of their own: see
    `motion_files`.
    """
    people = () if truth_of(video) else ("--people", "all")
    files = (_from_root(video), "-o", _from_root(target))
    command = Command(video.name, "capture", (*files, *people, "--json", "--quiet"))
    target.parent.mkdir(parents=True, exist_ok=True)
    for path in motion_files(target.parent, target.stem):
        path.unlink()
    say(f"running {command.text}")
    done = timed(command, ["-m", SCRIPTS["capture"], "capture", *command.arguments])
    return replace(done, printed="", figures=json.loads(done.printed) if done.status == 0 else {})


def _from_root(path: Path) -> str:
    """Return a path of the checkout or beside it as seen from the root folder, where commands run;
    others as given.
    """
    return (
        Path(os.path.relpath(path, ROOT)).as_posix()
        if path.is_relative_to(ROOT.parent)
        else str(path)
    )


def timed(command: Command, arguments: Sequence[str]) -> Outcome:
    """Run Python with arguments, from the root folder, as a command; return its outcome, without
    figures.
    """
    since = time.monotonic()
    before = _processor_seconds()
    loads: list[float] = []
    with subprocess.Popen(
        [sys.executable, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    ) as process:
        try:
            while True:
                try:
                    printed, said = process.communicate(timeout=LOAD_EVERY_S)
                    break
                except subprocess.TimeoutExpired:
                    loads += _load()
        except BaseException:  # such as Ctrl-C
            process.kill()
            raise
    loads += _load()
    spent = _processor_seconds() - before
    load = sum(loads) / len(loads) if loads else None
    return Outcome(
        command,
        printed,
        said,
        {},
        time.monotonic() - since,
        process.returncode,
        spent or None,
        load,
    )


def _processor_seconds() -> float:
    """Return the processor time of all processes that this one has waited for, and of theirs; 0 on
    Windows.
    """
    times = os.times()
    return times.children_user + times.children_system


def _load() -> list[float]:
    """Return the load average over a minute, the shortest that there is, as one number; none on
    Windows.
    """
    return [os.getloadavg()[0]] if hasattr(os, "getloadavg") else []
