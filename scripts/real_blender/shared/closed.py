# SPDX-License-Identifier: GPL-3.0-or-later
"""Close Blender, or let it crash, while it captures: ``closed.py -- VIDEO OUT_FOLDER quit|crash
[STREAM]``.

With the address of a stream, it captures that live. The file closed_HOW in OUT_FOLDER says what it
did, and live_HOW if that was live.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shared.session import ARGUMENTS, FOOTAGE, OUT, addon, interface, invoke, run, until, use


def footage() -> Iterator[float]:
    """Capture the footage, slowly enough not to end before Blender does; return what it does."""
    bpy.context.scene.scope.quality = "BEST"
    bpy.ops.scope.choose_footage(filepath=FOOTAGE)
    use(bpy.ops.scope.capture, "INVOKE_DEFAULT")
    yield from until(
        lambda: addon().state.job is None or addon().state.job.progress.done > 5, 300, "the worker"
    )
    return "capturing" if addon().state.job else addon().state.message


def stream(address: str) -> Iterator[float]:
    """Capture a stream live, until the body follows; return what it does."""
    bpy.context.preferences.system.use_online_access = True
    settings = bpy.context.scene.scope_live
    settings.source = "STREAM"
    settings.stream = address
    use(bpy.ops.scope.live, "INVOKE_DEFAULT")
    state = interface("live_properties").state
    yield from until(lambda: state.job is None or state.job.has_body, 300, "the first pose")
    return "capturing" if state.job else state.message


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    how, *address = ARGUMENTS[2:]
    yield 0.5
    does = yield from (stream(*address) if address else footage())
    (OUT / f"{'live' if address else 'closed'}_{how}").write_text(does)
    if how == "crash":
        os.kill(os.getpid(), signal.SIGKILL)
    invoke(bpy.ops.wm.quit_blender)
    yield 60.0


run(steps())
