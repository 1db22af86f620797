# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators of a capture: drawing its progress, cancelling, failures."""

import os
import shutil
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import pytest
from scope.scope_addon.errors import OutputError
from scope.scope_addon.scene.datablocks import captures_of
from scope.scope_addon.ui import capture_operators
from scope.scope_addon.ui.capture_job import CaptureJob
from scope.scope_addon.ui.capture_operators import (
    SAMPLE,
    SCOPE_OT_cancel,
    SCOPE_OT_capture,
    SCOPE_OT_capture_queue,
    SCOPE_PT_stop_capture,
    end_capture,
    state,
)
from scope.scope_addon.ui.job_operator import JobOperator
from scope.scope_addon.ui.view_operators import show_new_capture

from ..scene.exported import read_glb


def window_with_sidebar(category="Scope", width=200):
    """Return what the operator reads of a window whose 3D viewport has its sidebar at x 800 to
    1000.
    """
    sidebar = SimpleNamespace(
        type="UI", x=800, y=100, width=width, height=500, active_panel_category=category
    )
    viewport = SimpleNamespace(type="VIEW_3D", regions=[SimpleNamespace(type="WINDOW"), sidebar])
    timeline = SimpleNamespace(type="DOPESHEET_EDITOR", regions=[])
    return SimpleNamespace(screen=SimpleNamespace(areas=[timeline, viewport]))


def test_the_cancel_operator_ends_the_worker_immediately(fake_worker, footage):
    fake_worker("time.sleep(600)")
    bpy.context.scene.scope.footage = str(footage)
    assert not bpy.ops.scope.cancel.poll()
    state.job = CaptureJob(bpy.context.scene)
    assert not bpy.ops.scope.capture.poll()
    bpy.ops.scope.cancel()
    assert state.job.cancelled
    assert not state.job.worker.alive
    capture_operators.end_capture()
    assert bpy.ops.scope.capture.poll()


def test_an_unexpected_error_ends_the_capture():
    closed = []
    state.job = SimpleNamespace(
        close=lambda: closed.append(True), step=lambda: 1 / 0, cancelled=False
    )
    operator = SimpleNamespace(job_state=state)
    operator.step, operator._advance = (
        partial(getattr(SCOPE_OT_capture, name), operator) for name in ("step", "_advance")
    )
    operator.end = partial(JobOperator.end, operator)
    with pytest.raises(ZeroDivisionError):
        capture_operators.SCOPE_OT_capture.modal(
            operator, bpy.context, SimpleNamespace(type="TIMER", value="NOTHING")
        )
    assert closed
    assert state.job is None  # otherwise no other capture could be started


def test_the_panel_is_drawn_again_only_for_news_and_rarely(monkeypatch):
    drawn = []
    now = [100.0]
    monkeypatch.setattr(capture_operators, "redraw_sidebars", lambda: drawn.append(None))
    monkeypatch.setattr(capture_operators, "time", SimpleNamespace(monotonic=lambda: now[0]))
    lines = ["Finding the person"]
    progress = SimpleNamespace(lines=lambda _: lines, stage="finding the person")
    state.job = SimpleNamespace(progress=progress, messages=0, step=lambda: True, cancelled=False)
    operator = SimpleNamespace(
        _shown=("", "", 0), _drawn_s=0.0, _pause_s=0.3, timer_s=0.1, job_state=state
    )
    operator.step = partial(SCOPE_OT_capture.step, operator)
    operator._advance = partial(SCOPE_OT_capture._advance, operator)
    timer = SimpleNamespace(type="TIMER", value="NOTHING")

    def drawings(seconds=0.4):
        now[0] += seconds
        capture_operators.SCOPE_OT_capture.modal(operator, bpy.context, timer)
        return len(drawn)

    def seconds_of_news(seconds, step_s):
        drawn.clear()
        for _ in range(round(seconds / step_s)):
            state.job.messages += 1
            drawings(step_s)
        return len(drawn)

    assert [drawings(0.1), drawings(0.1)] == [1, 1]
    state.job.messages += 1
    assert [drawings(0.1), drawings(0.11), drawings(0.1)] == [1, 2, 2]
    lines.append("1 s left")
    assert [drawings(0.3), drawings(0.1)] == [3, 3]
    assert seconds_of_news(6.0, 0.1) in (15, 20)  # about three a second
    assert seconds_of_news(6.0, 0.2) in (5, 6)  # where a drawing lasts for 0.2 s, one a second
    drawn.clear()
    progress.stage = "building the scene"  # at once: it stops Blender for a while
    assert drawings(0.01) == 1
    state.job = None


def test_the_status_bar_is_cleared_in_every_workspace(monkeypatch):
    texts = {}

    def tell(_, text):  # like Blender, for the context's workspace
        texts[bpy.context.workspace.name] = text

    monkeypatch.setattr(bpy.types.WorkSpace, "status_text_set", tell)
    capture_operators.end_capture()
    assert len(texts) > 1
    assert texts == dict.fromkeys((workspace.name for workspace in bpy.data.workspaces), None)


def test_the_sample_exists():
    bpy.ops.scope.use_sample()
    assert bpy.context.scene.scope.footage == str(SAMPLE)
    assert SAMPLE.is_file()


@pytest.mark.parametrize(
    ("x", "y", "window", "cancels"),
    [
        (900, 300, window_with_sidebar(), True),
        (400, 300, window_with_sidebar(), False),  # over the viewport
        (900, 50, window_with_sidebar(), False),  # over the timeline below
        (900, 300, window_with_sidebar("Item"), False),
        (800, 300, window_with_sidebar(width=1), False),  # the sidebar is hidden
    ],
)
def test_escape_cancels_only_over_the_panel(x, y, window, cancels):
    state.job = SimpleNamespace(cancelled=False, close=lambda: None)
    state.started = time.monotonic()
    operator = SimpleNamespace(
        job_state=state, ask_to_cancel=partial(SCOPE_OT_capture.ask_to_cancel, None)
    )
    context = SimpleNamespace(window=window)
    escape = SimpleNamespace(type="ESC", value="PRESS", mouse_x=x, mouse_y=y)
    outcome = SCOPE_OT_capture.modal(operator, context, escape)
    assert outcome == ({"RUNNING_MODAL"} if cancels else {"PASS_THROUGH"})
    assert state.job.cancelled is cancels
    end_capture()


@pytest.mark.parametrize(("seconds", "asks"), [(3.0, False), (30.0, True)])
def test_cancelling_asks_when_more_than_ten_seconds_are_done(monkeypatch, seconds, asks):
    state.job = SimpleNamespace(cancelled=False, close=lambda: None)
    state.started = 100.0
    monkeypatch.setattr(
        capture_operators, "time", SimpleNamespace(monotonic=lambda: 100.0 + seconds)
    )
    questions = []
    layout = MagicMock()
    monkeypatch.setattr(capture_operators, "ask_to_stop", lambda: questions.append(True))
    monkeypatch.setattr(capture_operators.bpy, "app", SimpleNamespace(background=False))
    operator = SimpleNamespace(
        execute=lambda _: setattr(state.job, "cancelled", True) or {"FINISHED"}
    )
    try:
        SCOPE_OT_cancel.invoke(operator, None, None)
        assert bool(questions) is asks
        assert state.job.cancelled is not asks
        SCOPE_PT_stop_capture.draw(SimpleNamespace(layout=layout), None)
        assert f"{seconds:.0f} s" in str(layout.column.return_value.label.call_args)
        row = layout.column.return_value.row.return_value
        assert row.operator.call_args.args == ("scope.keep_capturing",)
        assert row.row.return_value.operator.call_args.args == ("scope.cancel",)
    finally:
        monkeypatch.undo()
        state.job = None


def copies(footage, *names):
    """Copy the footage beside itself; return the paths."""
    return [Path(shutil.copy(footage, footage.with_name(f"{name}.png"))) for name in names]


def choose_several(paths):
    """Choose several clips in the file browser."""
    files = [{"name": path.name} for path in paths]
    return bpy.ops.scope.choose_footage(directory=f"{paths[0].parent}{os.sep}", files=files)


def queued():
    return [(Path(clip.footage).name, clip.status) for clip in bpy.context.scene.scope.queue]


def test_a_place_of_a_person_is_of_one_picture_alone(footage):
    settings = bpy.context.scene.scope
    settings.footage = str(footage)
    for name, value in (("rotate", "90"), ("mirror", True)):
        settings.person = "400,540"
        settings.crop = "0,0,400,540"
        setattr(settings, name, value)
        assert (settings.person, settings.crop) == ("", "")
    settings.person = "400,540"
    choose_several([footage, *copies(footage, "b")])
    assert settings.person == ""


def test_places_in_a_picture_are_forgotten_where_other_footage_is_chosen(footage):
    settings = bpy.context.scene.scope
    settings.footage = str(footage)
    (other,) = copies(footage, "b")
    for chosen, stays in (
        (lambda: bpy.ops.scope.choose_footage(filepath=str(footage)), True),
        (lambda: bpy.ops.scope.choose_footage(filepath=str(other)), False),
        (lambda: setattr(settings, "footage_text", str(footage)), False),
        (lambda: bpy.ops.scope.use_sample(), False),
    ):
        settings.person = "400,540"
        settings.crop = "0,0,400,400"
        chosen()
        left = (settings.person, settings.crop)
        assert left == (("400,540", "0,0,400,400") if stays else ("", ""))


def test_clips_of_a_queue_are_captured_one_after_the_other_and_a_bad_one_stops_none(
    fake_worker, footage
):
    paths = copies(footage, "a", "b", "c")
    fake_worker(
        """
        if request["footage"].endswith("b.png"):
            send("error", message="b.png is damaged; choose another")
        else:
            finish()
        """
    )
    assert choose_several(paths) == {"FINISHED"}
    assert queued() == [("a.png", "WAITING"), ("b.png", "WAITING"), ("c.png", "WAITING")]
    bpy.context.scene.scope.queue[0].status = "CAPTURING"  # of a file saved during a capture
    assert bpy.ops.scope.capture_queue() == {"FINISHED"}
    assert queued() == [("a.png", "DONE"), ("b.png", "FAILED"), ("c.png", "DONE")]
    assert "b.png is damaged" in bpy.context.scene.scope.queue[1].message
    fake_worker("finish()")
    assert bpy.ops.scope.capture_queue() == {"FINISHED"}  # of those that failed
    assert queued() == [("a.png", "DONE"), ("b.png", "DONE"), ("c.png", "DONE")]
    assert bpy.context.scene.scope.queue[1].message == ""
    names = sorted(each.name for each in captures_of(bpy.context.scene))
    assert names == ["a", "b", "c"]
    assert not bpy.ops.scope.capture_queue.poll()
    assert bpy.ops.scope.remove_clip(index=1) == {"FINISHED"}
    assert queued() == [("a.png", "DONE"), ("c.png", "DONE")]


def test_the_startup_cube_is_hidden_by_what_a_clip_of_the_queue_adds_to_the_undo_history(
    fake_worker, footage, monkeypatch
):
    paths = copies(footage, "a", "b")
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    hidden = []
    begin = SCOPE_OT_capture_queue.begin
    monkeypatch.setattr(
        SCOPE_OT_capture_queue,
        "begin",
        lambda self, scene: hidden.append(cube.hide_get()) or begin(self, scene),
    )
    fake_worker("finish()")
    choose_several(paths)
    assert bpy.ops.scope.capture_queue() == {"FINISHED"}
    assert hidden == [False, True, True]


def test_a_capture_that_ends_in_another_scene_hides_no_startup_cube_of_the_shown_one():
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    captured = bpy.data.scenes.new("captured")
    show_new_capture(bpy.context, captured)
    assert not cube.hide_get()
    show_new_capture(bpy.context, bpy.context.scene)
    assert cube.hide_get()


@pytest.mark.slow
def test_clips_of_a_queue_are_written_as_files_beside_those_that_exist(
    fake_worker, footage, tmp_path
):
    paths = copies(footage, "a", "b")
    fake_worker("finish(people=2 if request['footage'].endswith('b.png') else 1)")
    choose_several(paths)
    settings = bpy.context.scene.scope
    folder = tmp_path / "files"
    settings.queue_format = "NPZ"
    settings.queue_folder = str(folder)
    assert not bpy.ops.scope.capture_queue.poll()
    folder.mkdir()
    present = folder / "a.npz"
    present.write_text("mine")
    assert bpy.ops.scope.capture_queue() == {"FINISHED"}
    written = ["a_2.npz", "b.person1.npz", "b.person2.npz"]
    assert sorted(path.name for path in folder.iterdir()) == [present.name, *written]
    assert present.read_text() == "mine"
    assert [clip.message for clip in settings.queue] == ["", ""]
    assert len(captures_of(bpy.context.scene)) == 2


def test_files_of_a_queue_have_the_frame_rate_of_their_clips_and_their_captures_names(
    fake_worker, footage, tmp_path
):
    """A scene with other animation keeps its rate, as it does with the captures of clips before: a
    clip is built once more at its own rate while the capture has the names.
    """
    scene = bpy.context.scene
    scene.render.fps = 10
    cube = bpy.data.objects.new("cube", None)
    scene.collection.objects.link(cube)
    cube.keyframe_insert("location", frame=1)
    fake_worker("finish()")
    choose_several([footage, *copies(footage, "a")])
    scene.scope.queue_format = "GLB"
    scene.scope.queue_folder = str(tmp_path)
    assert bpy.ops.scope.capture_queue() == {"FINISHED"}
    for capture in captures_of(scene):
        name = capture.name
        names = {obj.name for obj in capture.all_objects}
        assert names == {name, f"{name}_body", f"{name}_camera"}
        content, _ = read_glb(tmp_path / f"{name}.glb")
        assert {node["name"] for node in content["nodes"]} >= {name, f"{name}_body"}
        samplers = content["animations"][0]["samplers"]
        ends = {content["accessors"][sampler["input"]]["max"][0] for sampler in samplers}
        assert max(ends) == pytest.approx(9 / 25)
    assert sorted(capture.name for capture in captures_of(scene)) == ["a", "person"]
    assert scene.render.fps == 10


@pytest.fixture
def capture_two(fake_worker, footage, tmp_path, monkeypatch):
    """Return a function that captures a list of two clips, with a BVH file of each; before each
    step of a capture, it calls another one.
    """

    def capture(meanwhile=lambda: None):
        choose_several(copies(footage, "a", "b"))
        fake_worker("finish()")
        settings = bpy.context.scene.scope
        settings.queue_format = "BVH"
        settings.queue_folder = str(tmp_path)
        step = CaptureJob.step
        monkeypatch.setattr(CaptureJob, "step", lambda job: meanwhile() or step(job))
        assert bpy.ops.scope.capture_queue() == {"FINISHED"}
        assert sorted(each.name for each in captures_of(bpy.context.scene)) == ["a", "b"]

    return capture


def test_a_clip_whose_file_cannot_be_written_says_so_and_stays_in_the_scene(
    capture_two, monkeypatch
):
    def full(path, *_):
        raise OutputError(f"cannot write {path.name}: no space is left")

    monkeypatch.setattr(capture_operators, "write_captures", full)
    capture_two()
    assert queued() == [("a.png", "DONE"), ("b.png", "DONE")]
    messages = [clip.message for clip in bpy.context.scene.scope.queue]
    assert messages == [f"Cannot write {name}.bvh: no space is left" for name in ("a", "b")]


def test_a_clip_that_is_removed_while_it_is_captured_marks_no_other_as_done(capture_two):
    settings = bpy.context.scene.scope

    def remove():
        if Path(settings.footage).name == "a.png" and len(settings.queue) == 2:
            settings.queue.remove(0)

    capture_two(remove)
    assert queued() == [("b.png", "DONE")]


def test_what_the_user_undoes_during_a_queue_repeats_no_clip_and_loses_no_file(
    capture_two, tmp_path
):
    """Undo takes the list's states back with everything else in the scene."""

    def undo():
        for clip in bpy.context.scene.scope.queue:
            clip.status = "WAITING"

    capture_two(undo)
    assert queued() == [("a.png", "DONE"), ("b.png", "DONE")]
    assert sorted(path.name for path in tmp_path.glob("*.bvh")) == ["a.bvh", "b.bvh"]


def test_a_folder_that_is_gone_is_said_and_nothing_is_written_elsewhere(
    capture_two, tmp_path, monkeypatch
):
    settings = bpy.context.scene.scope
    monkeypatch.chdir(tmp_path)
    capture_two(lambda: setattr(settings, "queue_folder", ""))
    assert all("there is no folder" in clip.message for clip in settings.queue)
    assert list(tmp_path.glob("*.bvh")) == []


def test_one_chosen_clip_is_no_queue(footage):
    assert choose_several([footage]) == {"FINISHED"}
    settings = bpy.context.scene.scope
    assert Path(settings.footage).name == footage.name
    assert not settings.queue
    assert not bpy.ops.scope.capture_queue.poll()


def test_other_footage_leaves_no_views_of_the_last_one_behind(footage, capfd):
    views = bpy.context.scene.scope.views
    (other,) = copies(footage, "other")
    choose_several([footage])
    bpy.ops.scope.add_view(filepath=str(other))
    choose_several([footage])  # once more the same
    assert len(views) == 1
    assert "Removed" not in capfd.readouterr().out
    choose_several([other])
    assert len(views) == 0
    assert "Removed the other cameras' videos" in capfd.readouterr().out
    bpy.ops.scope.add_view(filepath=str(footage))
    bpy.ops.scope.use_sample()
    assert len(views) == 0


def test_a_queue_with_a_missing_file_is_refused(footage):
    choose_several([footage])
    with pytest.raises(RuntimeError, match="is not a file"):
        choose_several([footage, footage.with_name("gone.png")])
    assert not bpy.context.scene.scope.queue
