# SPDX-License-Identifier: GPL-3.0-or-later
"""The capture job: results, failures, cancelling, the cache, several scenes."""

import json
import os
import shutil
import signal
import sys
from dataclasses import replace
from functools import partial

import bpy
import numpy as np
import pytest
from scope.scope_addon.job.job_progress import JobProgress
from scope.scope_addon.job.process import WorkerFailedError
from scope.scope_addon.scene.camera import pixel_aspect
from scope.scope_addon.scene.packed_motion import stored_motion
from scope.scope_addon.ui import capture_job, warm_up
from scope.scope_addon.ui.capture_job import CaptureJob, capture_request
from scope.scope_addon.ui.capture_operators import state
from scope.scope_addon.ui.comparison import cameras_of
from scope.scope_addon.ui.preferences import cache
from scope.solver.errors import ScopeError

from ..job.processes import wait_for
from ..made_motion import made_views

FINISH = "send('progress', stage='solving', done=1, total=10)\nfinish()"


@pytest.fixture(autouse=True)
def chosen(footage):
    """The footage is chosen in the scene."""
    bpy.context.scene.scope.footage = str(footage)


def run_to_end(job):
    wait_for(lambda: not job.step())


def job_files():
    return [
        p
        for p in cache().root.rglob("*")
        if "captures" not in p.parts and p.name not in ("jobs", "kernels")
    ]


def captures():
    return [c for c in bpy.data.collections if "scope_capture" in c]


def test_a_result_is_built_shown_and_cached(fake_worker):
    fake_worker(FINISH)
    scene = bpy.context.scene
    assert bpy.ops.scope.capture() == {"FINISHED"}
    result = scene.scope.result
    assert (result.people, result.frames) == (1, 10)
    assert result.reprojection_px == pytest.approx(2.0)
    shown = [(w.text, w.spans) for w in result.warnings]
    assert shown == [("A warning", ""), ("Not visible: the pose is filled in", "4-5,8")]
    assert result.collection == captures()[0]
    assert (scene.render.fps, scene.frame_start, scene.frame_end) == (25, 1, 10)
    assert job_files() == []
    fake_worker("send('error', message='must not be asked again')")
    assert bpy.ops.scope.capture() == {"FINISHED"}
    assert len(captures()) == 2


def selection():
    layer = bpy.context.view_layer
    active = layer.objects.active
    selected = sorted(obj.name for obj in bpy.context.selected_objects)
    return selected, active.name if active else "", active.mode if active else ""


@pytest.fixture
def cubes():
    """Two cubes, the first of which is selected."""
    for name in ("first", "second"):
        bpy.ops.mesh.primitive_cube_add()
        bpy.context.object.name = name
    select("first")
    return "first", "second"


def select(*names):
    bpy.ops.object.select_all(action="DESELECT")
    for name in names:
        bpy.data.objects[name].select_set(True)
        bpy.context.view_layer.objects.active = bpy.data.objects[name]


def started(fake_worker):
    fake_worker(FINISH)
    return CaptureJob(bpy.context.scene)


def test_what_was_selected_during_a_capture_stays_selected(fake_worker, cubes):
    job = started(fake_worker)
    select(*cubes)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.context.scene.frame_set(60)
    run_to_end(job)
    assert len(captures()) == 1
    assert selection() == (["first", "second"], "second", "EDIT")
    assert bpy.context.scene.frame_current == 60


def test_a_mesh_that_is_edited_since_before_the_capture_stays_in_edit_mode(fake_worker, cubes):
    bpy.ops.object.mode_set(mode="EDIT")
    job = started(fake_worker)
    run_to_end(job)
    assert selection() == (["first"], "first", "EDIT")


def test_an_earlier_capture_that_is_posed_meanwhile_stays_visible(fake_worker):
    run_to_end(started(fake_worker))
    (earlier,) = captures()
    armature = bpy.context.view_layer.objects.active
    job = started(fake_worker)
    bpy.ops.object.mode_set(mode="POSE")
    run_to_end(job)
    assert len(captures()) == 2
    assert selection() == ([armature.name], armature.name, "POSE")
    assert not earlier.hide_viewport
    assert not earlier.hide_render


def test_otherwise_the_captured_person_is_selected(fake_worker, cubes):
    job = started(fake_worker)
    select()
    run_to_end(job)
    assert selection() == (["person"], "person", "OBJECT")


def test_the_next_capture_of_a_kind_knows_how_long_the_stages_took(
    fake_worker, footage, tmp_path, monkeypatch
):
    now = [1000.0]
    monkeypatch.setattr(capture_job, "JobProgress", partial(JobProgress, lambda: now[0]))
    steps = "".join(
        f"send('progress', stage='finding the person', done={k}, total=10)\n" for k in range(11)
    )
    solved = tmp_path / "solved"
    fake_worker(
        f"{steps}send('progress', stage='solving', done=1, total=10)\n"
        f"while not os.path.exists({str(solved)!r}):\n    time.sleep(0.01)\n"
        "finish()"
    )
    scene = bpy.context.scene
    job = CaptureJob(scene)
    wait_for(lambda: job.step() and job.progress.stage == "solving")
    now[0] += 3.0
    solved.touch()
    run_to_end(job)
    for quality, known in (("BEST", True), ("FAST", False)):
        scene.scope.quality = quality
        job = CaptureJob(scene)
        job.close()
        assert bool(job.progress._earlier) == known
    scene.scope.quality = "BEST"
    footage.write_bytes(footage.read_bytes() + b" ")  # other footage of the same kind
    job = CaptureJob(scene)
    job.close()
    assert job.progress._earlier["solving"] == pytest.approx(0.3)  # seconds for each of ten frames


@pytest.mark.parametrize("is_compiled", [False, True])
def test_the_remaining_time_is_known_only_once_the_solver_is_compiled(
    fake_worker, monkeypatch, is_compiled
):
    if is_compiled:
        warm_up._marker().parent.mkdir(parents=True)
        warm_up._marker().touch()
    now = [0.0]
    monkeypatch.setattr(capture_job, "JobProgress", partial(JobProgress, lambda: now[0]))
    fake_worker("time.sleep(600)")
    job = CaptureJob(bpy.context.scene)
    for second in range(20):
        now[0] = float(second)
        job.progress.update("finding the person", second, 40)
    assert (job.progress.seconds_left is not None) == is_compiled
    job.close()


def test_blender_does_not_wait_for_a_worker_that_is_ending(fake_worker, tmp_path, monkeypatch):
    # on a busy computer, three steps may take long
    monkeypatch.setattr(capture_job, "_ENDING_S", 600.0)
    fake_worker(
        f"finish()\nwhile not os.path.exists({str(tmp_path / 'end')!r}):\n    time.sleep(0.01)"
    )
    job = CaptureJob(bpy.context.scene)
    wait_for(lambda: job.step() and job.worker.finished)
    for _ in range(3):
        assert job.step()
        assert job.worker.alive
    assert not captures()
    (tmp_path / "end").touch()
    run_to_end(job)
    assert len(captures()) == 1
    assert job_files() == []


def test_several_people_are_built_and_distinguished(fake_worker):
    fake_worker("assert request['people'] == 3\nfinish(2)")
    scene = bpy.context.scene
    scene.scope.people = "COUNT"
    scene.scope.people_count = 3
    bpy.ops.scope.capture()
    assert scene.scope.result.people == 2
    assert [w.text[:8] for w in scene.scope.result.warnings[1:]] == ["Person 1", "Person 2"]
    assert len([o for o in captures()[0].objects if o.type == "ARMATURE"]) == 2


def test_changed_options_need_another_capture(fake_worker, footage):
    fake_worker(FINISH)
    scene = bpy.context.scene
    bpy.ops.scope.capture()
    fake_worker("send('error', message='asked again')")
    scene.scope.quality = "FAST"
    with pytest.raises(RuntimeError, match="Asked again"):
        bpy.ops.scope.capture()
    scene.scope.quality = "BEST"
    os.utime(footage, (1, 1))
    with pytest.raises(RuntimeError, match="Asked again"):
        bpy.ops.scope.capture()


def test_a_result_of_what_changed_after_its_key_was_made_is_not_found_again(fake_worker, footage):
    content = footage.read_bytes()
    status = footage.stat()
    fake_worker(f"open({str(footage)!r}, 'ab').write(b'x')\nfinish()")
    assert bpy.ops.scope.capture() == {"FINISHED"}
    footage.write_bytes(content)
    os.utime(footage, ns=(status.st_atime_ns, status.st_mtime_ns))
    fake_worker("send('error', message='asked again')")
    with pytest.raises(RuntimeError, match="Asked again"):
        bpy.ops.scope.capture()


@pytest.mark.parametrize(
    ("script", "says"),
    [
        ("send('error', message='nobody is in person.png')", "Nobody is in person.png"),
        ("os.kill(os.getpid(), 9)", "signal 9"),
        ("print('not json'); print('[1]'); sys.exit(3)", "status 3"),
        ("send('result', motions=['person1.npz'], report={})", "No such file"),
    ],
)
def test_a_failure_is_reported_and_changes_nothing(fake_worker, contents, script, says):
    fake_worker(script)
    before = contents()
    with pytest.raises(RuntimeError, match=says):
        bpy.ops.scope.capture()
    assert says in state.message
    assert state.job is None
    assert contents() == before
    assert job_files() == []


@pytest.mark.parametrize(
    "end", [lambda job: job.close(), lambda job: os.kill(job.worker.pid, signal.SIGKILL)]
)
def test_a_cancelled_or_killed_capture_leaves_nothing_behind(fake_worker, contents, end):
    fake_worker(
        "send('progress', stage='solving', done=3, total=10)\nopen(folder + '/half', "
        "'w')\ntime.sleep(600)"
    )
    before = contents()
    job = CaptureJob(bpy.context.scene)
    wait_for(lambda: job.step() and job.progress.done == 3)
    end(job)
    with pytest.raises(WorkerFailedError):
        run_to_end(job)
    assert not job.worker.alive
    assert contents() == before
    assert job_files() == []


def test_an_unwritable_cache_is_an_error(monkeypatch, tmp_path, contents):
    (tmp_path / "user").write_text("a file where the folder should be")
    before = contents()
    with pytest.raises(RuntimeError, match="(?i)cannot write to the cache folder"):
        bpy.ops.scope.capture()
    assert contents() == before


def test_footage_that_is_removed_during_a_capture_gives_a_warning(fake_worker, footage):
    fake_worker(f"os.remove({str(footage)!r})\nfinish()")
    scene = bpy.context.scene
    bpy.ops.scope.capture()
    assert any("no longer exists" in w.text for w in scene.scope.result.warnings)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"footage": "/nowhere/walk.mp4"}, "walk.mp4 does not exist"),
        ({"footage": "/"}, "/ is not a file"),
        ({"body": "FILE"}, "body file"),
        ({"lens": "FILE"}, "calibration"),
        ({"lens": "FILE", "calibration_file": "/nowhere/lens.json"}, "lens.json"),
    ],
)
def test_invalid_settings_are_errors(settings, says, contents):
    scene = bpy.context.scene
    for name, value in settings.items():
        setattr(scene.scope, name, value)
    before = contents()
    with pytest.raises(RuntimeError, match=says):
        bpy.ops.scope.capture()
    assert contents() == before


def test_the_result_is_built_in_the_scene_of_the_capture(fake_worker):
    fake_worker(FINISH)
    first = bpy.context.scene
    job = CaptureJob(first)
    second = bpy.data.scenes.new("second")
    bpy.context.window.scene = second
    run_to_end(job)
    assert bpy.context.scene == second
    assert second.scope.result.collection is None
    assert first.scope.result.collection.name in [c.name for c in first.collection.children]
    assert not second.collection.children


def test_a_removed_scene_is_an_error(fake_worker, footage):
    fake_worker(FINISH)
    scene = bpy.data.scenes.new("gone soon")
    scene.scope.footage = str(footage)
    job = CaptureJob(scene)
    bpy.data.scenes.remove(scene)
    with pytest.raises(ScopeError, match="removed"):
        run_to_end(job)


def test_what_is_animated_during_a_capture_keeps_its_frame_rate(fake_worker):
    fake_worker(FINISH)
    scene = bpy.context.scene
    scene.render.fps = 24
    job = CaptureJob(scene)
    cube = bpy.data.objects.new("cube", bpy.data.meshes.new("cube"))
    scene.collection.objects.link(cube)
    cube.shape_key_add(name="Basis").keyframe_insert("mute", frame=1)
    run_to_end(job)
    assert scene.render.fps == 24


@pytest.mark.slow
def test_real_worker_uses_a_calibration_and_no_internet_connection(fake_worker, footage, tmp_path):
    import cv2

    height, width = cv2.imread(str(footage)).shape[:2]
    K = [[700.0, 0, width / 2 + 3], [0, 720.0, height / 2], [0, 0, 1]]
    dist = [-0.05, 0.01, 0.002, 0.0, 0.0]
    lens = tmp_path / "lens.json"
    scene = bpy.context.scene
    scene.scope.quality = "FAST"
    scene.scope.lens = "FILE"
    scene.scope.calibration_file = str(lens)
    guard = tmp_path / "guard.py"
    guard.write_text(
        "import runpy, sys\n"
        "def hook(event, arguments):\n"
        "    if event in ('socket.connect', 'socket.getaddrinfo', 'socket.bind', "
        "'socket.sendto'):\n"
        "        raise RuntimeError('network')\n"
        "sys.addaudithook(hook)\n"
        "sys.argv = sys.argv[1:]\n"
        "runpy.run_path(sys.argv[0], run_name='__main__')\n"
    )
    lens.write_text(json.dumps({"intrinsics": K, "dist": dist}))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(capture_job, "python_command", lambda: [sys.executable, str(guard)])
        run_to_end(CaptureJob(scene))
    assert scene.scope.result.people == 1
    found = stored_motion(next(o for o in captures()[-1].objects if "scope_source" in o))
    assert np.allclose(found.intrinsics, K)
    assert np.allclose(found.dist, dist)
    assert pixel_aspect(found) == pytest.approx((720 / 700, 1.0))
    camera = next(o for o in captures()[0].objects if o.type == "CAMERA")
    assert camera.data.background_images[0].clip_user.use_render_undistorted
    fake_worker("send('error', message='asked again')")
    run_to_end(CaptureJob(scene))
    lens.write_text(json.dumps({"intrinsics": K, "dist": [-0.1, *dist[1:]]}))
    with pytest.raises(WorkerFailedError, match="asked again"):
        run_to_end(CaptureJob(scene))


@pytest.mark.skipif(sys.platform != "linux", reason="file names are Unicode on this system")
def test_footage_whose_name_is_not_utf8(fake_worker, footage, tmp_path):
    fake_worker("send('progress', stage=request['footage'], done=0, total=0)\nfinish()")
    renamed = footage.rename(tmp_path / os.fsdecode(b"caf\xe9.png"))
    settings = bpy.context.scene.scope
    settings.footage = str(renamed)
    assert bpy.ops.scope.capture() == {"FINISHED"}
    assert settings.result.footage == str(renamed)
    assert "caf\N{REPLACEMENT CHARACTER}" in captures()[0].name
    settings.footage = str(tmp_path / os.fsdecode(b"\xe9.mp4"))
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.scope.capture()
    assert "does not exist" in state.message
    state.message.encode()


def test_a_kept_frame_rate_that_differs_is_reported(fake_worker):
    fake_worker("finish()")
    scene = bpy.context.scene
    scene.render.fps = 20
    scene.scope.frame_rate = "KEEP"
    bpy.ops.scope.capture()
    texts = [warning.text for warning in scene.scope.result.warnings]
    assert any("keeps its 20 frames/s, the footage has 25" in text for text in texts)


def test_disabling_the_extension_ends_the_worker(fake_worker):
    import scope

    fake_worker("time.sleep(600)")
    state.job = job = CaptureJob(bpy.context.scene)
    scope.unregister()
    try:
        assert not job.worker.alive
        assert job_files() == []
    finally:
        scope.register()


def test_views_are_captured_with_their_offsets_and_shown(fake_worker, footage, tmp_path, standing):
    standing = replace(standing, views=made_views(0.5))
    standing.save(tmp_path / "seen.npz")
    views = [{"source": "a", "is_used": True}]
    views += [{"source": "b", "is_used": False}, {"source": "c", "is_used": True}]
    fake_worker(f"""
        assert [os.path.basename(path) for path in request["views"]] == ["b.png", "c.png"]
        assert request["offset"] == "auto,-1.500000"
        shutil.copy({str(tmp_path / "seen.npz")!r}, os.path.join(folder, "person1.npz"))
        report = dict(people=1, reprojection_px=2.5, fps=dict(total=5.0), warnings=[])
        send("result", motions=["person1.npz"], report=dict(report, views={views!r}))
    """)
    scene = bpy.context.scene
    settings = scene.scope
    for name in ("b.png", "c.png"):
        shutil.copy(footage, tmp_path / name)
        assert bpy.ops.scope.add_view(filepath=str(tmp_path / name)) == {"FINISHED"}
    settings.views[1].use_offset = True
    settings.views[1].offset_s = -1.5
    assert bpy.ops.scope.capture() == {"FINISHED"}
    cameras = cameras_of(scene)
    shown = [camera.data.background_images[0].image.filepath for camera in cameras]
    assert [os.path.basename(path) for path in shown] == [footage.name, "c.png"]
    first = capture_request(scene)
    settings.views[1].offset_s = -1.0
    other = capture_request(scene)
    assert first.key("1") != other.key("1")
    assert bpy.ops.scope.remove_view(index=0) == {"FINISHED"}
    assert [view.footage for view in settings.views] == [str(tmp_path / "c.png")]
    assert capture_request(scene).views == (str(tmp_path / "c.png"),)


def test_at_most_seven_further_views_which_exist(footage, tmp_path):
    settings = bpy.context.scene.scope
    settings.footage = ""
    assert not bpy.ops.scope.add_view.poll()
    settings.footage = str(footage)
    with pytest.raises(RuntimeError, match="is not a file"):
        bpy.ops.scope.add_view(filepath=str(tmp_path / "gone.mp4"))
    files = [{"name": footage.name}] * 8
    with pytest.raises(RuntimeError, match="at most eight"):
        bpy.ops.scope.add_view(directory=str(tmp_path), files=files)
    assert len(settings.views) == 0
    assert bpy.ops.scope.add_view(directory=str(tmp_path), files=files[:7]) == {"FINISHED"}
    assert len(settings.views) == 7
    assert not bpy.ops.scope.add_view.poll()
    footage.rename(tmp_path / "moved.png")
    settings.footage = str(tmp_path / "moved.png")
    with pytest.raises(ScopeError, match="does not exist; choose the video or image again"):
        capture_request(bpy.context.scene)
