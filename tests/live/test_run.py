# SPDX-License-Identifier: GPL-3.0-or-later
"""A running capture whose source changes.

Rates and latencies of poses that come at known times.
"""

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.live import run
from scope.scope_addon.live.pose import Presence
from scope.scope_addon.live.recording import PeopleRecording
from scope.scope_addon.live.run import Listeners, LiveOptions, Statistics, _loop, run_live
from scope.scope_addon.live.source import Picture

from .fake_source import FakeClock, FakeSource

WIDE = np.zeros((96, 160, 3), np.uint8)


TALL = np.zeros((160, 96, 3), np.uint8)


@pytest.mark.usefixtures("networks")
def test_pictures_of_another_shape_are_said_and_begin_new_estimates(body):
    """Before them, that there are fewer cores than threads."""
    given = threading.Semaphore(1)
    said = []
    sizes = []
    poses = []
    source = FakeSource(
        [0.0, 0.1, 0.2], ends=True, images=[WIDE, WIDE, TALL], before=lambda _: given.acquire()
    )

    def send(pose, latency_ms):
        poses.append(pose)
        given.release()

    listeners = Listeners(say=said.append, camera=lambda people, size: sizes.append(size))
    options = LiveOptions(threads=5000)
    run_live(source, body, options, [SimpleNamespace(send=send)], listeners, FakeClock())
    assert len(poses) == 3
    assert sizes == [(160, 96), (96, 160)]
    cores, shape = said
    assert cores.startswith("5000 threads were requested, but there are only ")
    assert shape == (
        "fake now delivers images of another shape (96 × 160): body, lens and floor are "
        "estimated again, and a recording ends with the image before"
    )


def test_pictures_of_another_shape_that_end_the_capture_are_said_to(monkeypatch):
    """As in Blender while it records: nothing is estimated again."""
    said = []
    clock = FakeClock()

    def begin(people, size):
        if size == (96, 160):
            clock.stopped.set()

    monkeypatch.setattr(run, "LivePeople", lambda *_, **__: SimpleNamespace(step=lambda _: []))
    tracker = SimpleNamespace(reset=lambda: None)
    listeners = Listeners(said.append, camera=begin)
    poses = run._Poses(FakeSource(), None, LiveOptions(), tracker, None, listeners, clock)
    for image in (WIDE, TALL):
        poses.of(Picture(0, 0.0, 0.0, image))
    assert said == [
        "fake now delivers images of another shape (96 × 160): the capture ends with the image "
        "before"
    ]


def test_a_recording_ends_where_pictures_of_another_shape_begin(body, tmp_path):
    def people(camera):
        return SimpleNamespace(sessions=[SimpleNamespace(camera=camera)] * 2)

    def pose(person, time_s):
        return SimpleNamespace(
            person=person, index=round(10 * time_s), timestamp_s=time_s, presence=Presence.SEEN
        )

    recording = PeopleRecording(
        [tmp_path / "a.npz", tmp_path / "b.npz"], body, SimpleNamespace(name="fake")
    )
    recording.begin(people("of nobody yet"), (96, 160))
    recording.begin(people("first"), (160, 96))
    recording.send(pose(0, 1.0), 0.0)
    recording.send(pose(0, 1.5), 0.0)
    recording.begin(people("second"), (96, 160))
    recording.send(pose(0, 2.0), 0.0)
    recording.send(pose(1, 2.0), 0.0)
    assert (recording.seconds, recording.camera) == (0.5, "first")


def test_progress_shows_the_first_person_by_whom_camera_and_floor_are_estimated():
    shown = []
    poses = [SimpleNamespace(presence=each) for each in (Presence.LOST, Presence.SEEN)]
    taken = [SimpleNamespace(arrived_s=0.0), None]
    reader = SimpleNamespace(take=lambda: taken.pop(0), now=lambda: 0.1, received=3, damaged=0)
    listeners = Listeners(progress=shown.append)
    _loop(reader, SimpleNamespace(of=lambda _: poses), (), Statistics(), listeners)
    assert [(each.presence, each.dropped) for each in shown] == [(Presence.LOST, 2)]


def test_rates_are_poses_per_second_since_the_first_and_recently() -> None:
    statistics = Statistics()
    times = np.concatenate([np.arange(0, 10, 0.1), np.arange(10, 20.001, 0.05)]) + 100.0
    for time_s in times:
        statistics.add(time_s - 0.08, time_s)
    assert statistics.poses == len(times)
    assert statistics.rate == pytest.approx((len(times) - 1) / 20.0)
    assert statistics.recent_rate == pytest.approx(20.0)


def test_before_the_second_pose_there_is_no_rate() -> None:
    statistics = Statistics()
    assert (statistics.rate, statistics.recent_rate, statistics.latency_ms()) == (
        0.0,
        0.0,
        (0.0, 0.0),
    )
    statistics.add(1.0, 1.5)
    assert (statistics.rate, statistics.recent_rate, statistics.poses) == (0.0, 0.0, 1)
    statistics.add(1.0, 1.5)  # of another person, at the same time
    assert (statistics.rate, statistics.recent_rate) == (0.0, 0.0)
