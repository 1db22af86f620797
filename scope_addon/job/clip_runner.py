# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the clips of a batch are captured: a runner takes tasks and yields outcomes. This one uses
processes of this machine, one for each clip, which end when their parent does or when they are
stopped.
"""

from __future__ import annotations

import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import IO, Any, Protocol

from ..parent import GRACE_S, STOPPED
from .clip_task import FINISHED, ClipTask, Entry, capture_clip

_WAIT_S = 1.0  # longest wait for a clip to finish
# Ctrl-C on a terminal must reach the batch only, which stops its clips: a second signal would
# interrupt their clean-up.
_NEW_GROUP = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
_OWN_GROUP: dict[str, Any] = {"creationflags": _NEW_GROUP} if _NEW_GROUP else {"process_group": 0}
_GRACE_S = GRACE_S + 3.0  # time for a clip to clean up after it is stopped
_POLLING_INTERVAL_S = 0.5  # for asking whether a clip is still wanted


class Runner(Protocol):
    """Captures clips."""

    def outcomes(self, tasks: Iterable[ClipTask]) -> Iterator[dict[str, Entry]]:
        """Capture clips, and yield the entries of those that are finished by their names, as they
        come.

        Yields at least once a second, if need be an empty dictionary: a signal delivered to another
        thread does not wake this one.
        """
        ...

    def stop(self) -> dict[str, Entry]:
        """End what is running, because the batch ends early.

        :return: entries of finished clips by their names, also of those that ended meanwhile and
            were never yielded.
        """
        ...

    def report(self) -> dict[str, Any]:
        """Return what the batch's report says besides the clips."""
        ...

    def report_written(self, file: Path) -> None:
        """Put the report, which was written to a file, where the results are."""
        ...


class LocalRunner:
    """Captures clips in processes of this machine.

    :param program: command that takes ``capture FILE -o OUT --json``.
    :param jobs: number of clips that are captured in parallel.
    """

    def __init__(self, program: Sequence[str], jobs: int) -> None:
        self._program = list(program)
        self._processes = ClipProcesses()
        self._threads = None if jobs == 1 else max(1, (os.cpu_count() or 1) // jobs)
        self._pool = ThreadPoolExecutor(jobs)
        self._names: dict[Future[Entry], str] = {}

    def outcomes(self, tasks: Iterable[ClipTask]) -> Iterator[dict[str, Entry]]:
        """See `Runner.outcomes`."""
        for task in tasks:
            self._names[self._pool.submit(self._capture, task)] = task.name
        places = {future: place for place, future in enumerate(self._names)}
        yield {}
        pending = set(self._names)
        while pending:
            finished, pending = wait(pending, timeout=_WAIT_S, return_when=FIRST_COMPLETED)
            # In the order of the clips, which the set of those that have ended together does not
            # have.
            yield {
                self._names[future]: future.result()
                for future in sorted(finished, key=places.__getitem__)
            }
        self._pool.shutdown()

    def stop(self) -> dict[str, Entry]:
        """See `Runner.stop`."""
        self._processes.stop()
        self._pool.shutdown(cancel_futures=True)
        ended = {
            name: future.result()
            for future, name in list(self._names.items())
            if future.done() and not future.cancelled() and future.exception() is None
        }
        return {name: entry for name, entry in ended.items() if entry["status"] in FINISHED}

    def report(self) -> dict[str, Any]:
        """See `Runner.report`."""
        return {}

    def report_written(self, file: Path) -> None:
        """See `Runner.report_written`."""

    def _capture(self, task: ClipTask) -> Entry:
        return capture_clip(task, self._program, self._processes.run, self._threads)


class ClipProcesses:
    """Runs processes for several threads at once."""

    def __init__(self) -> None:
        # process to its stdin, whose closing ends the process
        self._running: dict[subprocess.Popen[str], IO[str]] = {}
        self._start_lock = threading.Lock()
        self._stopped = False

    def run(
        self, arguments: list[str], wanted: Callable[[], bool] | None = None
    ) -> tuple[int, str, str]:
        """Run a process and return its exit status, stdout and stderr.

        :param wanted: asked twice a second; the process is stopped when it returns False. If None,
            it is not asked.
        :raises OSError: the process cannot be started.
        """
        with self._start_lock:  # so that stop() knows every process
            if self._stopped:
                return STOPPED, "", ""
            process = subprocess.Popen(
                arguments,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
                **_OWN_GROUP,
            )
            assert process.stdin is not None
            # Taken from the process, because communicate() would close it immediately.
            lifeline = process.stdin
            process.stdin = None
            self._running[process] = lifeline
        try:
            with lifeline:
                stdout, stderr = (
                    _communicate(process, lifeline, wanted) if wanted else process.communicate()
                )
        finally:
            del self._running[process]
        return process.returncode, stdout, stderr

    def stop(self) -> None:
        """Close stdin of all running processes, and kill those that do not end in time."""
        with self._start_lock:
            self._stopped = True
            running = dict(self._running)
        for lifeline in running.values():
            lifeline.close()
        end = time.monotonic() + _GRACE_S
        for process in running:
            try:
                process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()


def _communicate(
    process: subprocess.Popen[str], lifeline: IO[str], wanted: Callable[[], bool]
) -> tuple[str, str]:
    """Return stdout and stderr; stop the process when it is not wanted any more."""
    end = None
    while True:
        try:
            return process.communicate(timeout=_POLLING_INTERVAL_S)
        except subprocess.TimeoutExpired:
            if end is not None and time.monotonic() > end:
                process.kill()
            elif end is None and not wanted():
                lifeline.close()
                end = time.monotonic() + _GRACE_S
