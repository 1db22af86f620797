# SPDX-License-Identifier: GPL-3.0-or-later
"""The real process of a live capture: poses of a playing video, a recording of them, and refused
streams.
"""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.errors import VideoError
from scope.scope_addon.job import live_capture
from scope.scope_addon.job.live_capture import _Recorder, capture_live
from scope.scope_addon.job.live_process import LiveProcess, parse_pose
from scope.scope_addon.job.process import WorkerFailedError
from scope.scope_addon.job.request import MOTION, RECORD, Commands, LiveRequest
from scope.scope_addon.live.pose import Presence
from scope.scope_addon.live.smoothing import DELAY_S
from scope.scope_addon.motion import Motion
from scope.scope_addon.notices import OTHER, notice

from ...live.fake_source import FakeSource
from ...live.test_vmc import pose_of
from ..long_clip import played_again_and_again
from ..processes import wait_for

RATE = 30  # of the clip


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "job").mkdir()
    return tmp_path / "job"


@pytest.mark.slow
def test_what_is_recorded_is_what_was_shown(folder, tmp_path, networks, body, monkeypatch):
    """A busy computer drops most frames, and shows some of the other poses: they are compared with
    all that came.
    """
    sent = []
    keep = LiveProcess._keep
    monkeypatch.setattr(
        LiveProcess, "_keep", lambda live, line: sent.append(line) or keep(live, line)
    )
    # the sample ends before the eighth pose on a busy machine
    source = played_again_and_again(tmp_path / "long.mp4")
    live = LiveProcess(
        LiveRequest(source, reconnect_s=0.0, threads=1), folder, None, [sys.executable, "-I"]
    )
    live.record()
    poses = []
    result = []

    def step():
        result.extend(m for m in live.poll() if m["event"] == "result")
        if newest := live.newest_poses(body.K + 1, body.P):
            poses.extend(newest)
            if len(poses) == 8:
                live.stop()
        return result

    wait_for(step)
    assert len(poses) >= 8
    wait_for(lambda: not live.alive)
    assert result[0]["motions"] == [MOTION.format(1)]
    motion = Motion.load(folder / MOTION.format(1))
    live.close()
    assert motion.frames[0] <= poses[0].frame
    every = [parse_pose(line, body.K + 1, body.P) for line in sent if b'"event": "pose"' in line]
    seen = {
        pose.frame: pose.pelvis for pose in every if pose is not None and pose.presence == "seen"
    }
    assert all(
        np.array_equal(pose.pelvis, seen[pose.frame]) for pose in poses if pose.presence == "seen"
    )
    given_s = np.array(list(seen)) / RATE - DELAY_S  # a pose is given that long after its time
    times = motion.frames[motion.valid] / RATE
    assert len(times) >= 4
    shown = np.stack(
        [np.interp(times, given_s, each) for each in np.array(list(seen.values())).T], axis=1
    )
    recorded = body.rest_joints(motion.betas)[0] + motion.trans[motion.valid]
    np.testing.assert_allclose(recorded[:, :2], shown[:, :2], atol=0.01)
    # legs are as long as estimated last
    np.testing.assert_allclose(recorded[:, 2], shown[:, 2], atol=0.1)


def test_a_recording_begins_when_it_is_asked_for(folder, body):
    commands = Commands()
    recorder = _Recorder([folder / "person1.npz"], body, FakeSource(), commands)
    recorder.begin(SimpleNamespace(sessions=[SimpleNamespace(camera=None)]), (640, 480))
    recorder.send(pose_of(body), 0.0)
    assert recorder.recording is None
    commands.receive(RECORD)
    for presence, time_s in ((Presence.LOST, 0.4), (Presence.SEEN, 1.0), (Presence.SEEN, 1.5)):
        recorder.send(replace(pose_of(body, presence=presence), timestamp_s=time_s), 0.0)
    assert recorder.recording.seconds == 0.5
    assert recorder.recording.origin == (3, 0.4)  # as Blender plays its scene from then on


def test_a_recording_with_footage_begins_with_its_first_picture(folder, body):
    commands = Commands()
    added = []
    footage = SimpleNamespace(origin=None, add=added.append)
    recorder = _Recorder([folder / "person1.npz"], body, FakeSource(), commands, footage)
    recorder.begin(SimpleNamespace(sessions=[SimpleNamespace(camera=None)]), (640, 480))
    recorder.receive("too early")
    commands.receive(RECORD)
    recorder.send(replace(pose_of(body), index=4), 0.0)  # of a picture that came before
    assert recorder.recording is None
    recorder.receive("first")
    footage.origin = 5, 0.2
    recorder.send(replace(pose_of(body), index=4), 0.0)
    assert recorder.recording is None
    recorder.send(replace(pose_of(body), index=6), 0.0)
    assert recorder.recording.origin == (5, 0.2)
    assert added == ["first"]


def test_what_is_said_during_a_recording_is_in_its_result_and_a_turned_phone_ends_it(
    folder, body, monkeypatch
):
    source = FakeSource()
    source.warnings.append(notice(OTHER, text="it is dark"))
    commands = Commands()
    camera = Camera(pinhole(640, 480, 600.0), np.zeros(5), "given")
    people = SimpleNamespace(sessions=[SimpleNamespace(camera=camera)])
    sent = []

    def run(source, body, options, outputs, listeners, clock):
        listeners.camera(people, (640, 480))
        listeners.say("before")
        commands.receive(RECORD)
        for k in range(20):
            outputs[0].send(replace(pose_of(body), index=k, timestamp_s=k / 30), 0.0)
        for text in ("it is dark", "nothing came for 7 s", "nothing came for 9 s"):
            listeners.say(text)
        assert not clock.stopped.is_set()
        listeners.camera(people, (480, 640))
        assert clock.stopped.is_set()
        return {"poses_per_second": 30.0}

    monkeypatch.setattr(live_capture, "open_source", lambda *_, **__: source)
    monkeypatch.setattr(live_capture, "run_live", run)
    request = LiveRequest("0")
    capture_live(request, folder, lambda event, **values: sent.append((event, values)), commands)
    event, result = sent[-1]
    assert event == "result"
    # Until the parent has what the motion files hold.
    assert len(list(live_capture.recordings_of(folder).glob("*.recording"))) == 1
    assert result["report"]["warnings"] == [
        "it is dark",
        "nothing came for 7 s (0.6 s into the recording)",
    ]


def test_images_that_are_missing_in_the_kept_footage_are_said():
    footage = SimpleNamespace(save=lambda: None, missing="take.mp4 lacks 3 frames of another size")
    assert [str(said) for said in live_capture.save_footage(footage)] == [footage.missing]


def test_a_stream_is_refused_without_the_network(folder):
    request = LiveRequest("rtsp://127.0.0.1:1/video")
    with pytest.raises(VideoError, match="Allow Online Access"):
        capture_live(request, folder, lambda *_, **__: None, Commands())


def test_a_source_that_is_not_there_is_an_error_of_one_sentence(folder):
    live = LiveProcess(LiveRequest("nowhere.mp4"), folder, None, [sys.executable, "-I"])
    with pytest.raises(WorkerFailedError, match=r"nowhere\.mp4"):
        wait_for(lambda: live.poll() and False)
    live.close()
    assert not folder.exists()
