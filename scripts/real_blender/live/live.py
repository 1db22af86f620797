# SPDX-License-Identifier: GPL-3.0-or-later
"""Live captures of a network camera in a Blender with a window: start, record, stop, undo, save,
reopen, trouble.

Usage: ``blender --python live.py -- VIDEO OUT_FOLDER``
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from live.session import (
    ADDRESS,
    GONE_S,
    begin,
    camera,
    captures,
    connection_closed,
    gone,
    moving,
    report,
    start,
    state,
)
from live.takes import SAVED, captured_again, kept_take, played, recorded
from shared.session import (
    FOOTAGE,
    OUT,
    inventory,
    invoke,
    key,
    picture,
    run,
    show_tab,
    until,
    use,
    viewport,
    workers,
)

OVER_PANEL = (1174, 300)
MEASURED_S = 2.0


def shares(values: list[float]) -> dict[str, float]:
    """Return the distribution of seconds, in milliseconds."""
    found = np.percentile(1e3 * np.array(values), [50, 99, 100])
    return dict(zip(("median", "p99", "largest"), np.round(found, 2).tolist(), strict=True))


def measured(seconds: float, what: str) -> Iterator[float]:
    """Measure the timer's gaps, and the time in which the running capture applies a pose.

    The viewport is hidden meanwhile: without a graphics card, one drawing of it takes a second on a
    busy machine.
    """
    job = state().job
    steps = []
    own = []
    gaps = []
    original = job.step

    def step() -> bool:
        before = job.poses
        began = time.perf_counter()
        used = time.thread_time()
        running = original()
        if job.poses != before:
            steps.append(time.perf_counter() - began)
            own.append(time.thread_time() - used)
        return running

    job.step = step
    area = viewport()["area"]
    area.type = "TEXT_EDITOR"
    yield 0.5
    poses = job.poses
    began = time.monotonic()
    last = began
    while last - began < seconds or not steps:
        assert last - began < 60, "no pose comes"
        yield 0.005
        now = time.monotonic()
        gaps.append(now - last)
        last = now
    job.step = original
    area.type = "VIEW_3D"
    report[what] = {
        "timer_gap_ms": shares(gaps),
        "apply_ms": shares(steps),
        "apply_processor_ms": shares(own),
        "poses_shown_per_second": round((job.poses - poses) / (last - began), 1),
        "status": dict(vars(job.status)),
    }


def prepared() -> Iterator[float]:
    """Open the panel, and be refused while Blender may not go online."""
    panel = next(p for p in bpy.types.Panel.__subclasses__() if p.__name__ == "SCOPE_PT_live")
    bpy.utils.unregister_class(panel)
    panel.bl_options = set()
    bpy.utils.register_class(panel)
    show_tab()
    yield 1.0
    show_tab()
    settings = bpy.context.scene.scope_live
    settings.camera = "99"
    # in a process of its own, as it would ask a camera that exists
    use(bpy.ops.scope.camera_formats)
    yield from until(lambda: state().asking is None, 60, "an answer about a camera")
    report["camera_formats"] = state().message
    assert "Camera 99 does not exist" in state().message, state().message
    yield 0.5
    picture("19_live_formats")
    settings.source = "STREAM"
    settings.stream = ADDRESS.replace("//", "//me:secret@")
    assert settings.stream == ADDRESS, settings.stream
    bpy.context.preferences.system.use_online_access = False
    try:
        use(bpy.ops.scope.live, "INVOKE_DEFAULT")
    except RuntimeError as error:
        report["offline"] = str(error).strip()
    assert "Online Access" in report["offline"]
    assert state().job is None
    yield 0.5
    picture("20_live_offline")
    bpy.context.preferences.system.use_online_access = True
    use(bpy.ops.ed.undo_push, message="Prepared")


def followed() -> Iterator[float]:
    """Start, change the scene and undo it while live, and redo it."""
    yield from start()
    yield from moving()
    yield 1.0
    picture("21_live")
    yield from measured(MEASURED_S, "body")
    use(bpy.ops.object.empty_add)
    yield 0.3
    for operator in (bpy.ops.ed.undo, bpy.ops.ed.redo, bpy.ops.ed.undo):
        invoke(operator)
        yield from moving()
    report["undone_while_live"] = "the body follows"


def interrupted(server: subprocess.Popen) -> Iterator[float]:
    """Kill the camera, see what the panel says, and start it again."""
    server.kill()
    server.wait()
    yield from until(lambda: state().job.status.notice, 60, "a sentence about the interruption")
    yield 0.5
    report["interrupted"] = state().job.status.notice
    picture("22_live_interrupted")


def slept() -> Iterator[float]:
    """Stop the process for eight seconds, as a computer that sleeps does: a sentence, and the body
    follows again.
    """
    worker = state().job.worker
    os.kill(worker.pid, signal.SIGSTOP)
    yield 8.0
    assert state().job.quiet_s > 0, "the panel does not say that nothing comes"
    os.kill(worker.pid, signal.SIGCONT)
    yield from until(lambda: state().job.status.notice, 60, "a sentence about the pause")
    report["slept"] = state().job.status.notice
    yield from until(lambda: not state().job.status.notice, 60, "the poses after it")
    yield from moving()


def cancelled(before: dict) -> Iterator[float]:
    """Press Escape over the panel."""
    worker = state().job.worker
    key("Escape", OVER_PANEL)
    yield from gone(worker, "Escape")
    yield from until(lambda: state().job is None, 60, "the end")
    assert inventory() == before, (inventory(), before)
    key("Shift_L")  # moves the mouse away, whose tooltip would cover the panel


def closed(how: str) -> Iterator[float]:
    """Close another Blender, or let it crash, while live: the camera is left at once, and no worker
    runs.
    """
    script = str(Path(__file__).resolve().parents[1] / "shared" / "closed.py")
    other = subprocess.Popen(["blender", "--python", script, "--", FOOTAGE, str(OUT), how, ADDRESS])
    yield from until(lambda: other.poll() is not None, 400, "the other Blender to end")
    ended = time.monotonic()
    does = (OUT / f"live_{how}").read_text("utf-8")
    assert does == "capturing", does
    assert other.returncode == (-9 if how == "crash" else 0), other.returncode
    yield from connection_closed(ended, f"Blender's {how}")
    yield from until(lambda: not workers(), 60, "the worker to end")


def reopened() -> Iterator[float]:
    """Open the file that was saved while live, while live again."""
    begin()
    yield 0.5
    worker = state().job.worker
    assert worker.alive
    bpy.ops.wm.open_mainfile(filepath=str(SAVED))
    yield from gone(worker, "opening a file")
    assert state().job is None, "a live capture survived another file"
    assert not captures()
    assert "Live" in bpy.data.objects
    assert bpy.context.scene.scope_live.stream == ADDRESS


def stopped() -> Iterator[float]:
    """Stop without a recording, with a rig: the last pose stays, and undo removes it."""
    source = next(o for o in captures()[0].all_objects if o.type == "ARMATURE")
    rig = bpy.data.objects.new("rig", source.data.copy())
    bpy.context.scene.collection.objects.link(rig)
    rig.scale = (1.2, 1.2, 1.2)
    rig.location = (2.0, 0.0, 0.0)
    settings = bpy.context.scene.scope_retarget
    settings.rig = rig
    settings.captured = "beside"
    bpy.context.scene.scope_live.with_rig = True
    use(bpy.ops.ed.undo_push, message="A rig")
    before = inventory()
    posed = rig_pose()
    yield from start()
    yield from measured(MEASURED_S, "body_and_rig")
    worker = state().job.worker
    use(bpy.ops.scope.stop_live)
    yield from gone(worker, "Stop")
    yield from until(lambda: state().job is None, 60, "the end")
    assert inventory() != before
    yield 0.5
    assert rig_pose() != posed
    picture("25_live_stopped")
    invoke(bpy.ops.ed.undo)
    yield 0.5
    assert inventory() == before, (inventory(), before)
    assert rig_pose() == posed


def rig_pose() -> list[tuple[float, ...]]:
    """Return the channels of the rig."""
    return [
        (*bone.location, *bone.rotation_quaternion) for bone in bpy.data.objects["rig"].pose.bones
    ]


def disabled() -> Iterator[float]:
    """Disable the extension while live."""
    begin()
    yield 0.5
    worker = state().job.worker
    assert worker.alive
    name = next(a.module for a in bpy.context.preferences.addons if a.module.endswith(".scope"))
    bpy.ops.preferences.addon_disable(module=name)
    began = time.monotonic()
    yield from until(lambda: not worker.alive, GONE_S, "the process to end after disabling")
    report["gone_s"]["disabling"] = round(time.monotonic() - began, 2)


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    yield from prepared()
    server = yield from camera()
    before = inventory()
    yield from followed()
    yield from interrupted(server)
    server = yield from camera()
    yield from until(lambda: not state().job.status.notice, 60, "the camera to come back")
    yield from moving()
    yield from slept()
    yield from cancelled(before)
    yield from recorded()
    yield from kept_take()
    yield from captured_again()
    yield from played()
    yield from stopped()
    for how in ("quit", "crash"):
        yield from closed(how)
    yield from reopened()
    yield from disabled()
    server.kill()
    (OUT / "live.json").write_text(json.dumps(report))


run(steps())
