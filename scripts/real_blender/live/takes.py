# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded takes in a Blender with a window: undone, smoothed, saved, reopened, and captured again
from footage.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
from live.session import (
    ADDRESS,
    begin,
    captures,
    connection_closed,
    moving,
    plays,
    report,
    start,
    state,
)
from shared.file_state import curves_of
from shared.session import FOOTAGE, OUT, addon, captured, invoke, picture, until, use

SAVED = OUT / "live.blend"
TAKE = OUT / "live_take.blend"
RECORDED_S = 5.0


def recorded() -> Iterator[float]:
    """Save while live, record, stop, undo and redo."""
    yield from start()
    bpy.ops.wm.save_as_mainfile(filepath=str(SAVED))
    assert b"secret" not in SAVED.read_bytes()
    yield from moving()
    settings = bpy.context.scene.scope_live
    settings.countdown_s = 1
    settings.with_scene = True
    pressed = time.monotonic()
    use(bpy.ops.scope.record_live)
    assert not state().job.recording
    yield from until(lambda: state().job.recording, 60, "the end of the countdown")
    began = time.monotonic()
    yield from until(plays, 60, "the scene to play")
    yield RECORDED_S
    picture("23_live_recording")
    worker = state().job.worker
    stopped = time.monotonic()
    least_s = 0.5 * (stopped - began)
    use(bpy.ops.scope.stop_live)
    yield from connection_closed(stopped, "Stop of a recording")
    yield from until(lambda: not worker.alive, 120, "the recording")
    report["recorded_and_gone_s"] = round(time.monotonic() - stopped, 2)
    yield from until(lambda: state().job is None, 60, "the keys")
    assert len(captures()) == 1, state().message
    assert not plays()
    person = next(o for o in captures()[0].all_objects if o.type == "ARMATURE")
    assert "scope_motion" in person
    assert person.pose.bones["head"].custom_shape is not None
    first, last = person.animation_data.action.frame_range
    report["recorded_s"] = (last - first) / bpy.context.scene.render.fps
    # On a busy machine, the end of the countdown is seen late, and the first pose comes late.
    most_s = stopped - pressed + 1.0
    assert least_s < report["recorded_s"] < most_s, (least_s, report["recorded_s"], most_s)
    yield 0.5
    picture("24_live_recorded")
    invoke(bpy.ops.ed.undo)
    yield 0.5
    assert not captures(), "one undo does not remove the recording"
    invoke(bpy.ops.ed.redo)
    yield 0.5
    assert len(captures()) == 1, "redo does not bring it back"
    use(bpy.ops.scope.smooth, strength=2.5)


def take() -> dict:
    """Return what a recorded take is made of."""
    person = next(o for o in captures()[0].all_objects if o.type == "ARMATURE")
    action = person.animation_data.action
    curves = curves_of(action)
    bone = 'pose.bones["left_hip"].rotation_quaternion'
    hip = next(each for each in curves if (each.data_path, each.array_index) == (bone, 1))
    return {
        "range": tuple(action.frame_range),
        "curves": len(curves),
        "keys": sum(len(curve.keyframe_points) for curve in curves),
        "left_hip": [round(point.co[1], 5) for point in hip.keyframe_points],
        "packed": hashlib.sha256(person["scope_motion"]["motion"]).hexdigest(),
    }


def kept_take() -> Iterator[float]:
    """Save the smoothed take, open it again, and smooth it again: keys and captured motion are
    those of before.
    """
    bpy.ops.wm.save_as_mainfile(filepath=str(TAKE))
    before = take()
    assert before["keys"] > 24 * 2, before
    bpy.ops.wm.open_mainfile(filepath=str(TAKE))
    yield 1.0
    after = take()
    assert after == before, (before, after)
    person = next(o for o in captures()[0].all_objects if o.type == "ARMATURE")
    bpy.context.view_layer.objects.active = person
    assert use(bpy.ops.scope.smooth, strength=0.0) == {"FINISHED"}
    rough = take()
    assert rough["left_hip"] != before["left_hip"], "smoothing a reopened take does nothing"
    assert use(bpy.ops.scope.smooth, strength=2.5) == {"FINISHED"}
    assert np.abs(np.subtract(take()["left_hip"], before["left_hip"])).max() < 1e-4
    report["take"] = {"keys": before["keys"], "range": before["range"]}


def captured_again() -> Iterator[float]:
    """Record with Keep Footage, and capture that footage: the same take, in the same place of the
    timeline.
    """
    settings = bpy.context.scene.scope_live
    settings.keep_footage = True
    settings.with_scene = False
    settings.countdown_s = 0
    count = len(captures())
    yield from start()
    use(bpy.ops.scope.record_live)
    yield RECORDED_S
    began = time.monotonic()
    use(bpy.ops.scope.stop_live)
    yield from connection_closed(began, "Stop of a recording with footage")
    yield from until(lambda: state().job is None, 120, "the keys")
    assert len(captures()) == count + 1, state().message
    kept = Path(bpy.path.abspath(bpy.context.scene.scope.footage))
    assert kept.is_file(), kept
    assert kept.parent == TAKE.parent
    live = frames_of(bpy.context.scene.scope.result.collection)
    bpy.context.scene.scope.quality = "FAST"
    yield from captured()
    assert len(captures()) == count + 2, addon().state.message
    again = frames_of(bpy.context.scene.scope.result.collection)
    report["again"] = {"live": live, "again": again, "footage": kept.stat().st_size}
    # The first live pose may come late on a busy machine; the footage is captured from its first
    # picture on.
    frames = 0.5 * bpy.context.scene.render.fps
    assert again[0] - frames < live[0] < live[1] < again[1] + frames, report["again"]
    settings.keep_footage = False


def played() -> Iterator[float]:
    """Record a video that is played in real time and ends by itself, with its own times; undo
    that.
    """
    settings = bpy.context.scene.scope_live
    count = len(captures())
    settings.source = "FILE"
    settings.file = FOOTAGE
    begin()
    job = state().job
    yield from until(lambda: job.has_body or state().job is None, 300, "the first pose")
    # On a busy machine, the video may have ended before the button can be pressed: then the last
    # pose stays.
    if state().job is not None and not job.finishing:
        use(bpy.ops.scope.record_live)
    yield from until(lambda: state().job is None, 120, "the end of the video")
    yield 0.5
    report["played"] = {"recorded": job.recording, "poses": job.poses}
    assert len(captures()) == count + job.recording, state().message
    if job.recording:
        first, last = frames_of(bpy.context.scene.scope.result.collection)
        fps = bpy.context.scene.render.fps
        assert first < last, (first, last)
        report["played"]["seconds"] = (last - first) / fps
    invoke(bpy.ops.ed.undo)
    yield 0.5
    assert len(captures()) == count, "one undo does not remove the recording of a video"
    settings = bpy.context.scene.scope_live
    settings.source = "STREAM"
    settings.stream = ADDRESS


def frames_of(collection: bpy.types.Collection) -> tuple[float, float]:
    """Return the first and the last key of a capture."""
    person = next(o for o in collection.all_objects if o.type == "ARMATURE")
    return tuple(person.animation_data.action.frame_range)
