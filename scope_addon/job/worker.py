# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker's side of a job: reads the request, captures, writes motion files, tells how it goes."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import sys
import threading
import time
from pathlib import Path
from typing import IO, NoReturn

from ...solver.errors import ScopeError
from ..errors import exit_status
from .parent import when_parent_ends
from .request import JobRequest

_REMOVALS = 20  # attempts, each of which a file that was just being opened may foil
_MIN_INTERVAL_S = 0.05  # between two progress lines of one stage


class Reporter:
    """Writes JSON lines for the parent."""

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream
        self._last_stage, self._last_time = "", 0.0
        self._writing = threading.Lock()

    def send(self, event: str, **values: object) -> None:
        """One line, at once, from any thread."""
        line = json.dumps({"event": event, **values}) + "\n"
        with self._writing:
            self._stream.write(line)
            self._stream.flush()

    def progress(self, stage: str, done: int, total: int) -> None:
        """As ``capture`` calls it: often. The parent hears of every new stage, of its end, and some steps between."""
        now = time.monotonic()
        if stage == self._last_stage and done != total and now - self._last_time < _MIN_INTERVAL_S:
            return
        self._last_stage, self._last_time = stage, now
        self.send("progress", stage=stage, done=done, total=total)


def run(request: JobRequest, job_folder: Path, reporter: Reporter) -> int:
    """Capture and write; returns the process's exit status. Every failure becomes one ``error`` line."""
    try:
        reporter.progress("starting", 0, 0)
        # Imported here, so that a missing wheel becomes a sentence in the panel as well.
        from ...solver.loaders.body_file import load_body
        from ..capture.media.video_range import VideoRange
        from ..capture.options import CaptureOptions
        from ..capture.pipeline import capture
        from .preview import PreviewWriter

        options = CaptureOptions(
            quality=request.quality,
            people=request.people,
            heights_m=() if request.height_m is None else (request.height_m,),
            focal_mm=request.focal_mm,
            fov_deg=request.fov_deg,
            calibration=Path(request.calibration) if request.calibration else None,
            wanted=VideoRange(request.start_s, float("inf") if request.end_s is None else request.end_s),
            smoothing=request.smoothing,
            hands=request.hands,
            threads=request.threads,
            provider=request.provider,
            detector=Path(request.detector) if request.detector else None,
            keypoints=Path(request.keypoints) if request.keypoints else None,
        )
        with PreviewWriter(job_folder, reporter.send) as watch:
            result = capture(request.footage, load_body(request.body), options, reporter.progress, watch)
        names = [f"person{i + 1}.npz" for i in range(len(result.motions))]
        reporter.progress("writing", 0, 0)
        for name, motion in zip(names, result.motions, strict=True):
            motion.save(job_folder / name)
        reporter.send("result", motions=names, report=result.report)
        return 0
    except ScopeError as error:
        reporter.send("error", message=str(error))
        return exit_status(error)
    except ImportError as error:
        reporter.send("error", message=f"a part of Scope cannot be loaded ({error}); install the extension again")
    except (OSError, MemoryError) as error:
        reporter.send("error", message=f"the system refused: {error}; free space or memory and try again")
    except Exception as error:  # a defect of ours must reach the panel too; the log has the traceback
        import traceback

        traceback.print_exc()
        reporter.send("error", message=f"Scope failed, which is a defect ({type(error).__name__}: {error}); report it")
    return 1


def main(job_folder: Path) -> NoReturn:
    """Entry of the worker process: the request on stdin, JSON lines on stdout, everything else on stderr."""
    # What libraries print to stdout, also from C, goes to stderr; the parent's lines get the real stdout.
    stream = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    line = sys.stdin.readline()
    if not line:  # killed before it could ask
        _remove(job_folder)
        _leave(1)
    _die_with_parent(job_folder)
    _step_back()
    status = 1
    reporter = Reporter(stream)
    with contextlib.suppress(BrokenPipeError):
        try:
            status = run(JobRequest.from_json(line), job_folder, reporter)
        except ScopeError as error:
            reporter.send("error", message=str(error))
    _leave(status)


def _leave(status: int) -> NoReturn:
    """No exit handlers: threads of the networks and of the decoder must not hold the process up."""
    with contextlib.suppress(OSError):
        sys.stderr.flush()
    os._exit(status)


def _die_with_parent(job_folder: Path) -> None:
    """End when the parent has gone, or no longer wants the result. Half-written files go too."""

    def end() -> NoReturn:
        _remove(job_folder)
        os._exit(1)

    when_parent_ends(end)


def _remove(job_folder: Path) -> None:
    """Remove the folder although the main thread writes there: what has another name it finds no more."""
    gone = job_folder.with_name(f"{job_folder.name}.gone")
    with contextlib.suppress(OSError):
        job_folder.rename(gone)
    for _ in range(_REMOVALS):
        for folder in (gone, job_folder):
            shutil.rmtree(folder, ignore_errors=True)
        if not gone.exists() and not job_folder.exists():
            return


def _step_back() -> None:
    """Give way to Blender's window on a busy machine. (On Windows the parent starts the process this way.)"""
    if hasattr(os, "nice"):
        with contextlib.suppress(OSError):
            os.nice(5)
