# SPDX-License-Identifier: GPL-3.0-or-later
"""A run of the report as a file, from which its page can be made again without measuring
anything.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...scope_addon.atomic_write import atomic_path
from ...solver.errors import InputError
from .commands import Command, Outcome

FILE = "run.json"  # in the folder of the run, beside the motion files of its clips
PREVIOUS = "run.previous.json"  # the run before it, whose motion files may be gone


@dataclass(frozen=True)
class Run:
    """What the commands gave: clips with names and videos, and measurements; when; facts about the
    machine.

    ``quick``: whether it leaves out what takes long.
    """

    captured: list[tuple[str, Path, Outcome]]
    measured: list[Outcome]
    time: str
    facts: dict[str, str]
    quick: bool

    @property
    def everything(self) -> list[Outcome]:
        """The outcomes of all commands."""
        return [*(outcome for _, _, outcome in self.captured), *self.measured]


def write_run(folder: Path, run: Run) -> None:
    """Write a run into its folder, for `read_run`.

    :raises OSError: the file cannot be written.
    """
    captured = [
        {"name": name, "video": str(video), "outcome": asdict(outcome)}
        for name, video, outcome in run.captured
    ]
    measured = [asdict(outcome) for outcome in run.measured]
    content = {"time": run.time, "facts": run.facts, "quick": run.quick}
    content |= {"captured": captured, "measured": measured}
    with atomic_path(folder / FILE) as temporary:
        temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")


def set_aside(folder: Path) -> None:
    """Rename the run in a folder, if there is one, to `PREVIOUS`: one that starts is not to be
    mistaken for it.

    :raises OSError: the file cannot be renamed.
    """
    if (folder / FILE).is_file():
        (folder / FILE).replace(folder / PREVIOUS)


def read_run(folder: Path) -> Run:
    """Return the run that `write_run` has written into a folder.

    :raises InputError: there is none, or it is of another version.
    """
    try:
        content = json.loads((folder / FILE).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{folder} holds no run of ./scripts/report: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{folder / FILE} is no JSON: {error}") from error
    try:
        captured = [
            (each["name"], Path(each["video"]), _outcome(each["outcome"]))
            for each in content["captured"]
        ]
        measured = [_outcome(each) for each in content["measured"]]
        return Run(
            captured, measured, content["time"], content["facts"], content.get("quick", False)
        )
    except (KeyError, TypeError) as error:
        raise InputError(
            f"{folder / FILE} is not of this version; run ./scripts/report again"
        ) from error


def _outcome(entry: dict[str, Any]) -> Outcome:
    command = entry["command"]
    return Outcome(
        **{
            **entry,
            "command": Command(command["title"], command["script"], tuple(command["arguments"])),
        }
    )
