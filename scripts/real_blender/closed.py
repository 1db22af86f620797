# SPDX-License-Identifier: GPL-3.0-or-later
"""Close Blender, or let it crash, while it captures: ``closed.py -- VIDEO OUT_FOLDER quit|crash``."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from session import ARGUMENTS, FOOTAGE, OUT, addon, invoke, run, until, use


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    yield 0.5
    bpy.context.scene.scope.quality = "FAST"
    bpy.ops.scope.choose_footage(filepath=FOOTAGE)
    use(bpy.ops.scope.capture, "INVOKE_DEFAULT")
    yield from until(lambda: addon().state.job is None or addon().state.job.progress.done > 5, 300, "the worker")
    (OUT / f"closed_{ARGUMENTS[2]}").write_text("capturing" if addon().state.job else addon().state.message)
    if ARGUMENTS[2] == "crash":
        os.kill(os.getpid(), signal.SIGKILL)
    invoke(bpy.ops.wm.quit_blender)
    yield 60.0


run(steps())
