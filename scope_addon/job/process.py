# SPDX-License-Identifier: GPL-3.0-or-later
"""The parent's side of a job: start the worker, read its messages without blocking, and end it.

The messages are checked before anything acts on them: the worker decodes footage of others with
libraries in C, and what it writes after one of them has gone wrong may be anything.
"""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar

from ...solver.errors import ScopeError
from ..errors import SetupError
from ..footage import is_utf8
from ..temporary import discard, remove
from .request import WARM_UP, FormatsRequest, JobRequest, LiveRequest, PictureRequest
from .start_worker import worker_command

LONGEST_LINE = 16 << 20  # bytes; a report of 10 people has some 100 kB
_LARGEST_NUMBER = 1 << 53
_LARGEST_SIDE = 4096  # of a preview, in pixels
_LONGEST_TEXT = 2000


class WorkerFailedError(ScopeError):
    """The worker reported an error, ended without a result, or sent what is no message."""


def is_number(value: object) -> bool:
    """Return whether it is an integer from 0."""
    return type(value) is int and 0 <= value < _LARGEST_NUMBER


def is_side(value: object) -> bool:
    """Return whether it can be the width or height of a preview."""
    return type(value) is int and 0 < value <= _LARGEST_SIDE


def is_text(value: object) -> bool:
    """Return whether it is a text of moderate length."""
    return isinstance(value, str) and len(value) <= _LONGEST_TEXT


def _is_name(value: object) -> bool:
    """Whether it is the name of a file in the job's folder, not a way to another."""
    return (
        isinstance(value, str)
        and 0 < len(value) < 200
        and value.isprintable()
        and not set(value) & set('/\\:"*?<>|')
    )


def _are_names(value: object) -> bool:
    return (
        isinstance(value, list)
        and bool(value)
        and all(_is_name(name) and name.endswith(".npz") for name in value)
    )


def _is_report(value: object) -> bool:
    """Whether it is a report, all of which that the panel uses has its type."""
    if not isinstance(value, dict):
        return False
    notices = value.get("notices", [])
    rates = value.get("fps", {})
    people = value.get("per_person", [])
    views = value.get("views", [])
    if not isinstance(rates, dict) or not all(map(_are_records, (notices, people, views))):
        return False
    heights = [person["height_m"] for person in people if "height_m" in person]
    sigmas = [person.get("height_sigma_m") for person in people]
    known_sigmas = [sigma for sigma in sigmas if sigma is not None]
    texts = [value.get(name, "") for name in ("camera", "execution")]
    return (
        all(map(is_figure, [*rates.values(), *heights, *known_sigmas]))
        and all(is_text(text) and is_utf8(text) for text in texts)
        and all(type(view.get("is_used")) is bool for view in views)
    )


def _are_records(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(each, dict) for each in value)


def is_figure(value: object) -> bool:
    """Return whether it is a finite number from 0."""
    return type(value) in (int, float) and 0 <= value < _LARGEST_NUMBER  # type: ignore[operator]


# The fields that a message must have, by its event, and what they may be.
Fields = dict[str, dict[str, Callable[[object], bool]]]
PROGRESS_FIELDS: Fields = {
    "progress": {"stage": is_text, "done": is_number, "total": is_number},
}
WARM_UP_FIELDS: Fields = PROGRESS_FIELDS | {"result": {}}
CAPTURE_FIELDS: Fields = PROGRESS_FIELDS | {
    "preview": {"file": _is_name, "width": is_side, "height": is_side, "frame": is_number},
    "result": {"motions": _are_names, "report": _is_report},
}


def is_result(content: object) -> bool:
    """Return whether it has what the message of a finished capture must have: names of motions and
    a report.
    """
    return isinstance(content, dict) and all(
        is_(content.get(field)) for field, is_ in CAPTURE_FIELDS["result"].items()
    )


def parse_message(line: bytes, fields: Fields = CAPTURE_FIELDS) -> dict[str, Any] | None:
    """Read a line of the worker.

    :param fields: what the messages of this job have.
    :return: the message; None for a line that is none, such as a library may print, or one of an
        unknown event.
    :raises WorkerFailedError: the line is too long, or a message lacks what its event needs.
    """
    if len(line) > LONGEST_LINE:
        raise unreadable(f"a line of more than {LONGEST_LINE >> 20} MB")
    try:
        message = json.loads(line)
    except (ValueError, RecursionError):
        return None
    event = message.get("event") if isinstance(message, dict) else None
    if event == "error":
        return {"event": "error", "message": _one_line(message.get("message"))}
    if not isinstance(event, str) or event not in fields:
        return None
    for field, is_valid in fields[event].items():
        if not is_valid(message.get(field)):
            raise unreadable(f"{event} without a valid {field}")
    return dict(message)


def _one_line(text: object) -> str:
    said = " ".join(text.split()) if isinstance(text, str) else ""
    return said[:_LONGEST_TEXT] or "the worker process failed"


def unreadable(what: str) -> WorkerFailedError:
    """Return the error for a message that cannot be used."""
    return WorkerFailedError(
        f"the worker process sent a message that cannot be used ({what}); try again"
    )


ROOT = Path(__file__).resolve().parents[2]
START_SCRIPT = Path(__file__).with_name("start_worker.py")
LOG = "worker.log"
_LAST = ("result", "ended")  # events after which a worker ends


class WorkerProcess:
    """A worker process. Call ``poll`` regularly; ``close`` ends the process and removes its folder
    in any state.
    """

    fields: ClassVar[Fields] = CAPTURE_FIELDS  # of its messages; of a warm-up, those of one

    def __init__(
        self,
        request: JobRequest | LiveRequest | FormatsRequest | PictureRequest | None,
        job_folder: Path,
        kernels: Path | None = None,
        python: Sequence[str] = (sys.executable,),
        script: Path = START_SCRIPT,
    ) -> None:
        """Start the worker.

        :param request: the capture, the question to a camera, or the frame to be shown; None to
            compile what captures need.
        :param job_folder: folder for the worker's files.
        :param kernels: folder for the code that numba compiles; if None, next to the sources.
        :param python: interpreter and its arguments; inside Blender ``[sys.executable,
            *bpy.app.python_args]``.
        :param script: what the interpreter runs.
        :raises SetupError: the process cannot be started.
        """
        self.job_folder = job_folder
        self.finished = False
        self._fields = self.fields if request else WARM_UP_FIELDS
        # only Windows has these; elsewhere, the worker lowers its priority itself
        priority = "BELOW_NORMAL_PRIORITY_CLASS" if request else "IDLE_PRIORITY_CLASS"
        windows_flags = sum(getattr(subprocess, n, 0) for n in ("CREATE_NO_WINDOW", priority))
        command, environment = worker_command(python, ROOT, job_folder, kernels, script)
        try:
            with (job_folder / LOG).open("wb") as log:
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    env=environment,
                    creationflags=windows_flags,
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
