# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the clips of a batch are captured: a runner takes tasks and yields outcomes. This one uses
this machine.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any, Protocol

from .processes import ClipProcesses
from .task import FINISHED, ClipTask, Entry, capture_clip

_WAIT_S = 1.0  # longest wait for a clip to finish


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
