# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker's side of a job: read the request, capture, write motion files, and report
progress.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from pathlib import Path
from typing import IO, NoReturn

from ...solver.errors import ScopeError
from ..confinement import confine_capture, folders_of
from ..errors import (
    exit_status,
    keep_solver_hints_from_users,
    lacks_memory,
    system_error_message,
)
from ..footage import json_text
from ..parent import end_with_parent
from ..temporary import discard, remove
from .cache import cache_of
from .request import WARM_UP, Commands, FormatsRequest, JobRequest, LiveRequest, PictureRequest
from .watched_footage import WatchedFiles

_REMOVAL_ATTEMPTS = 20  # an attempt fails if a file is created during it
# How far a capture gives way to others. With 5, drawing without a graphics card waits for it.
_NICENESS = 12
_NICENESS_OF_WARM_UP = 19  # the most there is
_MIN_INTERVAL_S = 0.05  # between two progress messages of one stage


class Reporter:
    """Write messages to the parent as JSON lines."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream
        self._last_stage = ""
        self._last_time = 0.0
        self._lock = threading.Lock()

    def send(self, event: str, **values: object) -> None:
        """Send a message immediately; thread-safe."""
        line = json_text({"event": event, **values}) + "\n"
        with self._lock:
            self._stream.write(line)
            self._stream.flush()

    def progress(self, stage: str, done: int, total: int) -> None:
        """Report the progress of a stage, at most every ``_MIN_INTERVAL_S`` except at its beginning
        and end.
        """
        now = time.monotonic()
        if stage == self._last_stage and done != total and now - self._last_time < _MIN_INTERVAL_S:
            return
        self._last_stage = stage
        self._last_time = now
        self.send("progress", stage=stage, done=done, total=total)


Request = JobRequest | LiveRequest | FormatsRequest | PictureRequest | None


def run(
    request: Request, job_folder: Path, reporter: Reporter, commands: Commands | None = None
) -> int:
    """Do what is requested and return the exit status. Every failure is reported as an ``error``
    message.

    :param request: the capture, the question to a camera, or the frame to be shown; None to compile
        what captures need.
    :param commands: of the parent, to a live capture.
    """
    try:
        reporter.progress("starting", 0, 0)
        if request is None:
            from .warm_up import warm_up

            reporter.send("result", compiled=warm_up(reporter.progress))
        elif isinstance(request, LiveRequest):
            from .live_capture import capture_live

            capture_live(request, job_folder, reporter.send, commands or Commands())
        elif isinstance(request, FormatsRequest):
            from .live_cameras import camera_with_formats

            camera = camera_with_formats(request.source)
            reporter.send("result", name=camera.name, formats=camera.formats)
        elif isinstance(request, PictureRequest):
            from .footage_picture import write_picture

            write_picture(request, job_folder, reporter.send)
        else:
            _capture(request, job_folder, reporter)
        return 0
    except ScopeError as error:
        reporter.send("error", message=str(error))
        return exit_status(error)
    except ImportError as error:
        if lacks_memory(error):
            reporter.send("error", message=system_error_message(MemoryError()))
            return 1
        reporter.send(
            "error",
            message=f"a part of Scope cannot be loaded ({error}): disable Scope in the preferences "
            "and enable it again; if that does not help, reinstall it",
        )
    except (OSError, MemoryError) as error:
        reporter.send("error", message=system_error_message(error))
    except Exception as error:  # a defect is reported in the panel; the log has the traceback
        import traceback

        traceback.print_exc()
        reporter.send(
            "error",
            message=f"this is a bug in Scope ({type(error).__name__}: {error}); please report it",
        )
    return 1


def _capture(request: JobRequest, job_folder: Path, reporter: Reporter) -> None:
    """Capture and write the results."""
    # Imported here, so that a missing package is reported in the panel.
    from ..capture.options import capture_options
    from ..untrusted.body_file import load_body
    from .preview import PreviewWriter
    from .watched_capture import watched_capture

    named = WatchedFiles(request.named_files())
    views = [Path(view) for view in request.views]
    with watched_capture(cache_of(job_folder), Path(request.footage), views, named) as running:
        with PreviewWriter(job_folder, reporter.send) as watch:
            body = load_body(request.values["body"])
            options = capture_options(request.values)
            result = running.run(body, options, reporter.progress, watch)
        names = [f"person{i + 1}.npz" for i in range(len(result.motions))]
        reporter.progress("writing", 0, 0)
        for name, motion in zip(names, result.motions, strict=True):
            motion.save(job_folder / name)
    reporter.send("result", motions=names, report=result.report.as_json())


def main(job_folder: Path) -> NoReturn:
    """Run the worker process: the request on stdin, messages on stdout, everything else on
    stderr.
    """
    keep_solver_hints_from_users()
    # Everything that libraries print to stdout, including from C, goes to stderr; the messages get
    # the real stdout.
    stream = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    # Unbuffered, so that the commands after the request are not read with it.
    with open(0, "rb", buffering=0, closefd=False) as stdin:
        line = stdin.readline().decode("utf-8", "replace")
    if not line:  # the parent ended before it sent the request
        _remove(job_folder)
        _exit(1)
    commands = Commands()
    status = 1
    reporter = Reporter(stream)
    with contextlib.suppress(BrokenPipeError):
        try:
            request = _parsed(line)
            _confine(request, job_folder)  # before there are other threads
            end_with_parent(lambda: _remove(job_folder), commands.receive)
            _lower_priority(_NICENESS if request else _NICENESS_OF_WARM_UP)
            status = run(request, job_folder, reporter, commands)
        except ScopeError as error:
            reporter.send("error", message=str(error))
    _exit(status)


def _parsed(line: str) -> Request:
    """Return the request in a line; None to compile what captures need.

    :raises UsageError: it is none.
    """
    if line.strip() == WARM_UP:
        return None
    kinds = (FormatsRequest, PictureRequest, LiveRequest)
    kind = next((each for each in kinds if each.is_in(line)), JobRequest)
    return kind.from_json(line)


def _confine(request: Request, job_folder: Path) -> None:
    """Confine this process, unless it reads nothing but our own clip: Python and numba then store
    what they compile, wherever that is.
    """
    if request is None:
        return
    folders = [cache_of(job_folder) or job_folder.parent]
    values = {} if isinstance(request, FormatsRequest | PictureRequest) else request.values
    if isinstance(request, LiveRequest) and values["keep_footage"]:
        folders += folders_of(Path(values["keep_footage"]))
    confine_capture(
        folders,
        connects=isinstance(request, LiveRequest) and request.online,
        starts_programs=bool(values.get("detector") or values.get("keypoints")),
    )


def _exit(status: int) -> NoReturn:
    """Exit without exit handlers, which would wait for threads of the networks and of the
    decoder.
    """
    with contextlib.suppress(OSError):
        sys.stderr.flush()
    os._exit(status)


def _remove(job_folder: Path) -> None:
    """Remove the folder, even while another thread writes to it: once renamed, no new file can be
    created in it.
    """
    renamed = job_folder.with_name(f"{job_folder.name}.gone")
    with contextlib.suppress(OSError):
        job_folder.rename(renamed)
    for _ in range(_REMOVAL_ATTEMPTS):
        discard(job_folder)
        remove(renamed)
        if not renamed.exists() and not job_folder.exists():
            return


def _lower_priority(niceness: int) -> None:
    """Lower the priority, so that Blender stays responsive; on Windows the parent starts the
    process with it.
    """
    if hasattr(os, "nice"):
        with contextlib.suppress(OSError):
            os.nice(niceness)
