# SPDX-License-Identifier: GPL-3.0-or-later
"""A live capture in a scene, with a scripted process: the body follows, until Stop, Cancel or a
failure ends it.
"""

import os
import signal
import textwrap
import time
from pathlib import Path

import bpy
import numpy as np
import pytest
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.errors import OfflineError, UsageError, VideoError
from scope.scope_addon.job.live_process import LiveProcess
from scope.scope_addon.job.process import WorkerFailedError
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.ui import live_job
from scope.scope_addon.ui.live_job import LiveJob, live_request
from scope.scope_addon.ui.preferences import cache
from scope.solver.body_file import load_body

from ...job.processes import runs, wait_for
from ...scene.made_rigs import build_rig
from ..conftest import inventory


@pytest.fixture
def live(tmp_path, monkeypatch, standing):
    """Return a function that starts a live capture with a scripted process.

    The script may use ``pose(index)``, ``send(event, **values)``, ``receive()``, which waits for a
    command, ``wait_for(path)``, which waits for a file, and ``finish()``, which sends the motion
    ``standing``.
    """
    standing.save(tmp_path / "standing.npz")
    jobs = []
    monkeypatch.setattr(
        live_job, "LiveProcess", lambda r, folder, _, *rest: LiveProcess(r, folder, None, *rest)
    )
    (tmp_path / "walk.mp4").touch()
    settings = bpy.context.scene.scope_live
    settings.source = "FILE"
    settings.file = str(tmp_path / "walk.mp4")

    def start(body, **options):
        # one each: a process may not have read its own yet
        script = tmp_path / f"fake_live_{len(jobs)}.py"
        monkeypatch.setattr(live_job, "START_SCRIPT", script)
        script.write_text(
            textwrap.dedent(f"""
                import json, math, os, shutil, sys, time
                folder, request = sys.argv[2], json.loads(sys.stdin.readline())
                def send(event, **values):
                    print(json.dumps({{"event": event}} | values), flush=True)
                def receive():
                    return sys.stdin.readline().strip()
                def wait_for(path):
                    while not os.path.exists(path):
                        time.sleep(0.01)
                def pose(index, betas=(0.0,) * 10, person=0, presence="seen"):
                    turned = [math.cos(0.1 * index), math.sin(0.1 * index), 0, 0]
                    send("pose", person=person, frame=index, presence=presence,
                         rotations=[turned] + [[1, 0, 0, 0]] * 23,
                         positions=[[0.0, 0.0, 1.0]], betas=betas)
                def finish(people=1):
                    names = [f"person{{k + 1}}.npz" for k in range(people)]
                    for name in names:
                        shutil.copy({str(tmp_path / "standing.npz")!r}, os.path.join(folder, name))
                    send("result", motions=names,
                         report={{"camera": "estimated", "fps": {{"total": 28.0}}, "warnings": []}})
            """)
            + textwrap.dedent(body)
        )
        jobs.append(LiveJob(bpy.context.scene, **options))
        return jobs[-1]

    yield start
    for job in jobs:
        job.close()


def until(job, condition):
    wait_for(lambda: job.step() and condition())


def to_end(job):
    wait_for(lambda: not job.step())


def following_rig():
    """Return a rig that follows live captures."""
    rig, _ = build_rig("mixamo")
    bpy.context.scene.scope_live.with_rig = True
    bpy.context.scene.scope_retarget.rig = rig
    return rig


def test_the_newest_pose_is_shown_and_stays_after_stop(live):
    job = live("pose(1); pose(2); pose(7, [0.5] * 10); receive()")
    until(job, lambda: job.poses)
    while job.poses < 3 and job.worker._newest:
        job.step()
    assert job.has_body
    armature = job._bodies[0].armature
    assert bpy.context.view_layer.objects.active == armature
    shown = tuple(armature.pose.bones["pelvis"].rotation_quaternion)
    pid = job.worker.pid
    job.stop()
    wait_for(lambda: not runs(pid))
    to_end(job)
    left = bpy.data.objects["Live"]
    np.testing.assert_allclose(left.pose.bones["pelvis"].rotation_quaternion, shown, atol=1e-3)
    assert left.animation_data is None
    assert "scope_source" not in left  # nothing was recorded that could be refined
    assert not job.worker.job_folder.exists()


def test_a_recording_becomes_a_capture_and_the_body_goes(live):
    bpy.context.scene.scope.take = "Jump"
    job = live(
        'pose(1); assert receive() == "record"; pose(2); assert receive() == "stop"; finish()'
    )
    until(job, lambda: job.has_body)
    job.record()
    until(job, lambda: job.poses == 2)
    job.stop()
    to_end(job)
    scene = bpy.context.scene
    assert scene.scope.capture.name == "Jump"
    person = bpy.data.objects["Jump"]
    assert isinstance(person["scope_motion"]["motion"], bytes)
    assert person.animation_data.action.name == "Jump"
    assert person.pose.bones["head"].custom_shape is not None
    assert "Live" not in bpy.data.objects
    assert "Live" not in bpy.data.collections
    assert scene.scope.result.frames_per_second == 28.0
    assert not job.worker.job_folder.exists()


def test_a_body_follows_each_of_the_people_and_all_are_recorded(live):
    bpy.context.scene.scope_live.people = 2
    job = live("""
        assert request["live_people"] == 2
        pose(1, presence="lost"); pose(1, person=1); pose(1, person=2)
        assert receive() == "record"
        pose(3)
        pose(5, person=1)
        assert receive() == "stop"
        finish(2)
    """)
    until(job, lambda: len(job.worker._newest) == 0 and all(body.armature for body in job._bodies))
    assert [body.armature.name for body in job._bodies] == ["Live", "Live 2"]
    assert job.status.presence == "lost"  # by whom camera and floor are estimated
    assert bpy.context.view_layer.objects.active == job._bodies[0].armature
    job.record()

    def turned(body):
        return abs(body.armature.pose.bones["pelvis"].rotation_quaternion.w)

    before = [turned(body) for body in job._bodies]
    until(
        job, lambda: all(turned(body) != was for body, was in zip(job._bodies, before, strict=True))
    )
    assert turned(job._bodies[0]) != turned(job._bodies[1])
    job.stop()
    to_end(job)
    assert len(bpy.context.scene.scope.capture.all_objects) >= 4  # two armatures, and a mesh each
    assert not [obj for obj in bpy.data.objects if obj.name.startswith("Live")]


def test_kept_footage_is_chosen_for_another_capture(live, tmp_path, monkeypatch):
    kept = tmp_path / "take.mp4"
    monkeypatch.setattr(live_job, "kept_footage", lambda scene: kept)
    settings = bpy.context.scene.scope_live
    settings.source = "CAMERA"
    settings.keep_footage = True
    job = live(f'pose(1); receive(); receive(); assert request["keep_footage"] == {str(kept)!r}; '
               f'shutil.copy({str(SAMPLE)!r}, request["keep_footage"]); finish()')  # fmt: skip
    until(job, lambda: job.has_body)
    bpy.context.scene.scope.person = "400,540"  # of the footage before
    bpy.context.scene.scope.crop = "0,0,400,400"
    job.record()
    job.stop()
    to_end(job)
    assert bpy.context.scene.scope.footage == str(kept)
    assert bpy.context.scene.scope.person == ""
    assert bpy.context.scene.scope.crop == ""
    assert bpy.context.scene.scope.result.footage == str(kept)


RECORDS = """
    sys.path.insert(0, {root!r})
    from pathlib import Path
    from scope.scope_addon.job.cache import recordings_of
    from scope.scope_addon.live.unfinished import SUFFIX, lock_of
    from scope.scope_addon.temporary import hold
    path = recordings_of(Path(folder)) / (os.path.basename(folder) + SUFFIX)
    path.parent.mkdir(exist_ok=True)
    about = dict(body="scope", fingerprint=1, source="fake", fps="30", size=[64, 48], people=1,
        speed=1.0, footage="")
    path.write_text(json.dumps(about | {{"origin": None}}) + "\\n")
    hold(lock_of(path))
    pose(1); receive(); receive()
"""
ROOT = str(Path(live_job.__file__).resolve().parents[4])


@pytest.fixture
def recordings():
    """Return a function that lists what recordings the cache has, and leave none."""

    def found():
        return list(cache().root.glob("recordings/*"))

    yield found
    for path in found():
        path.unlink()


def test_cancelling_leaves_nothing_that_was_recorded(live, tmp_path, monkeypatch, recordings):
    (tmp_path / "takes").mkdir()
    kept = tmp_path / "takes" / "take.mp4"
    monkeypatch.setattr(live_job, "kept_footage", lambda scene: kept)
    settings = bpy.context.scene.scope_live
    settings.source = "CAMERA"
    settings.keep_footage = True
    job = live(RECORDS.format(root=ROOT))
    until(job, lambda: job.has_body)
    (tmp_path / "takes" / "take.unfinished.mp4").touch()  # as `Footage` does
    assert len(recordings()) == 2  # with its lock
    job.cancel()
    assert not list((tmp_path / "takes").iterdir())
    assert not recordings()


def test_a_recording_whose_capture_did_not_end_by_itself_is_finished_later(live, recordings):
    job = live(RECORDS.format(root=ROOT))
    until(job, lambda: job.has_body)
    job.record()
    assert cache().unfinished_recordings() == []  # it is running
    os.kill(job.worker.pid, signal.SIGKILL)
    with pytest.raises(WorkerFailedError):
        to_end(job)
    (left,) = cache().unfinished_recordings()
    assert len(recordings()) == 2
    assert bpy.ops.scope.finish_recording.poll()
    code = f'assert (request["live"], request["body"]) == ({str(left)!r}, "scope"); finish()'
    again = live(code, unfinished=left)
    to_end(again)
    assert bpy.context.scene.scope.capture is not None
    assert recordings() == []
    assert not bpy.ops.scope.finish_recording.poll()


@pytest.mark.parametrize("is_built", [True, False])
def test_a_recording_stays_until_it_is_in_the_scene(live, recordings, monkeypatch, is_built):
    """Its motion files are temporary, and go with the process's folder."""

    def fail(*_):
        raise UsageError("the motion ends after the last frame of the scene")

    job = live(RECORDS.format(root=ROOT).replace("receive(); receive()", "receive(); finish()"))
    until(job, lambda: job.has_body)
    if is_built:
        job.record()
        to_end(job)
        assert bpy.context.scene.scope.capture is not None
        assert recordings() == []
        return
    monkeypatch.setattr(live_job, "build_capture", fail)
    job.record()
    with pytest.raises(UsageError, match="the motion ends"):
        to_end(job)
    (left,) = cache().unfinished_recordings()
    assert left.stem == job.worker.job_folder.name
    assert bpy.ops.scope.finish_recording.poll()


def test_a_recording_that_cannot_be_finished_stays(live, recordings):
    job = live(RECORDS.format(root=ROOT))
    until(job, lambda: job.has_body)
    job.close()
    (left,) = cache().unfinished_recordings()
    again = live('send("error", message="its body has changed")', unfinished=left)
    with pytest.raises(WorkerFailedError, match="its body has changed"):
        to_end(again)
    assert cache().unfinished_recordings() == [left]


def test_footage_is_kept_beside_a_saved_file_only(tmp_path):
    scene = bpy.context.scene
    scene.scope_live.keep_footage = True
    with pytest.raises(UsageError, match="save that first"):
        live_request(scene)
    scene.scope.take = "../Jump"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    path = Path(live_request(scene).values["keep_footage"])
    assert (path.parent, path.suffix) == (tmp_path, ".mp4")
    assert path.name.startswith("___Jump ")


def test_a_countdown_comes_before_the_recording(live, monkeypatch):
    now = [1000.0]
    monkeypatch.setattr(live_job.time, "monotonic", lambda: now[0])
    job = live('pose(1); assert receive() == "record"; pose(2); receive()')
    while not job.has_body:
        job.step()
    job.record(2.5)
    assert (job.countdown_s, job.recording) == (3, False)
    now[0] += 2.4
    job.step()
    assert (job.countdown_s, job.recording) == (1, False)
    now[0] += 0.2
    job.step()
    assert (job.countdown_s, job.recording) == (0, True)
    while job.poses < 2:
        job.step()


def test_stop_during_the_countdown_records_nothing(live):
    job = live("pose(1); receive()")
    until(job, lambda: job.has_body)
    job.record(60.0)
    job.stop()
    to_end(job)
    assert "Live" in bpy.data.objects
    assert bpy.context.scene.scope.capture is None


def test_what_was_selected_during_a_live_capture_stays_selected(live):
    job = live('pose(1); assert receive() == "record"; pose(2); finish()')
    until(job, lambda: job.has_body)
    bpy.ops.object.empty_add()
    job.record()
    to_end(job)
    assert bpy.context.scene.scope.capture is not None
    assert [obj.name for obj in bpy.context.selected_objects] == ["Empty"]
    assert "scope_motion" in bpy.context.scene.scope.capture.objects[0]
    assert bpy.context.view_layer.objects.active.name == "Empty"


def test_a_mesh_that_is_being_edited_stays_so(live):
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.mode_set(mode="EDIT")
    job = live('pose(1); assert receive() == "record"; pose(2); finish()')
    until(job, lambda: job.has_body)
    edited = bpy.context.view_layer.objects.active
    assert (edited.type, edited.mode) == ("MESH", "EDIT")
    job.record()
    to_end(job)
    assert bpy.context.scene.scope.capture is not None
    assert (bpy.context.view_layer.objects.active, edited.mode) == (edited, "EDIT")
    assert [obj.name for obj in bpy.context.selected_objects] == [edited.name]


@pytest.mark.parametrize(("end", "is_shown"), [("stop", True), ("cancel", True), ("record", False)])
def test_an_earlier_capture_is_hidden_while_a_body_follows_in_its_place(
    live, standing, end, is_shown
):
    result = build_scene([standing], load_body(standing.body_model), None, BuildOptions())
    earlier = result.collection
    job = live("pose(1); receive(); pose(2); finish()")
    until(job, lambda: job.has_body)
    assert (earlier.hide_viewport, earlier.hide_render) == (True, True)
    if end == "record":
        job.record()
    else:
        getattr(job, end)()
    if end != "cancel":
        to_end(job)
    assert (earlier.hide_viewport, earlier.hide_render) == (not is_shown, not is_shown)
    assert ("scope_hidden" in earlier) != is_shown


def test_a_recording_that_was_asked_for_too_late_leaves_the_last_pose(live):
    job = live('pose(1); receive(); send("ended")')
    until(job, lambda: job.has_body)
    job.record()
    to_end(job)
    assert "Live" in bpy.data.objects


def test_a_recording_whose_retargeting_fails_is_kept(live):
    following_rig()
    scene = bpy.context.scene
    job = live("pose(1); receive(); receive(); finish()")
    until(job, lambda: job.has_body)
    job.record()
    scene.scope_retarget.pairs.add().bone = "gone"
    scene.scope_retarget.pairs[0].part = "pelvis"
    job.stop()
    to_end(job)
    assert scene.scope.capture is not None
    assert len(job.warnings) == 1


def test_a_stream_ends_when_online_access_does(live, monkeypatch):
    settings = bpy.context.scene.scope_live
    system = bpy.context.preferences.system
    settings.source = "STREAM"
    settings.stream = "rtsp://camera/stream"
    system.use_online_access = True
    jobs = [
        live("pose(1); receive()"),
        live('pose(1); receive(); assert receive() == "stop"; finish()'),
    ]
    for job in jobs:
        until(job, lambda job=job: job.poses)
    jobs[1].record()
    system.use_online_access = False
    with pytest.raises(OfflineError):
        to_end(jobs[0])
    to_end(jobs[1])
    assert bpy.context.scene.scope.capture is not None


def test_cancelling_leaves_the_scene_as_it_was(live):
    bpy.ops.object.armature_add()
    rig = following_rig()
    bpy.context.view_layer.objects.active = bpy.data.objects["Armature"]
    scene = bpy.context.scene
    before = inventory()
    posed = [bone.matrix_basis.copy() for bone in rig.pose.bones]
    scene.scope_live.people = 2
    job = live("pose(1, person=1); pose(1); receive(); receive()")
    until(job, lambda: all(body.armature for body in job._bodies))
    assert [bone.matrix_basis for bone in rig.pose.bones] != posed
    assert job._bodies[0].armature.hide_get()  # as the Retarget section says
    job.record()
    pid = job.worker.pid
    job.cancel()
    wait_for(lambda: not runs(pid))
    assert inventory() == before
    np.testing.assert_allclose([bone.matrix_basis for bone in rig.pose.bones], posed, atol=1e-5)
    assert bpy.context.view_layer.objects.active == bpy.data.objects["Armature"]
    assert not job.worker.job_folder.exists()


def test_a_process_that_cannot_be_started_leaves_the_rig_as_it_was(live, monkeypatch):
    rig = following_rig()
    rig.data.pose_position = "REST"
    live("receive()").cancel()
    assert rig.data.pose_position == "REST"

    def fail(*_):
        raise OSError("no more processes")

    monkeypatch.setattr(live_job, "LiveProcess", fail)
    with pytest.raises(OSError, match="no more processes"):
        LiveJob(bpy.context.scene)
    assert rig.data.pose_position == "REST"


def test_a_recording_is_retargeted_to_the_rig_that_followed(live):
    rig = following_rig()
    scene = bpy.context.scene
    job = live('pose(1); assert receive() == "record"; assert receive() == "stop"; finish()')
    until(job, lambda: job.has_body)
    job.record()
    job.stop()
    to_end(job)
    assert rig.animation_data.action.name.startswith("mixamo_")
    assert rig["scope_person"] == scene.scope.capture.objects[0]


def test_the_rig_gets_nobody_elses_recording(live):
    rig = following_rig()
    job = live('pose(1); assert receive() == "record"; assert receive() == "stop"; finish(2); ')
    until(job, lambda: job.has_body)
    job.record()
    build = job._build
    job._build = lambda scene, result: build(scene, result | {"motions": result["motions"][1:]})
    job.stop()
    to_end(job)
    assert rig.animation_data is None or rig.animation_data.action is None
    assert "first person, who is not in the recording" in str(job.warnings[0])


@pytest.mark.parametrize(
    ("script", "says"),
    [
        (
            'send("error", message="camera 0 cannot be opened; check that it is plugged in")',
            "plugged in",
        ),
        (
            'send("pose", person=0, rotations=[], positions=[], betas=[]); receive()',
            "cannot be used",
        ),
        ("os._exit(3)", "ended with status 3"),
    ],
)
def test_what_fails_leaves_the_scene_as_it_was(live, tmp_path, script, says):
    before = inventory()
    job = live(f"pose(1); wait_for({str(tmp_path / 'shown')!r}); {script}")
    until(job, lambda: job.has_body)
    (tmp_path / "shown").touch()
    with pytest.raises(WorkerFailedError, match=says):
        to_end(job)
    assert inventory() == before
    assert not job.worker.alive
    assert not job.worker.job_folder.exists()


def test_an_interruption_is_said_until_poses_come_again(live, tmp_path, monkeypatch):
    monkeypatch.setattr(live_job, "NOTICE_S", 0.0)
    job = live(f"""
        pose(1); wait_for({str(tmp_path / "shown")!r})
        send("notice", text="it was interrupted"); receive(); pose(2); receive()
    """)
    until(job, lambda: job.poses == 1)
    (tmp_path / "shown").touch()
    until(job, lambda: job.status.notice)
    assert job.status.notice == "it was interrupted"
    job.record()  # a command, for which the script waits
    until(job, lambda: job.poses == 2)
    assert job.status.notice == ""


def test_silence_of_the_source_is_noticed(live, monkeypatch):
    monkeypatch.setattr(live_job, "QUIET_S", 0.05)
    job = live("pose(1); receive()")
    until(job, lambda: job.poses == 1)
    time.sleep(0.1)
    assert job.quiet_s > 0.05


def test_a_body_that_undo_removed_comes_back_and_the_others_selection_stays(live):
    job = live("pose(1); receive(); pose(2); receive()")
    until(job, lambda: job.has_body)
    bpy.data.objects.remove(job._bodies[0].armature)
    bpy.ops.object.empty_add()
    job.record()
    until(job, lambda: job.poses == 2)
    assert job.has_body
    assert bpy.context.view_layer.objects.active.name == "Empty"
    job.cancel()
    assert [obj.name for obj in bpy.data.objects] == ["Empty"]


def test_a_removed_scene_ends_the_capture(live):
    job = live("pose(1); receive()")
    bpy.data.scenes.new("other")
    bpy.data.scenes.remove(bpy.context.scene)
    with pytest.raises(UsageError, match="scene was removed"):
        to_end(job)
    assert not job.worker.alive


@pytest.mark.parametrize(
    ("source", "value", "says"),
    [
        ("CAMERA", "front", "is not a camera"),
        ("CAMERA", "rtsp://a/b", "is not a camera"),
        ("CAMERA", "/dev/video0/../sda", "is not a camera"),
        ("STREAM", "", "no stream is given"),
        ("FILE", "", "no video is chosen"),
    ],
)
def test_a_source_that_is_none_is_an_error(source, value, says):
    settings = bpy.context.scene.scope_live
    settings.source = source
    setattr(settings, source.lower(), value)
    with pytest.raises(UsageError, match=says):
        live_request(bpy.context.scene)


def test_a_missing_video_is_an_error():
    settings = bpy.context.scene.scope_live
    settings.source = "FILE"
    settings.file = "/nowhere/walk.mp4"
    with pytest.raises(VideoError, match="does not exist"):
        live_request(bpy.context.scene)


def test_a_lens_by_calibration_needs_a_file(footage):
    settings = bpy.context.scene.scope_live
    settings.source = "FILE"
    settings.file = str(footage)
    bpy.context.scene.scope.lens = "FILE"
    with pytest.raises(UsageError, match="no calibration file is chosen"):
        live_request(bpy.context.scene)


def test_a_stream_needs_online_access_and_gets_its_login(monkeypatch):
    settings = bpy.context.scene.scope_live
    system = bpy.context.preferences.system
    settings.source = "STREAM"
    settings.stream = "rtsp://me:secret@camera/stream"
    assert settings.stream == "rtsp://camera/stream"
    system.use_online_access = False
    with pytest.raises(OfflineError, match="Allow Online Access"):
        live_request(bpy.context.scene)
    system.use_online_access = True
    request = live_request(bpy.context.scene)
    assert request.source == "rtsp://me:secret@camera/stream"
    assert request.online


def test_the_capture_has_the_options_of_the_panel():
    scene = bpy.context.scene
    scene.scope_live.camera = "0: USB Camera: front (MJPG 1920×1080)"
    scene.scope_live.quality = "BALANCED"
    scene.scope.height_cm = 181
    scene.scope.lens = "FOCAL"
    scene.scope.focal_mm = 28
    request = live_request(scene)
    assert request.source == "0"
    assert not request.online
    values = request.values
    assert (values["live_quality"], values["focal_mm"], values["body"]) == ("balanced", 28, "scope")
    assert values["heights_m"] == pytest.approx((1.81,))
