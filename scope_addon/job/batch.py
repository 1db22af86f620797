# SPDX-License-Identifier: GPL-3.0-or-later
"""Capture a folder of footage, one process per clip: a clip that fails affects no other, finished
clips are skipped.

``scope-batch.json`` in the output folder is rewritten as clips finish, so that an interrupted batch
can continue. A clip is finished if its content (SHA-256), the options and the program are unchanged
and its result files have the sizes and SHA-256 that the report says. Clips whose results were
complete when a batch was killed, before it has written the report, are known by `clips.finished`.
An output folder with the results of another folder is refused: clips of the same names would
replace each other's.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ...solver.errors import InputError
from ..atomic_write import complete_file, resolve_link
from ..clock import Progress
from ..errors import NO_PERSON, OutputError, UsageError
from ..footage import FOOTAGE_SUFFIXES, display_text, json_text, unicode_text
from ..temporary import hold, release, remove
from .clip_runner import LocalRunner, Runner
from .clip_task import (
    FINISHED,
    NO_EXTRAS,
    OVERLAY,
    RATE,
    REPORT,
    CaptureSettings,
    ClipTask,
    Entry,
    Extras,
    find_clips,
    names_of_results,
)
from .finished_clip import finished_file, has_content
from .request import program_version

REPORT_NAME = "scope-batch.json"
LOCK_NAME = ".scope-batch.lock"
STATUSES = ("done", "skipped", "no_person", "failed")
# of the time that may be spent on writing the report, which grows with the number of clips
_WRITING_SHARE = 0.1
_QUICK_S = 0.1  # a report that is written faster is written after every clip


class Batch:
    """A folder of footage and an output folder.

    :param program: command that takes ``capture FILE -o OUT --json``.
    :param options: arguments of every capture: flag to text; None for a flag that takes no value.
    :param suffixes: suffixes of the result files, such as ``.npz``.
    :param extras: what else to write of each clip.
    :param is_mirror: the output folder stands for a store and has files of the same sizes, so that
        results of an earlier batch are compared by their sizes alone.
    :param further_files: see `CaptureSettings`.
    :raises InputError: the folder of footage does not exist.
    """

    def __init__(
        self,
        folder: Path,
        out: Path,
        program: Sequence[str],
        options: dict[str, str | None],
        suffixes: Sequence[str],
        extras: Extras = NO_EXTRAS,
        is_mirror: bool = False,
        further_files: Sequence[str] = (),
    ) -> None:
        if not folder.is_dir():
            raise InputError(f"{folder} is not a folder; give the folder with the footage")
        self.folder = folder.resolve()
        self.out = out.resolve()
        self.report_file = out / REPORT_NAME
        self.settings = CaptureSettings(options, tuple(suffixes), extras, tuple(further_files))
        self._program = list(program)
        self._is_mirror = is_mirror
        self._basis = self.settings.basis(program_version())
        self._next_report = 0.0
        self._reported: set[str] = set()  # clips of this run that the written report contains

    def clips(self, recursive: bool, views: bool = False) -> dict[str, Path]:
        """Return the clips by the name of their results; see `find_clips`."""
        several = self.settings.options.get("--people") not in (None, "1", "largest")
        return find_clips(
            self.folder,
            self.out,
            recursive=recursive,
            several_people=several,
            views=views,
            rate_given=RATE in self.settings.options,
        )

    def results(self, names: Iterable[str]) -> list[Path]:
        """Return the paths of all results of one person that the batch may write for the clips of
        these names.
        """
        suffixes = [*self.settings.suffixes]
        if self.settings.extras.reports:
            suffixes.append(f"{REPORT}.html")
        if self.settings.extras.overlays:
            suffixes += [f"{OVERLAY}.mp4", f"{OVERLAY}.png"]
        return [self.out / f"{name}{suffix}" for name in names for suffix in suffixes]

    def run(
        self,
        jobs: int,
        *,
        recursive: bool = False,
        views: bool = False,
        again: bool = False,
        progress: Progress = lambda *_: None,
        say: Callable[[str], None] = lambda text: None,
        runner: Runner | None = None,
    ) -> dict[str, Any]:
        """Capture the clips that are not finished and return the report, which is also written to
        disk.

        :param jobs: number of clips that are captured in parallel, by a runner of this machine.
        :param recursive: include subfolders.
        :param views: the videos of a subfolder are those of several cameras.
        :param again: capture finished clips as well.
        :param progress: called with the stage, the number of finished clips and that of all clips.
        :param say: called with messages for the user.
        :param runner: captures the clips; None for this machine.
        :return: the report; its ``exit_status`` is 1 if a clip failed, else 3 if a clip showed no
            person, else 0.
        :raises UsageError: the folder contains no footage, or another batch writes to the output
            folder, or it has the results of another folder.
        :raises OutputError: the output folder cannot be created, or the report cannot be written.
        """
        clips = self.clips(recursive, views)
        if not clips:
            raise UsageError(
                f"no footage in {self.folder}: no file ends with one of "
                f"{' '.join(FOOTAGE_SUFFIXES)}"
                + ("" if recursive else "; --recursive includes subfolders")
            )
        out = self.report_file.parent  # as it was given
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"cannot create the folder {out}: {error.strerror}; choose another with --out"
            ) from error
        with _alone_in(out):
            runner = runner or LocalRunner(self._program, jobs)
            known = self._previous_entries(clips, runner.report().get("folder", str(self.folder)))
            previous = {n: e for n, e in known.items() if n not in clips} if again else known
            entries: dict[str, Entry] = {}
            try:
                # The tasks are made within the try, because a signal can arrive as soon as the
                # first clip has begun.
                for finished in runner.outcomes(self._tasks(clips, previous, again)):
                    for name, entry in finished.items():
                        entries[name] = entry
                        _print_outcome(entry, f"{len(entries)}/{len(clips)}", say)
                    if finished:
                        self._write_report(_in_order(entries, clips), previous, runner, last=False)
                    progress("clips", len(entries), len(clips))
            except BaseException:
                entries = runner.stop() | entries
                with suppress(OutputError):
                    if entries:
                        self._write_report(_in_order(entries, clips), previous, runner, last=True)
                raise
            return self._write_report(_in_order(entries, clips), previous, runner, last=True)

    def _tasks(
        self, clips: dict[str, Path], previous: dict[str, Entry], again: bool
    ) -> Iterator[ClipTask]:
        """Yield the task of each clip."""
        for name, path in clips.items():
            file = path.relative_to(self.folder).as_posix()
            entry = None if again else previous.get(name)
            known = entry if entry and self._is_finished(name, entry) else None
            yield ClipTask(
                name,
                file,
                str(path),
                str(self.out),
                self._basis,
                self.settings,
                known,
                again=again,
            )

    def _is_finished(self, name: str, entry: Entry) -> bool:
        """Return whether an entry of the previous report is of a finished clip whose files are
        still as they were written.

        :param name: of the clip.
        """
        if entry.get("status") not in FINISHED:
            return False
        outputs = entry.get("outputs")
        content = entry.get("content", {})
        if not isinstance(outputs, list) or not all(isinstance(n, str) for n in outputs):
            return False
        if isinstance(content, dict):
            content = dict(zip(names_of_results(content, name), content.values(), strict=True))
        files = names_of_results(outputs, name)
        with suppress(OSError):  # of a name that no file can have
            return has_content(self.out, files, content, sizes_alone=self._is_mirror)
        return False

    def _previous_entries(self, clips: dict[str, Path], folder: str) -> dict[str, Entry]:
        """Return the entries of the previous report by name; empty if the report is missing or
        damaged.

        :param folder: of the footage, as the report has it.
        :raises OutputError: what has its name is no file, so that no report could be written.
        :raises UsageError: the report is of another folder.
        """
        resolve_link(self.report_file)
        of_clips = {unicode_text(name): name for name in clips}
        try:
            report = json.loads(self.report_file.read_text(encoding="utf-8"))
            entries = {
                of_clips.get(e["name"], e["name"]): e
                for e in report["files"]
                if isinstance(e["status"], str)
            }
            before = report["folder"]
            is_same = unicode_text(folder) == before or unicode_text(self.folder) == str(
                Path(before).resolve()
            )
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return {}
        if entries and not is_same:
            raise UsageError(
                f"the folder of --out has the results of {display_text(before)}; give another for "
                f"those of {display_text(folder)}, or, if it is the same folder under a new name, "
                f"write that name into {REPORT_NAME} there"
            )
        return entries

    def _write_report(
        self, entries: dict[str, Entry], previous: dict[str, Entry], runner: Runner, *, last: bool
    ) -> dict[str, Any]:
        """Write and return the report. Clips that are still pending keep their entries of the
        previous report.

        A report of many thousand clips is not written after every clip, unless it is the last one.
        """
        start = time.monotonic()
        if start < self._next_report and not last:
            return {}
        counts = Counter(e["status"] for e in entries.values())
        status = 1 if counts["failed"] else NO_PERSON if counts["no_person"] else 0
        report = {
            "folder": str(self.folder),
            "options": self.settings.options,
            "counts": {s: counts[s] for s in STATUSES},
            "files": list(
                ({n: e for n, e in previous.items() if n not in entries} | entries).values()
            ),
            "exit_status": status,
            **runner.report(),
        }
        try:
            # A link of that name leads where nobody has asked to write.
            with complete_file(self.report_file) as temporary:
                temporary.write_text(json_text(report, indent=1), encoding="utf-8")
        except OSError as error:
            raise OutputError(
                f"cannot write {self.report_file}: {error.strerror}; free some space"
            ) from error
        runner.report_written(self.report_file)
        written = {name for name, entry in entries.items() if entry["status"] in FINISHED}
        for name in written - self._reported:
            # a record remains harmless: an entry of its key is in the report
            with suppress(KeyError):
                remove(finished_file(self.out, name, entries[name]["key"]))
        self._reported |= written
        taken = time.monotonic() - start
        self._next_report = 0.0 if taken < _QUICK_S else start + taken / _WRITING_SHARE
        return report


def how_to_continue(again: bool) -> str:
    """Return what to do about a batch that ended early.

    :param again: whether it captures finished clips as well, which would begin anew.
    """
    command = "the same command without --again" if again else "the same command again"
    return f"finished clips are kept; run {command} to continue"


@contextmanager
def _alone_in(out: Path) -> Iterator[None]:
    """Keep other batches from an output folder: of two at once, each would replace results of the
    other of the same name, and its report.

    :raises UsageError: another batch writes there.
    """
    lock = out / LOCK_NAME
    try:
        is_held = hold(lock)
    except OSError:  # there are no locks, or nothing can be written there, which writing says
        yield
        return
    if not is_held:
        raise UsageError(
            f"another batch writes to {out}, as {lock.name} there says; wait until it has ended, "
            "or give another --out, or remove that file if none runs"
        )
    try:
        yield
    finally:
        release(lock)


def _in_order(entries: dict[str, Entry], clips: dict[str, Path]) -> dict[str, Entry]:
    """Return the entries in the order of the clips, not in that in which they were finished."""
    return {name: entries[name] for name in clips if name in entries}


def _print_outcome(entry: Entry, number: str, say: Callable[[str], None]) -> None:
    """Tell the user how a clip ended, and its warnings."""
    message = f": {entry['message']}" if entry.get("message") else ""
    say(f"{number} {entry['file']} {entry['status'].replace('_', ' ')}{message}")
    if entry["status"] == "done":
        for warning in entry["report"].get("warnings", []):
            say(f"warning: {warning}")


def worker_table(report: dict[str, Any]) -> list[str]:
    """Return the lines of the table of a cluster's workers for a terminal; empty for a batch on one
    machine.
    """
    if not report.get("workers"):
        return []
    columns = list(report["workers"][0])
    rows = [columns, *([str(row[name]) for name in columns] for row in report["workers"])]
    widths = [max(len(row[k]) for row in rows) for k in range(len(columns))]
    return [
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
