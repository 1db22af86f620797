# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs on a Dask worker: the check whether it can capture, and the capture of a clip in a
process of its own.

The capture is a subprocess, because the workers of a Dask nanny may not have children of
`multiprocessing`. It ends with the worker, because the worker's end closes its standard input.
"""

from __future__ import annotations

import os
import platform
import sys
from functools import partial
from pathlib import Path
from typing import Any

from distributed import Status, Worker, get_worker

from ...solver.errors import InputError, ScopeError
from ..errors import OutputError
from ..footage import display_address, is_url
from ..installed import CAPTURE, check_installed
from ..job.clip_runner import ClipProcesses
from ..job.clip_task import RATE, CaptureSettings, ClipTask, Entry, Extras, capture_clip, failure
from ..job.request import program_version
from ..temporary import remove_abandoned, system_folder, temporary_folder
from . import remote
from .remote import TOKEN

PROGRAM = (sys.executable, "-m", __name__.rpartition(".cluster")[0])
# statuses of an attempt, in addition to those of a clip
LOST = "lost"
REFUSED = "refused"


def check_worker(wanted: dict[str, Any]) -> dict[str, Any]:
    """Return what the worker is, and as ``problem`` why it cannot capture; empty if it can.

    :param wanted: plain values, because a worker with another version of Scope has to understand
        them.
    """
    remove_abandoned(system_folder())  # footage that a killed worker of this machine has left
    try:
        problem = _problem(wanted)
    except (ScopeError, OSError) as error:
        problem = str(error)
    return {"host": platform.node(), "threads": get_worker().state.nthreads, "problem": problem}


def _problem(wanted: dict[str, Any]) -> str:
    ours = program_version()
    theirs = wanted["program"]
    if ours != theirs:
        return (
            f"it runs another version of Scope ({ours[:8]}, and not {theirs[:8]}); install the "
            f"same version there"
        )
    check_installed(CAPTURE + (("bpy",) if wanted["bpy"] else ()))
    folder = wanted["folder"]
    attempts = wanted["attempts"]
    with remote.store_errors(InputError, folder):
        if not (remote.is_folder(folder) if is_url(folder) else Path(folder).is_dir()):
            return (
                f"it has no folder {display_address(folder)}; all machines need the footage under "
                f"the same path"
            )
    token = Path(attempts, TOKEN)
    with remote.store_errors(OutputError, attempts):
        text = (
            remote.read_text(f"{attempts}/{TOKEN}")
            if is_url(attempts)
            else token.is_file() and token.read_text()
        )
    if text != wanted["token"]:
        return (
            f"it does not see the output folder {display_address(wanted['out'])}; all machines "
            f"need it under the same path"
        )
    settings = CaptureSettings(
        wanted["options"],
        tuple(wanted["suffixes"]),
        Extras(*wanted["extras"]),
        tuple(wanted["further_files"]),
    )
    if settings.basis(ours) != wanted["basis"]:
        return (
            "a file that the options name, or one to which it refers, is missing or different "
            "there; all machines need the same under its path"
        )
    return ""


def capture_on_worker(
    task: ClipTask, key: str, program: tuple[str, ...] | None, jobs: int, version: str
) -> Entry:
    """Capture a clip into the folder of an attempt, ``task.out``, and return its entry with the
    hashes of the results.

    :param key: Dask's key of this task.
    :param program: command that takes ``capture FILE -o OUT --json``; None for this installation.
    :param jobs: number of clips that are captured in parallel on this worker.
    :param version: the version of Scope, which a worker that was started again may not have any
        more.
    """
    if program_version() != version:
        return {
            "status": REFUSED,
            "message": "it runs another version of Scope now; install the same version there",
        }
    worker = get_worker()
    if not is_url(task.out):
        try:
            Path(task.out).mkdir()
        # given up meanwhile, or begun before this worker was started again
        except OSError as error:
            return {
                "status": LOST,
                "message": f"the folder of the attempt cannot be made ({error.strerror})",
            }
    run = partial(ClipProcesses().run, wanted=partial(_is_wanted, worker, key))
    threads = max(1, min(worker.state.nthreads, os.cpu_count() or 1) // jobs)
    with temporary_folder("footage") as scratch:
        local = task
        try:
            if is_url(task.footage):
                rate_given = RATE in task.settings.options
                with remote.store_errors(InputError, task.footage):
                    path = remote.download(task.footage, scratch, with_sequence=rate_given)
                local = local._replace(footage=str(path), address=display_address(task.footage))
        except ScopeError as error:
            return failure(task, str(error))
        if is_url(task.out):
            local = local._replace(out=str(scratch / "results"))
        entry = capture_clip(local, program or PROGRAM, run, threads)
        if "message" in entry:
            entry["message"] = entry["message"].replace(
                local.footage, display_address(task.footage)
            )
        try:
            if entry["status"] == "done" and is_url(task.out):
                _upload(Path(local.out), entry["outputs"], task.out)
            return entry
        except (ScopeError, OSError) as error:
            return {
                "status": LOST,
                "message": f"a result cannot be read again or uploaded ({error})",
            }


def _upload(folder: Path, names: list[str], out: str) -> None:
    """Upload results to the store that an attempt is in."""
    for name in names:
        with remote.store_errors(OutputError, out):
            remote.upload(folder / name, f"{out}/{name}")


def _is_wanted(worker: Worker, key: str) -> bool:
    """Return whether the scheduler still waits for a task; if not, or if it is lost, nobody
    does.
    """
    state = worker.state.tasks.get(key)
    alive = worker.status in (Status.running, Status.paused)
    return alive and state is not None and state.state in ("executing", "long-running")
