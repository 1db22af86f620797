# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared code of the live captures in a Blender with a window: the network camera, and what
runs.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Generator, Iterator
from pathlib import Path

import bpy
from shared.session import OUT, interface, until, use

ADDRESS = "http://127.0.0.1:8099/video"
PORT = "8099"
CLIENTS = OUT / "live_clients.txt"
# What ends at once takes tenths of a second on an idle machine, and a drawing or two on a busy one;
# what waits for one of the product's own time limits takes five seconds.
GONE_S = 4.0
report: dict = {}


def state():
    """Return the state of live captures."""
    return interface("live_properties").state


def camera() -> Generator[float, None, subprocess.Popen]:
    """Start the network camera, and wait until it answers."""
    script = str(Path(__file__).with_name("mjpeg_camera.py"))
    CLIENTS.unlink(missing_ok=True)
    process = subprocess.Popen([sys.executable, script, "/scope/pictures", PORT, str(CLIENTS)])
    yield from until(CLIENTS.exists, 60, "the network camera")
    return process


def clients() -> list[tuple[str, float]]:
    """Return what the camera says of its clients: "came" or "left", and when."""
    return [
        (what, float(when))
        for what, when in map(str.split, CLIENTS.read_text("utf-8").splitlines())
    ]


def connection_closed(began: float, what: str) -> Iterator[float]:
    """Check, by asking the camera, that nobody looked at it for long after something happened."""
    yield from until(
        lambda: clients()[-1][0] == "left", 30, f"the connection to be closed after {what}"
    )
    report.setdefault("connection_closed_s", {})[what] = seconds = round(
        clients()[-1][1] - began, 2
    )
    assert seconds < GONE_S, f"the connection was closed {seconds} s after {what}"


def begin() -> None:
    """Press Start."""
    assert use(bpy.ops.scope.live, "INVOKE_DEFAULT") == {"RUNNING_MODAL"}, state().message


def start() -> Iterator[float]:
    """Press Start, and wait until the body follows."""
    begin()
    yield from until(lambda: state().job is None or state().job.has_body, 300, "the first pose")
    assert state().job is not None, state().message


def gone(worker, what: str) -> Iterator[float]:
    """Check that a process ends at once."""
    began = time.monotonic()
    yield from until(lambda: not worker.alive, GONE_S, f"the process to end after {what}")
    report.setdefault("gone_s", {})[what] = round(time.monotonic() - began, 2)
    assert not worker.job_folder.exists() or state().job is not None, (
        f"{worker.job_folder} is left after {what}"
    )


def moving() -> Iterator[float]:
    """Check that the body moves."""
    seen: set[tuple[float, ...]] = set()

    def another() -> bool:
        if state().job.has_body:
            body = state().job._bodies[0].armature
            seen.add(tuple(body.pose.bones["left_hip"].rotation_quaternion))
        return len(seen) >= 3

    yield from until(another, 30, "the body to move")


def captures() -> list[bpy.types.Collection]:
    """Return the captures of the file."""
    return [collection for collection in bpy.data.collections if "scope_capture" in collection]


def plays() -> bool:
    """Return whether the scene's animation plays."""
    return bool(bpy.context.window_manager.windows[0].screen.is_animation_playing)
