# SPDX-License-Identifier: GPL-3.0-or-later
"""Give the clips of a batch to the workers of a Dask cluster, each to one worker at a time, and
publish the results.

Which worker captures what is decided here and not by the scheduler, because workers have to be
checked before they get a clip, also those that join later, and because a capture uses all threads
of a worker, not one. A long clip is divided: several workers observe it, window by window, before
one joins the windows and captures the clip.
"""

from __future__ import annotations

import math
import queue
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from distributed import Client, Future

from ...solver.errors import ScopeError
from ..capture_report import warnings_as_json
from ..errors import ClusterError, internal_error_message, system_error_message
from ..footage import display_address, is_url
from ..job.batch import how_to_continue
from ..job.clip_task import COUNT, DIVIDED, ClipTask, Entry, failure
from ..job.request import program_version
from ..output_paths import WITHOUT_SCENE, left_over
from ..temporary import remove
from . import worker as worker_side
from .remote import RemoteStaging, Staging
from .workers import Workers

_POLLING_INTERVAL_S = 1.0  # for the list of workers
_RESULT_TIMEOUT_S = 30.0  # for fetching an outcome that a worker holds
ATTEMPTS = 3  # of a clip whose workers are lost
MAX_WINDOWS = 5  # in a task: what a lost worker costs
TASKS_PER_WORKER = 2  # at least, so that a faster worker gets more of them


class _Attempt(NamedTuple):
    """A clip on a worker; `task` is None for the check of a worker."""

    future: Future[Any]
    worker: str
    task: ClipTask | None
    folder: str


class DaskRunner:
    """Captures clips on a cluster.

    :param client: connected to the scheduler; it is closed at the end.
    :param folder: URL of the footage, or its path, the same on all machines.
    :param out: URL of the output folder, or its path, the same on all machines.
    :param jobs: number of clips that a worker captures at a time.
    :param program: command that takes ``capture FILE -o OUT --json``; None for each worker's own
        installation.
    :param say: called with messages for the user.
    """

    def __init__(
        self,
        client: Client,
        folder: str,
        out: str,
        jobs: int,
        program: Sequence[str] | None,
        say: Callable[[str], None],
    ) -> None:
        self._client = client
        self._folder = folder
        self._out = out
        self._jobs = jobs
        self._program = None if program is None else tuple(program)
        self._say = say
        self._workers = Workers(say)
        self._staging: Staging | RemoteStaging | None = None
        self._attempts: dict[str, _Attempt] = {}  # by Dask's key
        self._done: queue.SimpleQueue[str] = queue.SimpleQueue()  # keys
        self._waiting: deque[ClipTask] = deque()
        self._lost: Counter[tuple[str, str]] = Counter()  # attempts of a clip, or of a part of it
        self._divisions = Divisions()
        self._count = 0
        self._looked = -_POLLING_INTERVAL_S
        self._told_to_wait = False
        self._again = False  # whether finished clips are captured as well

    def outcomes(self, tasks: Iterable[ClipTask]) -> Iterator[dict[str, Entry]]:
        """See `Runner.outcomes`.

        :raises ClusterError: the scheduler is lost, or no worker can capture.
        :raises OutputError: the folder of the attempts cannot be created.
        """
        self._waiting.extend(tasks)
        self._again = self._waiting[0].again
        self._staging = RemoteStaging(self._out) if is_url(self._out) else Staging(Path(self._out))
        wanted = self._wanted(self._waiting[0])
        yield {}
        while self._waiting or any(attempt.task for attempt in self._attempts.values()):
            found: dict[str, Entry] = {}
            if time.monotonic() - self._looked > _POLLING_INTERVAL_S:
                found = self._check_workers(wanted)
            while (
                self._waiting
                and self._client.status == "running"
                and (record := self._workers.free(self._jobs))
            ):
                self._start(self._waiting.popleft(), record.worker)
            yield found | self._next_outcome()

    def stop(self) -> dict[str, Entry]:
        """See `Runner.stop`; workers end what nobody waits for, and what is not published is not
        finished.
        """
        attempts = list(self._attempts.values())
        self._attempts = {}
        self._cancel([attempt.future for attempt in attempts])
        self._client.close(timeout=5)
        return {}

    def close(self) -> None:
        """Give up all attempts, disconnect, and remove what is not published; after the report is
        written.
        """
        self.stop()
        if self._staging:
            self._staging.close()

    def report(self) -> dict[str, Any]:
        """See `Runner.report`."""
        return {"folder": display_address(self._folder), **self._workers.report()}

    def report_written(self, file: Path) -> None:
        """See `Runner.report_written`.

        :raises OutputError: the store of the results cannot be written.
        """
        if self._staging:
            self._staging.write_report(file)

    def _wanted(self, task: ClipTask) -> dict[str, Any]:
        """Return what every worker is asked for before its first clip."""
        assert self._staging is not None
        return {
            "program": program_version(),
            "bpy": self._program is None
            and any(suffix not in WITHOUT_SCENE for suffix in task.settings.suffixes),
            "folder": self._folder,
            "out": self._out,
            "attempts": str(self._staging.folder),
            "token": self._staging.token,
            "options": dict(task.settings.options),
            "suffixes": list(task.settings.suffixes),
            "extras": list(task.settings.extras),
            "further_files": list(task.settings.further_files),
            "basis": task.basis,
        }

    def _check_workers(self, wanted: dict[str, Any]) -> dict[str, Entry]:
        """Check workers that have joined, and give up the attempts of those that have left.

        :return: clips that are given up.
        :raises ClusterError: the scheduler is lost, or no worker can capture.
        """
        self._looked = time.monotonic()
        # all futures are lost, and will be reported as such
        if self._client.status == "connecting":
            return {}
        if self._client.status != "running":
            raise ClusterError(
                "the connection to the Dask scheduler was lost; " + how_to_continue(self._again)
            )
        # not scheduler_info(), which may return a list without workers if the scheduler does not
        # answer
        try:
            assert self._client.scheduler is not None
            present = list(
                self._client.sync(self._client.scheduler.identity, n_workers=-1)["workers"]
            )
        except (OSError, TimeoutError):
            return {}
        found: dict[str, Entry] = {}
        for address in self._workers.gone(present):
            for key in [
                key for key, attempt in self._attempts.items() if attempt.worker == address
            ]:
                found |= self._give_up(key, "left the cluster")
        for address in self._workers.new(present):
            self._submit(None, address, "", worker_side.check_worker, wanted)
        if self._workers.all_refused():
            problems = [
                e["event"] for e in self._workers.log if e["event"].startswith("gets no clips: ")
            ]
            raise ClusterError(
                "no worker of the cluster can capture: "
                f"{problems[-1].removeprefix('gets no clips: ')}"
            )
        if not present and not self._told_to_wait:
            self._say("the cluster has no workers; waiting for one")
        self._told_to_wait = not present
        return found

    def _start(self, task: ClipTask, address: str) -> None:
        """Begin an attempt to capture a clip."""
        assert self._staging is not None
        folder = self._staging.attempt(self._count)
        footage = f"{self._folder.rstrip('/')}/{task.file}"
        divides = not (
            task.windows or task.windows_folder or is_url(self._folder) or is_url(self._out)
        )
        remote = task._replace(
            footage=footage,
            out=folder,
            final=display_address(self._out),
            windows=COUNT if divides else task.windows,
        )
        arguments = (self._program, self._jobs, program_version())
        self._submit(task, address, folder, worker_side.capture_on_worker, remote, *arguments)
        self._workers.records[address].running += 1

    def _submit(
        self,
        task: ClipTask | None,
        address: str,
        folder: str,
        function: Callable[..., Any],
        first: Any,
        *others: Any,
    ) -> None:
        assert self._staging is not None
        key = f"scope-{'check' if task is None else 'clip'}-{self._staging.token}-{self._count}"
        self._count += 1
        arguments = (first,) if task is None else (first, key, *others)
        future = self._client.submit(
            function,
            *arguments,
            key=key,
            workers=[address],
            allow_other_workers=False,
            retries=0,
            pure=False,
        )
        self._attempts[key] = _Attempt(future, address, task, folder)
        future.add_done_callback(lambda done: self._done.put(done.key))

    def _next_outcome(self) -> dict[str, Entry]:
        """Wait a second for an attempt to end, and return the clip's entry if that is its last
        one.
        """
        try:
            key = self._done.get(timeout=_POLLING_INTERVAL_S)
        except queue.Empty:
            return {}
        attempt = self._attempts.get(key)
        if attempt is None:  # given up before
            return {}
        if attempt.future.status in ("cancelled", "lost"):
            return self._give_up(key, "the connection to the scheduler was lost", blame=False)
        try:
            result = attempt.future.result(timeout=_RESULT_TIMEOUT_S)
        except Exception as error:  # of the worker, or of unpickling there
            return self._failed(key, attempt, error)
        if attempt.task is None:
            self._forget(key)
            self._workers.checked(attempt.worker, result)
            return {}
        return self._outcome(key, attempt, attempt.task, result)

    def _outcome(
        self, key: str, attempt: _Attempt, task: ClipTask, entry: Entry
    ) -> dict[str, Entry]:
        """Publish the results of an attempt and return the clip's entry."""
        assert self._staging is not None
        if entry["status"] == worker_side.REFUSED:
            self._workers.checked(attempt.worker, {"problem": entry["message"]})
            return self._give_up(key, entry["message"], blame=False)
        if entry["status"] == worker_side.LOST:
            return self._give_up(key, entry["message"])
        content = entry.get("content", {})
        if entry["status"] == DIVIDED:
            return self._divide(key, attempt, task, entry)
        if is_part(task):
            return self._collect(key, attempt, task, entry, content)
        try:
            if entry["status"] == "done" and not self._staging.publish(
                attempt.folder, entry["outputs"], content
            ):
                return self._give_up(
                    key, f"the results of {task.file} are not what the worker has written"
                )
        except (ScopeError, OSError) as error:
            text = system_error_message(error) if isinstance(error, OSError) else str(error)
            entry = failure(task, text)
        if entry["status"] == "done":
            # The worker cannot know: it has captured to the attempt's folder. Of a store, the
            # task's folder has the names that were there before.
            out = Path(task.out)
            paths = [out / f"{task.name}{suffix}" for suffix in task.settings.suffixes]
            others = left_over(paths, [out / name for name in entry["outputs"]])
            for name, values in warnings_as_json([others] if others else []).items():
                entry["report"].setdefault(name, []).extend(values)
        self._forget(key)
        return self._ended(task, attempt.worker, entry)

    def _ended(self, task: ClipTask, address: str, entry: Entry) -> dict[str, Entry]:
        """Count a clip that has its outcome, and return its entry."""
        observed, about = self._divisions.close(task)
        self._workers.finished(address, entry, observed)
        return {task.name: entry | {"worker": address} | about}

    def _divide(
        self, key: str, attempt: _Attempt, task: ClipTask, entry: Entry
    ) -> dict[str, Entry]:
        """Let the workers observe the windows of a long clip."""
        assert isinstance(self._staging, Staging)  # else, clips are not divided
        folder = self._staging.windows(self._count)
        self._forget(key)
        self._workers.observed(attempt.worker, 0, entry)
        try:
            parts = self._divisions.begin(task, entry, folder, self._workers.slots(self._jobs))
        except OSError as error:
            return self._ended(task, attempt.worker, failure(task, system_error_message(error)))
        self._workers.event(
            attempt.worker, f"{task.file} is divided into {entry['windows']} windows"
        )
        self._waiting.extendleft(reversed(parts))
        return {}

    def _collect(
        self, key: str, attempt: _Attempt, task: ClipTask, entry: Entry, content: dict[str, Any]
    ) -> dict[str, Entry]:
        """Keep the windows that were observed; what fails here is observed again by the task that
        joins them.
        """
        assert isinstance(self._staging, Staging)
        done = entry["status"] == "done"
        try:
            folder = self._divisions.folder(task)
            if done and not self._staging.publish(
                attempt.folder, entry["outputs"], content, folder
            ):
                return self._give_up(
                    key, f"the windows of {task.file} are not what the worker has written"
                )
        except (ScopeError, OSError):
            done = False
        self._forget(key)
        if done:
            self._workers.observed(attempt.worker, len(entry["outputs"]), entry)
        self._waiting.extendleft(
            self._divisions.ended(task, attempt.worker, entry if done else None)
        )
        return {}

    def _failed(self, key: str, attempt: _Attempt, error: Exception) -> dict[str, Entry]:
        """Handle an exception that is not Scope's own: a lost worker, or an installation that does
        not fit.
        """
        text = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        if attempt.task is None:
            self._forget(key)
            self._workers.checked(
                attempt.worker, {"problem": f"Scope does not run there ({text}); install it"}
            )
            return {}
        if type(error).__name__ in (
            "KilledWorker",
            "TimeoutError",
            "FutureCancelledError",
            "CommClosedError",
        ):
            return self._give_up(key, text)
        self._forget(key)
        if is_part(attempt.task):
            self._waiting.extendleft(self._divisions.ended(attempt.task, attempt.worker, None))
            return {}
        return self._ended(
            attempt.task, attempt.worker, failure(attempt.task, internal_error_message(error))
        )

    def _give_up(self, key: str, why: str, *, blame: bool = True) -> dict[str, Entry]:
        """Let another worker capture the clip, or return its entry if too many were lost.

        :param blame: whether the clip may be the cause.
        """
        attempt = self._attempts[key]
        self._forget(key)
        task = attempt.task
        if task is None:
            return {}
        self._workers.event(
            attempt.worker, f"{described(task)} is captured again: {why}", tell=True
        )
        self._workers.records[attempt.worker].attempts_lost += 1
        part = task.name, task.windows
        self._lost[part] += blame
        if self._lost[part] < ATTEMPTS:
            self._waiting.appendleft(task)
            return {}
        if is_part(task):
            self._waiting.extendleft(self._divisions.ended(task, attempt.worker, None))
            return {}
        message = (
            f"{ATTEMPTS} workers were lost while they captured it; does it need more memory than "
            f"they have?"
        )
        _, about = self._divisions.close(task)
        return {task.name: failure(task, message) | {"worker": attempt.worker} | about}

    def _forget(self, key: str) -> None:
        """Forget an attempt; what a worker still does for it is in vain."""
        attempt = self._attempts.pop(key)
        if attempt.task is not None:
            assert self._staging is not None
            self._workers.records[attempt.worker].running -= 1
            self._staging.remove(attempt.folder)
        self._cancel([attempt.future])

    def _cancel(self, futures: list[Future[Any]]) -> None:
        if futures and self._client.status == "running":
            # the scheduler is lost, and forgets them by itself
            with suppress(OSError, TimeoutError):
                self._client.cancel(futures, force=True)


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
