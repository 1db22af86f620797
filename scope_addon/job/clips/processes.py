# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes that each capture one clip, and that end when their parent does or when they are
stopped.
"""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Callable
from typing import IO, Any

from ...parent import GRACE_S

STOPPED = 130  # exit status of a process that was stopped, or not started any more
# Ctrl-C on a terminal must reach the batch only, which stops its clips: a second signal would
# interrupt their clean-up.
_NEW_GROUP = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
_OWN_GROUP: dict[str, Any] = {"creationflags": _NEW_GROUP} if _NEW_GROUP else {"process_group": 0}
_GRACE_S = GRACE_S + 3.0  # time for a clip to clean up after it is stopped
_POLLING_INTERVAL_S = 0.5  # for asking whether a clip is still wanted


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
