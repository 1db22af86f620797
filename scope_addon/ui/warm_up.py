# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiling the solver in the background after the extension was enabled, so that the first capture
need not wait.

Where machine code for this computer comes with the extension, that takes a few seconds and compiles
nothing. It happens once for each installed version, at the lowest priority, never in Blenders
without a window, and ends with Blender, or when a capture begins. Only the standard library is
loaded: the solver's libraries would stop the window for a second.
"""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.types import UILayout

from ..machine_code.kernel_count import kernel_count
from ..temporary import new_folder
from .preferences import PACKAGE, cache, preferences, python_command
from .reporting import iface_
from .viewports import redraw_sidebars

if TYPE_CHECKING:
    from ..job.process import WorkerProcess

ROOT = Path(__file__).resolve().parents[2]
_DELAY_S = 3.0
_INTERVAL_S = 1.0


class WarmUp:
    """The process that compiles; ``worker`` is None while there is none."""

    worker: WorkerProcess | None = None
    files_before = 0  # of compiled code, when it began


def attach() -> None:
    """Begin in a few seconds, in a Blender with a window where Scope is enabled as an extension."""
    if not bpy.app.background and preferences() is not None:
        # also if a file is opened meanwhile
        bpy.app.timers.register(step, first_interval=_DELAY_S, persistent=True)


def detach() -> None:
    """Stop."""
    if bpy.app.timers.is_registered(step):
        bpy.app.timers.unregister(step)
    stop()


def step() -> float | None:
    """Start the process, or see whether it has ended; return in how many seconds to call again. A
    timer calls this.
    """
    if WarmUp.worker is None:
        if is_compiled() or not start():
            return None
    elif has_ended(WarmUp.worker):
        stop()
    # the panel alone: drawing a viewport without a graphics card takes a fifth of a second
    redraw_sidebars()
    return _INTERVAL_S if WarmUp.worker else None


def start() -> bool:
    """Start the process; return whether that worked. If not, the first capture compiles the
    solver.
    """
    from ..errors import SetupError
    from ..job.process import WorkerProcess

    kernels = cache().kernels
    try:
        kernels.mkdir(parents=True, exist_ok=True)
        WarmUp.files_before = _files()
        WarmUp.worker = WorkerProcess(None, new_folder("warm-up"), kernels, python_command())
    except (OSError, SetupError):
        return False
    return True


def has_ended(worker: WorkerProcess) -> bool:
    """Return whether the process has ended, and note it if everything is compiled."""
    from ..job.process import WorkerFailedError

    try:
        worker.poll()
    except WorkerFailedError:
        return True
    if worker.finished:
        with contextlib.suppress(OSError):
            _marker().touch()
    return worker.finished


def stop() -> None:
    """End the process. What it has compiled is kept."""
    worker = WarmUp.worker
    WarmUp.worker = None
    if worker is not None:
        worker.close()


def draw(layout: UILayout) -> None:
    """Show the progress while the solver is being compiled."""
    if WarmUp.worker is not None and (compiled := _files() - WarmUp.files_before) > 0:
        share = min(1.0, compiled / kernel_count())
        text = iface_("Compiling the solver: {percent:.0f} %", percent=100 * share)
        layout.progress(text=text, factor=share)


def _files() -> int:
    return sum(1 for _ in cache().kernels.glob("*/*.code"))


def is_compiled() -> bool:
    """Return whether no capture has to wait for the solver to be compiled; False if that is not
    known.
    """
    return _marker().exists()


def _marker() -> Path:
    """Return the file that says that everything is compiled for this installation and this
    Blender's Python.
    """
    import hashlib

    installed = (ROOT / "__init__.py").stat().st_mtime_ns
    digest = hashlib.sha256(f"{PACKAGE} {ROOT} {installed} {sys.version}".encode(errors="replace"))
    return cache().kernels / f"{digest.hexdigest()[:16]}.ready"
