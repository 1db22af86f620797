# SPDX-License-Identifier: GPL-3.0-or-later
"""The parent's side of a job: start the worker, read its messages without blocking, and end it."""

from __future__ import annotations

import contextlib
import queue
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import SetupError
from ..temporary import discard, remove
from .messages import (
    CAPTURE_FIELDS,
    LONGEST_LINE,
    WARM_UP_FIELDS,
    Fields,
    WorkerFailedError,
    parse_message,
)
from .request import WARM_UP, FormatsRequest, JobRequest, LiveRequest
from .start_worker import worker_command

ROOT = Path(__file__).resolve().parents[2]
START_SCRIPT = Path(__file__).with_name("start_worker.py")
LOG = "worker.log"
_LAST = ("result", "ended")  # events after which a worker ends
_WINDOWS_FLAGS = getattr(subprocess, "CREATE_NO_WINDOW", 0) | getattr(
    subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0
)


class WorkerProcess:
    """A worker process. Call ``poll`` regularly; ``close`` ends the process and removes its folder
    in any state.
    """

    def __init__(
        self,
        request: JobRequest | LiveRequest | FormatsRequest | None,
        job_folder: Path,
        kernels: Path | None,
        python: Sequence[str] = (sys.executable,),
        script: Path = START_SCRIPT,
    ) -> None:
        """Start the worker.

        :param request: the capture, or the question to a camera; None to compile what captures
            need.
        :param job_folder: folder for the worker's files.
        :param kernels: folder for the code that numba compiles; if None, next to the sources.
        :param python: interpreter and its arguments; inside Blender ``[sys.executable,
            *bpy.app.python_args]``.
        :param script: what the interpreter runs.
        :raises SetupError: the process cannot be started.
        """
        self.job_folder = job_folder
        self.finished = False
        self._fields: Fields = CAPTURE_FIELDS if request else WARM_UP_FIELDS
        command, environment = worker_command(python, ROOT, job_folder, kernels, script)
        try:
            with (job_folder / LOG).open("wb") as log:
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    env=environment,
                    creationflags=_WINDOWS_FLAGS,
                )
        except OSError as error:
            discard(job_folder)
            raise SetupError(
                f"cannot start {python[0]}: {error.strerror}; reinstall Blender"
            ) from error
        self._lines: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        threading.Thread(target=self._read, name="scope-worker-lines", daemon=True).start()
        self._send_line((request.to_json() if request else WARM_UP).encode() + b"\n")

    @property
    def pid(self) -> int:
        """Process id of the worker."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the process is still running."""
        return self._process.poll() is None

    def poll(self) -> list[dict[str, Any]]:
        """Return the messages since the last call, and set ``finished`` when the last one is among
        them.

        :raises WorkerFailedError: the worker reported an error, ended without a result, or sent
            what is no message.
        """
        messages: list[dict[str, Any]] = []
        while True:
            try:
                line = self._lines.get_nowait()
            except queue.Empty:
                return messages
            if line is None:
                if not self.finished:
                    raise WorkerFailedError(self._cause_of_end())
                return messages
            message = parse_message(line, self._fields)
            if message is None:
                continue
            if message["event"] == "error":
                raise WorkerFailedError(message["message"])
            self.finished = self.finished or message["event"] in _LAST
            messages.append(message)

    def wait(self, timeout_s: float = 5.0) -> None:
        """Wait for the worker to end after its result, so that its files are closed before they are
        moved.
        """
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout_s)
        self._end()
        remove(self.job_folder / LOG)

    def close(self) -> None:
        """End the worker if it is running, and remove its folder if it exists."""
        self._end()
        discard(self.job_folder)

    def _send_line(self, line: bytes) -> None:
        with contextlib.suppress(OSError):  # the worker has ended already; poll() reports that
            assert self._process.stdin is not None
            self._process.stdin.write(line)
            self._process.stdin.flush()

    def _keep(self, line: bytes) -> None:
        """Keep a line for ``poll``."""
        self._lines.put(line)

    def _end(self) -> None:
        if self.alive:
            self._process.kill()
        with contextlib.suppress(OSError):
            assert self._process.stdin is not None
            self._process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=5)

    def _read(self) -> None:
        """Read the messages in a thread, because not every system can read pipes without
        blocking.
        """
        assert self._process.stdout is not None
        with contextlib.suppress(OSError, ValueError), self._process.stdout as stream:
            while line := stream.readline(LONGEST_LINE + 1):
                self._keep(line)
        self._lines.put(None)

    def _cause_of_end(self) -> str:
        """Describe how a worker ended that reported no error."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=5)
        code = self._process.returncode
        how = (
            f"was terminated by signal {-code}"
            if code is not None and code < 0
            else f"ended with status {code}"
        )
        log = b""
        with contextlib.suppress(OSError):
            log = (self.job_folder / LOG).read_bytes()[-2000:]
        last = next(
            (
                text
                for text in reversed(log.decode("utf-8", "replace").splitlines())
                if text.strip()
            ),
            "",
        )
        hint = f" ({last.strip()[:200]})" if last else "; the system may have run out of memory"
        return f"the capture process {how} before it was finished{hint}; capture again"
