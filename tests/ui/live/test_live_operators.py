# SPDX-License-Identifier: GPL-3.0-or-later
"""When the operators of live captures can be used; the window's part is tested in a real
Blender.
"""

from types import SimpleNamespace

import bpy
import pytest
from scope.scope_addon.ui.capture.capture_operators import state as capture_state
from scope.scope_addon.ui.live.live_operators import end_live
from scope.scope_addon.ui.live.live_panel import _speed
from scope.scope_addon.ui.live.live_state import state


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


def test_disabling_the_extension_ends_the_process(job):
    end_live()
    assert job.done == ["close"]
    assert state.job is None


def test_one_pose_per_second_is_singular():
    assert [_speed(rate, 20.0).split(",")[0] for rate in (0.3, 1.4, 2.0)] == [
        "0 poses/s",
        "1 pose/s",
        "2 poses/s",
    ]
