# SPDX-License-Identifier: GPL-3.0-or-later
"""When the operators of live captures can be used; the window's part is tested in a real
Blender.
"""

from types import SimpleNamespace

import bpy
import pytest
from scope.scope_addon.ui import live_operators
from scope.scope_addon.ui.capture_operators import state as capture_state
from scope.scope_addon.ui.live_operators import SCOPE_PT_live, end_live, play_scene
from scope.scope_addon.ui.live_properties import state


class FakeJob:
    """A running live capture."""

    def __init__(self):
        self.done = []
        self.recording = False
        self.finishing = False
        self.has_body = True

    countdown_s = 0

    def record(self, countdown_s):
        self.recording = True
        self.done.append(f"record in {countdown_s} s")

    def stop(self):
        self.finishing = True
        self.done.append("stop")

    def cancel(self):
        self.done.append("cancel")

    def close(self):
        self.done.append("close")


@pytest.fixture
def job():
    state.job = FakeJob()
    yield state.job
    state.job = None


def test_without_a_window_there_is_none():
    with pytest.raises(RuntimeError, match="needs Blender's window"):
        bpy.ops.scope.live("INVOKE_DEFAULT")
    for operator in (bpy.ops.scope.record_live, bpy.ops.scope.stop_live, bpy.ops.scope.cancel_live):
        assert not operator.poll()


def test_one_capture_runs_at_a_time(job):
    assert not bpy.ops.scope.live.poll()
    bpy.context.scene.scope.footage = "walk.mp4"
    assert not bpy.ops.scope.capture.poll()
    state.job = None
    assert bpy.ops.scope.capture.poll()
    capture_state.job = SimpleNamespace(close=lambda: None)
    assert not bpy.ops.scope.live.poll()
    capture_state.job = None
    assert bpy.ops.scope.live.poll()


def test_record_stop_and_cancel(job):
    job.has_body = False
    assert not bpy.ops.scope.record_live.poll()
    job.has_body = True
    bpy.context.scene.scope_live.countdown_s = 3
    bpy.ops.scope.record_live()
    bpy.ops.scope.record_live()  # already
    bpy.ops.scope.stop_live()
    assert not bpy.ops.scope.record_live.poll()
    assert not bpy.ops.scope.stop_live.poll()
    bpy.ops.scope.cancel_live()
    assert job.done == ["record in 3 s", "stop", "cancel"]


@pytest.mark.parametrize("is_playing", [False, True])
def test_a_scene_plays_along_from_the_first_frame_with_its_sound(monkeypatch, is_playing):
    """Blender does not move sound that is playing to a frame that is set meanwhile."""
    scene = bpy.context.scene
    scene.scope_live.with_scene = True
    scene.scope.start_frame = 30
    scene.frame_set(77)
    screen = SimpleNamespace(is_animation_playing=is_playing)
    done = []

    def play():
        done.append(("play", scene.frame_current))
        screen.is_animation_playing = not screen.is_animation_playing

    def cancel(restore_frame):
        done.append(("cancel", scene.frame_current, restore_frame))
        screen.is_animation_playing = False

    screen_operators = SimpleNamespace(animation_play=play, animation_cancel=cancel)
    monkeypatch.setattr(
        live_operators, "bpy", SimpleNamespace(ops=SimpleNamespace(screen=screen_operators))
    )
    play_scene(SimpleNamespace(scene=scene, screen=screen))
    assert screen.is_animation_playing
    assert done == [*([("cancel", 77, False)] if is_playing else []), ("play", 30)]


def test_disabling_the_extension_ends_the_process(job):
    end_live()
    assert job.done == ["close"]
    assert state.job is None


def header(job):
    """Return what the header of the panel shows, which may be closed."""
    shown = []
    layout = SimpleNamespace(
        label=lambda **given: shown.append((given["text"], given["icon"])),
        operator=lambda name, **_: shown.append(name),
    )
    SCOPE_PT_live.draw_header_preset(SimpleNamespace(layout=layout), bpy.context)
    return shown


def test_the_header_of_the_panel_shows_what_runs_while_it_is_closed(job):
    job.quiet_s = 0
    job.status = SimpleNamespace(notice="", presence="", rate=0.0, latency_ms=0.0, recorded_s=0.0)
    stop = "scope.stop_live"
    assert header(job) == [("Waiting for the source", "NONE"), stop]
    job.status.presence = "seen"
    job.status.rate = 24.0
    job.status.latency_ms = 71.0
    assert header(job) == [("24 poses/s, latency 71 ms", "NONE"), stop]
    job.recording = True
    job.status.recorded_s = 2.54
    assert header(job) == [("Recorded: 2.5 s", "REC"), stop]
    job.quiet_s = 3
    assert header(job) == [("No image from the source for 3 s", "ERROR"), stop]
    state.job = None
    assert header(job) == []
    state.message = "the camera was unplugged"
    state.scene_uid = bpy.context.scene.session_uid
    assert header(job) == [("", "ERROR")]
    state.message = ""
