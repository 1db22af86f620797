# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings in .blend files, export buttons, the camera button, progress."""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import cv2
import numpy as np
import pytest
from scope.scope_addon.job.job_progress import JobProgress, duration
from scope.scope_addon.motion import Motion
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.scene.footage_strip import strips_of
from scope.scope_addon.scene.packed_motion import pack_motion
from scope.scope_addon.scene.stored_values import parse_spans
from scope.scope_addon.ui import capture_job, preferences
from scope.scope_addon.ui.capture_operators import SAMPLE, end_capture, state
from scope.scope_addon.ui.preferences import cache
from scope.solver.body_file import load_body

from ..job.processes import wait_for
from ..scene.test_footage_strip import start_of


def test_a_scene_with_copied_settings_shows_no_result(one):
    panel = bpy.types.SCOPE_PT_result
    assert panel.poll(bpy.context)
    bpy.ops.scene.new(type="EMPTY")
    assert bpy.context.scene.scope.footage
    assert not panel.poll(bpy.context)
    bpy.ops.scene.new(type="FULL_COPY")
    assert not panel.poll(bpy.context)


def test_buttons_are_disabled_until_their_input_exists(request):
    assert not bpy.ops.scope.capture.poll()
    assert not bpy.ops.scope.export.poll()
    assert not bpy.ops.scope.look_through.poll()
    request.getfixturevalue("one")
    assert bpy.ops.scope.capture.poll()
    assert bpy.ops.scope.export.poll()
    assert bpy.ops.scope.look_through.poll()


def test_the_export_buttons_have_room_for_their_names(one):
    """In a sidebar of the default width, where a row of nine shows their first letters alone."""
    layout = MagicMock()
    bpy.types.SCOPE_PT_result.draw(SimpleNamespace(layout=layout), bpy.context)
    row = layout.row.return_value
    buttons = row.column.return_value.operator.call_args_list
    assert [button.kwargs["text"] for button in buttons] == ["FBX", "glTF", "BVH", "USD"]
    assert row.menu.call_args.args == ("SCOPE_MT_export",)


def test_export_buttons_write_files_and_do_not_change_the_scene(one, tmp_path, contents):
    before = contents()
    kinds = ["FBX", "GLB", "BVH", "NPZ", "TRC", "MOT", "C3D", "VRMA"]
    if "usd_export" in dir(bpy.ops.wm):  # some Blenders were built without USD
        kinds.append("USDC")
    for kind in kinds:
        assert bpy.ops.scope.export(filepath=str(tmp_path / "walk"), format=kind) == {"FINISHED"}
        assert (tmp_path / f"walk.{kind.lower()}").stat().st_size > 1000
        assert contents() == before, kind


def test_a_motion_file_contains_the_captured_motion_and_the_edits_that_it_keeps(
    one, standing, tmp_path
):
    bpy.ops.scope.refloor()
    bpy.ops.scope.export(filepath=str(tmp_path / "walk.npz"), format="NPZ")
    got = Motion.load(tmp_path / "walk.npz")
    np.testing.assert_allclose(got.poses, standing.poses, atol=1e-6)
    np.testing.assert_allclose(got.trans[:, :2], standing.trans[:, :2], atol=1e-6)
    assert got.corrections["snap_lift"].tolist() == [True]


def test_an_unwritable_export_is_an_error(one, tmp_path):
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.scope.export(filepath=str(tmp_path / "none" / "walk.glb"), format="GLB")


def test_an_export_without_a_name_is_an_error(one, tmp_path):
    for given in ({"filepath": f"{tmp_path}/"}, {"filepath": f"{tmp_path}/.glb"}, {}):
        with pytest.raises(RuntimeError, match="The file has no name; enter one"):
            bpy.ops.scope.export(format="GLB", **given)


@pytest.mark.parametrize("way", ["sample", "chosen", "typed"])
def test_choosing_other_footage_clears_the_error_message(footage, tmp_path, way):
    settings = bpy.context.scene.scope
    settings.footage = str(tmp_path / "gone.mp4")
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.scope.capture()
    assert state.message
    if way == "sample":
        bpy.ops.scope.use_sample()
    elif way == "chosen":
        bpy.ops.scope.choose_footage(filepath=str(footage))
    else:
        settings.footage = str(footage)
    assert not state.message


def test_comparing_with_footage_shows_its_camera_and_sets_the_resolution(one):
    scene = bpy.context.scene
    assert scene.camera is None
    camera = next(obj for obj in scene.scope.result.collection.objects if obj.type == "CAMERA")
    camera.hide_viewport = True
    camera.hide_set(True)
    bpy.ops.scope.look_through()
    assert camera.visible_get()
    assert scene.camera.name == "person_camera"
    assert (scene.render.resolution_x, scene.render.resolution_y) == (640, 480)


@pytest.mark.parametrize("way", ["exclude", "hide_viewport"])
def test_comparing_a_hidden_capture_is_an_error(one, way):
    shown = bpy.context.scene.scope.result.collection
    layer = next(
        c for c in bpy.context.view_layer.layer_collection.children if c.collection == shown
    )
    setattr(layer, way, True)
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=f"'{shown.name}' is hidden; show it in the Outliner"):
        bpy.ops.scope.look_through()
    setattr(layer, way, False)
    bpy.context.view_layer.update()
    assert bpy.ops.scope.look_through() == {"FINISHED"}


def test_warnings_name_their_frames(one):
    scene = bpy.context.scene
    spans = parse_spans(scene.scope.result.warnings[1].spans)
    assert [span.first for span in spans] == [4, 8]
    bpy.ops.scope.go_to_frame(frame=8)
    assert scene.frame_current == 8
    assert parse_spans("-12--4,-3-4,7") == [(-12, -4), (-3, 4), (7, 7)]
    # one marker for both spans, which are close together
    assert [m.frame for m in scene.timeline_markers] == [4]


def test_the_first_frame_is_not_negative():
    """Scenes and exports start there, too."""
    settings = bpy.context.scene.scope
    settings.start_frame = -50
    assert settings.start_frame == 0


def test_the_footage_is_added_to_the_sequencer(fake_worker, footage):
    assert not bpy.ops.scope.footage_to_sequencer.poll()
    bpy.context.scene.scope.start_frame = 11
    fake_worker("finish()")
    bpy.context.scene.scope.footage = str(footage)
    bpy.ops.scope.capture()
    assert bpy.ops.scope.footage_to_sequencer() == {"FINISHED"}
    assert [start_of(strip) for strip in strips_of(bpy.context.scene.sequence_editor)] == [11]
    assert bpy.ops.scope.footage_to_sequencer() == {"FINISHED"}
    assert len(strips_of(bpy.context.scene.sequence_editor)) == 1
    footage.unlink()
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.scope.footage_to_sequencer()


@pytest.mark.parametrize(("factor", "warns"), [(4, False), (1, True)])
def test_slow_motion_stays_synchronized_at_the_rate_of_what_happened(
    standing, capfd, factor, warns
):
    """It plays four times as slowly, so each frame of a scene of four times its rate shows one."""
    scene = bpy.context.scene
    rate = cv2.VideoCapture(str(SAMPLE)).get(cv2.CAP_PROP_FPS)
    scene.render.fps = round(factor * rate)
    scene.render.fps_base = round(factor * rate) / (factor * rate)
    motion = replace(standing, footage_speed=4.0)
    built = build_scene([motion], load_body("scope"))
    pack_motion(built.people[0].armature, motion.to_bytes())
    built.collection.scope_result.footage = str(SAMPLE)
    scene.scope.capture = built.collection
    assert bpy.ops.scope.footage_to_sequencer() == {"FINISHED"}
    assert ("synchronized" in capfd.readouterr().out) == warns


def test_the_part_of_the_video_is_sent_to_the_worker(fake_worker, footage):
    fake_worker("assert (float(request['start']), float(request['end'])) == (1.5, 3.0)\nfinish()")
    settings = bpy.context.scene.scope
    settings.footage = str(footage)
    settings.use_range = True
    settings.range_start = 1.5
    settings.range_end = 3.0
    assert bpy.ops.scope.capture() == {"FINISHED"}
    settings.range_end = 1.0
    with pytest.raises(RuntimeError, match="ends before it starts"):
        bpy.ops.scope.capture()


def test_the_preferences_are_sent_to_the_worker(fake_worker, footage, monkeypatch):
    chosen = SimpleNamespace(
        threads=3,
        provider="DIRECTML",
        detector_file="/a/d.onnx",
        keypoints_file="/a/k.onnx",
        body_file="",
        cache_folder="",
        cache_limit_gb=2,
    )
    monkeypatch.setattr(capture_job, "preferences", lambda: chosen)
    wanted = {
        "threads": 3,
        "provider": "directml",
        "detector": "/a/d.onnx",
        "keypoints": "/a/k.onnx",
    }
    fake_worker(f"wanted = {wanted}\nassert {{k: request[k] for k in wanted}} == wanted\nfinish()")
    bpy.context.scene.scope.footage = str(footage)
    assert bpy.ops.scope.capture() == {"FINISHED"}


def test_clearing_the_cache_leaves_the_scene(fake_worker, footage, tmp_path):
    fake_worker("finish()")
    bpy.context.scene.scope.footage = str(footage)
    bpy.ops.scope.capture()
    bystander = cache().root / "notes.txt"
    bystander.write_text("the user's")
    assert cache().size() > 1000
    bpy.ops.scope.clear_cache()
    assert cache().size() == 0
    assert bystander.exists()
    assert bpy.context.scene.scope.result.collection is not None
    bpy.ops.scope.export(filepath=str(tmp_path / "walk.npz"), format="NPZ")


def test_a_cache_beside_a_file_that_was_never_saved_is_not_in_the_current_folder(monkeypatch):
    unsaved = SimpleNamespace(cache_folder="//cache")
    with monkeypatch.context() as patch:
        patch.setattr(preferences, "preferences", lambda: unsaved)
        assert cache().root == preferences.user_folder() / "cache"


def test_the_preview_is_shown_during_a_capture(fake_worker, footage):
    from scope.scope_addon.ui import job_operator
    from scope.scope_addon.ui.capture_job import CaptureJob

    fake_worker(
        "open(folder + '/preview.rgba', 'wb').write(bytes(range(24)))\n"
        "send('preview', file='preview.rgba', width=3, height=2, frame=0)\n"
        "send('progress', stage='solving', done=1, total=10)\nsys.stdin.read()"
    )
    bpy.context.scene.scope.footage = str(footage)
    state.job = job = CaptureJob(bpy.context.scene)
    wait_for(lambda: job.step() and job.progress.done)
    icon = job_operator._previews["frame"]
    assert tuple(icon.image_size) == (3, 2)
    assert icon.image_pixels[0] == int.from_bytes(bytes(range(4)), "little")
    end_capture()
    assert job_operator.preview_icon() == 0
    job_operator.show_preview(b"half", 3, 2)
    assert job_operator.preview_icon() == 0


def test_progress_shows_stage_speed_and_remaining_time():
    now = [0.0]
    progress = JobProgress(clock=lambda: now[0])
    assert progress.lines() == ["Starting"]
    progress.update("finding the person", 0, 100)
    for second in range(1, 4):
        now[0] = float(second)
        progress.update("finding the person", 5 * second, 100)
    assert progress.lines() == ["Finding the person, 15 of 100", "5.0 frames/s"]
    for second in range(4, 11):
        now[0] = float(second)
        progress.update("finding the person", 5 * second, 100)
    assert progress.frames_per_second == pytest.approx(5.0)
    assert 0.4 < progress.fraction < 0.5
    assert progress.lines()[0] == "Finding the person, 50 of 100"
    assert progress.lines()[1].startswith("5.0 frames/s, ")
    assert progress.lines()[1].endswith(" left")
    before = progress.fraction
    progress.update("finding the shape", 0, 0)
    assert progress.fraction > before
    assert progress.seconds_left is None


def test_compiling_has_its_own_progress_and_no_remaining_time():
    now = [0.0]
    progress = JobProgress(clock=lambda: now[0])
    for second in range(10, 51):
        now[0] = float(second)
        progress.update("finding the person", 2 * second, 100)
    before = progress.fraction
    assert progress.seconds_left is not None
    for second in range(50, 150):
        now[0] = float(second)
        progress.update("compiling the solver", second - 50, 100)
        assert progress.lines() == [
            f"Compiling the solver (first capture only), {second - 50} of 100"
        ]
    progress.update("finding the shape", 1, 100)
    assert progress.fraction == pytest.approx(before, abs=0.01)
    assert "finding the shape" not in progress.seconds
    assert progress.seconds["finding the person"] == pytest.approx(40.0)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "0 s"), (59.6, "1 min 00 s"), (125, "2 min 05 s"), (3720, "1 h 02 min")],
)
def test_durations(seconds, text):
    assert duration(seconds) == text
