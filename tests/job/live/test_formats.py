# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera is asked for its formats in a process of its own, which ends with the answer, or without
one.
"""

import json
import sys
import textwrap

import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.job import live_cameras
from scope.scope_addon.job.live_cameras import (
    FormatsProcess,
    ListedCamera,
    ask_for_formats,
    list_cameras,
)
from scope.scope_addon.job.process import WorkerFailedError
from scope.scope_addon.job.request import FormatsRequest

from ..processes import runs, wait_for

ANSWER = {"event": "result", "name": "USB Camera", "formats": ["mjpeg 1280×720"]}


@pytest.fixture(autouse=True)
def nobody_is_given_up(monkeypatch):
    """On a computer that has other work, a process may take minutes to start."""
    monkeypatch.setattr(live_cameras, "ANSWER_S", 900.0)


@pytest.fixture
def asking(tmp_path):
    """Start a process that does as a script says, which knows the request as ``asked``."""
    started = []

    def start(code):
        script = tmp_path / "fake.py"
        lines = "import json, os, sys, time\nasked = json.loads(sys.stdin.readline())\n"
        script.write_text(lines + textwrap.dedent(code))
        folder = tmp_path / "job"
        folder.mkdir()
        started.append(FormatsProcess("2", folder, [sys.executable], script))
        return started[-1]

    yield start
    for process in started:
        process.close()
        assert not runs(process.pid)
        assert not process.job_folder.exists()


def test_the_answer_is_a_camera(asking):
    process = asking(f"assert asked == {{'formats_of': '2'}}; print(json.dumps({ANSWER!r}))")
    found = []
    wait_for(lambda: found.append(process.answer()) or found[-1])
    assert found[-1] == ListedCamera(2, "USB Camera", ("mjpeg 1280×720",))


def test_a_camera_that_does_not_answer_is_given_up(asking, monkeypatch):
    process = asking("time.sleep(600)")
    assert process.answer() is None
    monkeypatch.setattr(live_cameras, "ANSWER_S", 0.0)
    with pytest.raises(
        WorkerFailedError,
        match="camera 2 has not reported its formats within 0 s; if the system asks",
    ):
        process.answer()


@pytest.mark.parametrize(
    ("code", "sentence"),
    [
        # as by its driver
        ("os.abort()", "camera 2 cannot be asked for its formats; check that it is plugged in"),
        (
            "print(json.dumps({'event': 'error', 'message': 'camera 2 does not exist'}))",
            "^camera 2 does not exist$",
        ),
        (
            "print(json.dumps({'event': 'result', 'name': 'x', 'formats': ['a'] * 65}))",
            "cannot be used .result without a valid formats",
        ),
        (
            "print(json.dumps({'event': 'result', 'name': 'x', 'formats': ['a\\x1b[2J']}))",
            "without a valid formats",
        ),
    ],
)
def test_what_is_no_answer_is_an_error(asking, code, sentence):
    process = asking(code)
    with pytest.raises(WorkerFailedError, match=sentence):
        wait_for(process.answer)


def test_the_worker_answers_for_a_camera_that_does_not_exist():
    if list_cameras():
        pytest.skip("there are cameras, which a test must not open")
    with pytest.raises(WorkerFailedError, match="camera 99 does not exist"):
        ask_for_formats("/dev/video99" if sys.platform.startswith("linux") else "99")


@pytest.mark.parametrize("value", [1, "0\n", "/dev/sda"])
def test_a_request_names_a_camera(value):
    with pytest.raises(UsageError):
        FormatsRequest.from_json(json.dumps({"formats_of": value}))


def test_requests_are_told_apart():
    request = FormatsRequest("/dev/video0").to_json()
    assert FormatsRequest.is_in(request)
    assert FormatsRequest.from_json(request).source == "/dev/video0"
    assert not FormatsRequest.is_in('{"live": "0"}')
