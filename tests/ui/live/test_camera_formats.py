# SPDX-License-Identifier: GPL-3.0-or-later
"""The button that asks a camera for its formats, with processes that answer as a script says."""

import textwrap
from types import SimpleNamespace

import bpy
import pytest
from scope.scope_addon.job import live_cameras
from scope.scope_addon.job.live_cameras import ListedCamera
from scope.scope_addon.ui import live_operators, live_properties
from scope.scope_addon.ui.live_operators import end_live
from scope.scope_addon.ui.live_properties import state

from ...job.processes import runs, wait_for

ANSWER = {"event": "result", "name": "USB Camera", "formats": ["mjpeg 1280×720"]}


@pytest.fixture(autouse=True)
def nobody_is_given_up(monkeypatch):
    """On a computer that has other work, a process may take minutes to start."""
    monkeypatch.setattr(live_cameras, "ANSWER_S", 900.0)


@pytest.fixture
def answering(tmp_path, monkeypatch):
    """Let cameras answer by a script."""

    def answer(code):
        script = tmp_path / "fake.py"
        script.write_text(
            "import json, sys, time\nasked = json.loads(sys.stdin.readline())\n"
            + textwrap.dedent(code)
        )
        real = live_cameras.FormatsProcess
        monkeypatch.setattr(
            live_cameras, "FormatsProcess", lambda *arguments: real(*arguments, script)
        )

    yield answer
    end_live()


def ask(camera="1: USB Camera"):
    bpy.context.scene.scope_live.camera = camera
    bpy.ops.scope.camera_formats()
    process = state.asking
    assert not bpy.ops.scope.camera_formats.poll()  # one after another
    wait_for(lambda: live_operators.see_answer() is None)
    assert not runs(process.pid)
    assert not process.job_folder.exists()


def drawn():
    """Return the texts that the panel shows of the chosen camera."""
    texts = []
    column = SimpleNamespace(label=lambda text, icon: texts.append(text))
    context = SimpleNamespace(
        preferences=bpy.context.preferences, region=None, scene=bpy.context.scene
    )
    live_operators.draw_formats(context, SimpleNamespace(column=lambda align: column))
    return " ".join(texts)


def test_the_answer_is_shown_and_completes_the_list(answering, monkeypatch):
    answering(f"assert asked == {{'formats_of': '1'}}; print(json.dumps({ANSWER!r}))")
    listed = [ListedCamera(0, "Front"), ListedCamera(1, "USB Camera")]
    monkeypatch.setattr(live_cameras, "list_cameras", lambda: listed)
    assert live_properties._cameras(None, None, "usb") == ["1: USB Camera"]
    ask()
    assert live_properties._cameras(None, None, "usb") == ["1: USB Camera (mjpeg 1280×720)"]
    assert drawn() == "1: USB Camera (mjpeg 1280×720)"
    bpy.context.scene.scope_live.camera = "0"
    assert drawn() == ""
    listed[1] = ListedCamera(1, "Other Camera")  # plugged in instead
    assert live_properties._cameras(None, None, "1") == ["1: Other Camera"]


def test_a_camera_without_an_answer_is_said(answering):
    answering(f"print(json.dumps({ {'event': 'error', 'message': 'camera 1 does not exist'}!r}))")
    ask()
    assert state.message == "Camera 1 does not exist"
    assert drawn() == ""


def test_a_camera_that_tells_none_is_said(answering):
    answering(f"print(json.dumps({ANSWER | {'formats': []}!r}))")
    ask()
    assert drawn() == "1: USB Camera It reports no formats"


def test_what_is_no_camera_is_not_asked(answering):
    bpy.context.scene.scope_live.camera = "front"
    with pytest.raises(RuntimeError, match="'front' is not a camera; enter its number"):
        bpy.ops.scope.camera_formats()
    assert state.asking is None


def test_disabling_the_extension_ends_the_question(answering):
    answering("time.sleep(600)")
    bpy.context.scene.scope_live.camera = "1"
    bpy.ops.scope.camera_formats()
    process = state.asking
    assert drawn() == "Querying the camera"
    end_live()
    assert not runs(process.pid)
    assert live_operators.see_answer() is None
