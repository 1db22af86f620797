# SPDX-License-Identifier: GPL-3.0-or-later
"""The newest pose alone is seen, and what cannot be a pose is an error."""

import json
import sys
import textwrap
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.job import live_process
from scope.scope_addon.job.live_process import LiveProcess, parse_pose
from scope.scope_addon.job.process import WorkerFailedError
from scope.scope_addon.job.request import LiveRequest

from ..processes import wait_for

POSE = {
    "event": "pose",
    "person": 0,
    "frame": 3,
    "presence": "seen",
    "rotations": [[1, 0, 0, 0], [0.6, 0, 0.8, 0]],
    "positions": [[0, 0, 0.9], [0, 0, 1.2]],
    "betas": [0.5, -1.0, 0.0],
}


def line(**changes):
    return json.dumps(POSE | changes).encode() + b"\n"


def test_a_pose_is_read():
    pose = parse_pose(line(), 2, 3)
    assert (pose.frame, pose.presence) == (3, "seen")
    np.testing.assert_allclose(pose.rotations[1], [0.6, 0, 0.8, 0])
    np.testing.assert_allclose(pose.pelvis, [0, 0, 0.9])
    np.testing.assert_allclose(pose.betas, [0.5, -1.0, 0.0])


def test_nobody_seen_yet_is_no_pose():
    assert (
        parse_pose(b'{"event": "pose", "person": 0, "frame": 0, "presence": "lost"}\n', 2, 3)
        is None
    )


@pytest.mark.parametrize(
    "changes",
    [
        {"rotations": [[1, 0, 0, 0]]},
        {"rotations": [[2, 0, 0, 0], [1, 0, 0, 0]]},
        {"rotations": [[float("nan")] * 4] * 2},
        {"positions": []},
        {"positions": [[float("inf"), 0, 0]]},
        {"betas": [1.0]},
        {"presence": "hungry"},
        {"frame": -1},
    ],
)
def test_what_cannot_be_a_pose_is_an_error(changes):
    with pytest.raises(WorkerFailedError, match="cannot be used"):
        parse_pose(line(**changes), 2, 3)


def test_half_a_pose_is_an_error():
    with pytest.raises(WorkerFailedError, match="cannot be used"):
        parse_pose(line()[:40], 2, 3)


@pytest.fixture
def process(tmp_path):
    """Start a process that sends 100 poses, then what it hears."""
    script = tmp_path / "fake.py"
    script.write_text(
        textwrap.dedent(f"""
            import json, sys
            pose = {POSE!r}
            sys.stdin.readline()
            for frame in range(100):
                print(json.dumps(pose | {{"person": frame % 2, "frame": frame}}), flush=True)
            print(json.dumps({{"event": "notice", "text": "all sent"}}), flush=True)
            for heard in sys.stdin:
                print(json.dumps({{"event": "notice", "text": heard}}), flush=True)
        """)
    )
    (tmp_path / "job").mkdir()
    process = LiveProcess(LiveRequest("0"), tmp_path / "job", None, [sys.executable], script)
    yield process
    process.close()
    assert not process.alive
    assert not (tmp_path / "job").exists()


def test_a_pose_that_comes_while_others_are_taken_is_not_lost(process, monkeypatch):
    """Between finding where to store it and storing it, the reading thread may have to wait for the
    other one.
    """
    taken = []

    class Interrupted:
        def __init__(self):
            self.asked = 0

        def __getitem__(self, _):
            self.asked += 1
            if self.asked == 2:
                taken.extend(process.newest_poses(2, 3))
            return b"1"

    said = []
    wait_for(lambda: said.extend(process.poll()) or said)  # all of the script's poses have come
    monkeypatch.setattr(live_process, "_POSE", SimpleNamespace(match=lambda _: Interrupted()))
    process._keep(line(person=1, frame=500))
    taken += process.newest_poses(2, 3)
    assert [(pose.person, pose.frame) for pose in taken] == [(0, 98), (1, 99), (1, 500)]


def test_only_the_newest_pose_is_seen_and_commands_arrive(process):
    said = []

    def heard(count):
        said.extend(message["text"] for message in process.poll())
        return len(said) >= count

    wait_for(lambda: heard(1))
    assert [(pose.person, pose.frame) for pose in process.newest_poses(2, 3)] == [(0, 98), (1, 99)]
    assert process.newest_poses(2, 3) == []
    process.record()
    process.stop()
    wait_for(lambda: heard(3))
    assert said == ["all sent", "record\n", "stop\n"]
