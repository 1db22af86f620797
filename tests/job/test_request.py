# SPDX-License-Identifier: GPL-3.0-or-later
"""Versions of the program; requests themselves are in test_worker.py.

The worker's messages: what is none is ignored, and what cannot be used is an error of one
sentence.
"""

from __future__ import annotations

import json
import os
import sys
import time

import pytest
from scope.scope_addon.job.process import (
    LONGEST_LINE,
    WorkerFailedError,
    WorkerProcess,
    parse_message,
)
from scope.scope_addon.job.request import program_version

FILES = (
    "solver/fit.py",
    "scope_addon/capture/a.py",
    "assets/networks/pose.onnx",
    "assets/body/scope.npz",
)


def program(folder, changed=None):
    for name in (*FILES, "scope_addon/ui/panel.py"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("changed" if name == changed else "x")
    return program_version(folder)


def test_the_program_version_is_that_of_the_contents(tmp_path):
    first = program(tmp_path / "first")
    copies = [tmp_path / name for name in ("second", "third")]
    for copy in copies:
        (copy / "solver").mkdir(parents=True)
    os.utime(tmp_path / "first" / FILES[0], (1, 1))  # another machine's file times
    assert program(copies[0]) == first
    assert program(copies[1], "scope_addon/ui/panel.py") == first
    versions = [program(tmp_path / str(k), name) for k, name in enumerate(FILES)]
    assert len({first, *versions}) == len(FILES) + 1


PROGRESS = {"event": "progress", "stage": "solving", "done": 3, "total": 10}


PREVIEW = {"event": "preview", "file": "preview.rgba", "width": 320, "height": 180, "frame": 7}


RESULT = {
    "event": "result",
    "motions": ["person1.npz"],
    "report": {"fps": {"total": 9.5}, "notices": [{"code": "other"}]},
}


def line(message, **changes):
    return json.dumps({**message, **changes}).encode() + b"\n"


@pytest.mark.parametrize("message", [PROGRESS, PREVIEW, RESULT])
def test_messages_are_read(message):
    assert parse_message(line(message)) == message


@pytest.mark.parametrize(
    "text",
    [
        b"\n",
        b"Warning: a library prints\n",
        b"null",
        b'{"event": []}',
        b'{"event": "unheard of"}',
        b"\xff\xfe{",
        b"[" * 100_000,
        b'{"event": "progress", "done": ' + b"9" * 5000 + b"}",
    ],
)
def test_what_is_no_message_is_ignored(text):
    assert parse_message(text) is None


@pytest.mark.parametrize(
    ("message", "changes"),
    [
        (PROGRESS, {"stage": "x" * 3000}),
        (PROGRESS, {"done": -1}),
        (PROGRESS, {"total": 10**400}),
        (PREVIEW, {"file": "../../secret"}),
        (PREVIEW, {"file": "C:\\secret"}),
        (PREVIEW, {"width": 10**6}),
        (RESULT, {"motions": ["../person1.npz"]}),
        (RESULT, {"motions": []}),
        (RESULT, {"motions": ["person1.pkl"]}),
        (RESULT, {"report": None}),
        (RESULT, {"report": {"notices": [1]}}),
        (RESULT, {"report": {"fps": 3}}),
        (RESULT, {"report": {"fps": {"total": float("nan")}}}),
        (RESULT, {"report": {"per_person": 7}}),
        (RESULT, {"report": {"views": [{}]}}),
        (RESULT, {"report": {"per_person": [{"height_m": None}]}}),
        (RESULT, {"report": {"per_person": [{"height_m": 1.7, "height_sigma_m": ""}]}}),
        (RESULT, {"report": {"execution": "\ud800"}}),
    ],
)
def test_what_cannot_be_used_is_an_error(message, changes):
    with pytest.raises(
        WorkerFailedError,
        match=rf"{message['event']} without a valid {next(iter(changes))}\); "
        rf"try again",
    ):
        parse_message(line(message, **changes))


def test_a_line_without_an_end_takes_no_more_than_its_limit(tmp_path):
    """A worker that writes for ever is ended, with one sentence."""
    script = tmp_path / "worker.py"
    script.write_text("import sys\nwhile True:\n    sys.stdout.write('x' * (1 << 20))\n")
    (tmp_path / "job").mkdir()
    worker = WorkerProcess(None, tmp_path / "job", None, (sys.executable,), script)

    def listen():
        while not worker.finished:
            worker.poll()
            time.sleep(0.01)

    try:
        with pytest.raises(WorkerFailedError, match=f"a line of more than {LONGEST_LINE >> 20} MB"):
            listen()
    finally:
        worker.close()
    assert not worker.alive
    assert not (tmp_path / "job").exists()
