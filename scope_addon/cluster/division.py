# SPDX-License-Identifier: GPL-3.0-or-later
"""Long clips that several workers observe, window by window, before one joins the windows and
captures the clip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..job.clips.task import COUNT, ClipTask, Entry
from ..temporary import remove

MAX_WINDOWS = 5  # in a task: what a lost worker costs
TASKS_PER_WORKER = 2  # at least, so that a faster worker gets more of them


@dataclass
class _Division:
    task: ClipTask  # the clip's
    key: str
    windows: int
    folder: Path
    left: set[str]  # ranges of windows
    frames: int = 0
    seconds: float = 0.0
    workers: set[str] = field(default_factory=set)


class Divisions:
    """The clips of a batch that are divided at present."""

    def __init__(self) -> None:
        self._open: dict[str, _Division] = {}

    def begin(self, task: ClipTask, entry: Entry, folder: Path, workers: int) -> list[ClipTask]:
        """Divide a clip, and return the tasks of its windows.

        :param entry: with the clip's key and the number of its windows.
        :param folder: in which the files of the windows are collected; it is created.
        :param workers: how many tasks can run at a time.
        :raises OSError: the folder cannot be created.
        """
        folder.mkdir(parents=True, exist_ok=True)
        ranges = window_ranges(int(entry["windows"]), workers)
        self._open[task.name] = _Division(
            task, entry["key"], int(entry["windows"]), folder, set(ranges)
        )
        return [task._replace(windows=each, key=entry["key"]) for each in ranges]

    def folder(self, task: ClipTask) -> Path:
        """Return the folder in which the windows of a task's clip are collected."""
        return self._open[task.name].folder

    def ended(self, task: ClipTask, worker: str, entry: Entry | None) -> list[ClipTask]:
        """Note that some windows were observed, or were given up; they are then left to the task
        that joins all.

        :param entry: of the windows; None: they were given up.
        :return: the task that joins the windows, when no others are left.
        """
        division = self._open[task.name]
        division.left.discard(task.windows)
        if entry is not None:
            division.frames += int(entry["report"].get("frames", 0))
            division.seconds += entry.get("seconds", 0.0)
            division.workers.add(worker)
        if division.left:
            return []
        return [division.task._replace(key=division.key, windows_folder=str(division.folder))]

    def close(self, task: ClipTask) -> tuple[int, dict[str, Any]]:
        """Forget a clip, and remove its windows.

        :return: how many of its frames were observed in windows, and what its entry in the report
            has besides.
        """
        division = self._open.pop(task.name, None)
        if division is None:
            return 0, {}
        remove(division.folder)
        about = {"windows": division.windows, "window_seconds": round(division.seconds, 2)}
        return division.frames, about | {"window_workers": sorted(division.workers)}


def window_ranges(windows: int, workers: int) -> list[str]:
    """Return ranges ``FIRST:END`` of successive windows, each of which becomes a task."""
    size = max(1, min(MAX_WINDOWS, math.ceil(windows / (TASKS_PER_WORKER * max(workers, 1)))))
    return [f"{first}:{min(first + size, windows)}" for first in range(0, windows, size)]


def is_part(task: ClipTask) -> bool:
    """Return whether a task is some windows of a clip."""
    return task.windows not in ("", COUNT)


def described(task: ClipTask) -> str:
    """Return what a task captures, for the log."""
    return f"{task.file} (windows {task.windows})" if is_part(task) else task.file
