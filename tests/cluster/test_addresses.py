# SPDX-License-Identifier: GPL-3.0-or-later
"""Stores whose address has a password, of which neither files nor messages nor processes show more
than they need; `memory://` stands for other stores, and a client that computes by itself for a
cluster.
"""

import importlib
import json
import os
import sys
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest
from scope.scope_addon.cli import main
from scope.scope_addon.job.batch import REPORT_NAME

from ..required import package

fsspec = package("fsspec")
distributed = package("distributed")

pytestmark = pytest.mark.skipif(os.name == "nt", reason="a worker needs a POSIX system here")

# Replaces the capture, and leaves its arguments beside this test's other files.
PROGRAM = """
import json, pathlib, sys
clip = pathlib.Path(sys.argv[2])
pathlib.Path({folder!r}, clip.stem + ".json").write_text(json.dumps(sys.argv))
if clip.stem == "broken":
    print(f"scope: {{clip}} is not a video", file=sys.stderr); sys.exit(1)
outputs = [sys.argv[i + 1] for i, a in enumerate(sys.argv) if a == "-o"]
for path in outputs:
    pathlib.Path(path).write_text("result")
print(json.dumps({{"frames": 3, "outputs": outputs, "warnings": []}}))
"""
STORE = "memory://key:SECRET@bucket"


def submit(function, *arguments, key, **_):
    """Compute at once, as `Client.submit` does on a worker."""
    result = function(*arguments)
    return SimpleNamespace(
        key=key,
        status="finished",
        result=lambda timeout: result,
        add_done_callback=lambda done: done(SimpleNamespace(key=key)),
    )


@pytest.fixture
def memory(monkeypatch):
    """An empty store in memory, and a worker that sees it."""
    store = fsspec.filesystem("memory")
    for path in list(store.store):
        del store.store[path]
    client = MagicMock(status="running")
    client.sync.return_value = {"workers": ["tcp://worker:1"]}
    client.submit.side_effect = submit
    monkeypatch.setattr("scope.scope_addon.cluster.workers.connect", lambda address: client)
    worker = MagicMock(status=distributed.Status.running)
    worker.state.nthreads = 1
    worker.state.tasks.get.return_value.state = "executing"
    of_worker = importlib.import_module("scope.scope_addon.cluster.worker")
    monkeypatch.setattr(of_worker, "get_worker", lambda: worker)
    return store


def run(tmp_path):
    argv = ["batch", f"{STORE}/clips", "--out", f"{STORE}/out", "--formats", "npz", "--reports"]
    program = [sys.executable, "-c", PROGRAM.format(folder=str(tmp_path))]
    return main([*argv, "--scheduler", "tcp://scheduler:1"], program=program)


def test_no_file_message_or_process_has_the_password_of_a_store(
    memory, monkeypatch, tmp_path, capsys
):
    for name in ("broken", "fine", "lost", "withheld"):
        memory.pipe_file(f"/key:SECRET@bucket/clips/{name}.mp4", b"clip")
    remote = importlib.import_module("scope.scope_addon.cluster.remote")
    download, upload = remote.download, remote.upload

    def without_access(url, folder, **given):
        if "withheld" in url:
            raise PermissionError(f"no access to {url}")
        return download(url, folder, **given)

    def cut(file, url):
        if "lost" in url:
            raise OSError(f"{url} is not as large as what was written")
        upload(file, url)

    monkeypatch.setattr(remote, "download", without_access)
    monkeypatch.setattr(remote, "upload", cut)
    assert run(tmp_path) == 1
    text = memory.cat_file(f"/key:SECRET@bucket/out/{REPORT_NAME}").decode()
    report = json.loads(text)
    messages = {entry["name"]: entry.get("message", "") for entry in report["files"]}
    assert messages["broken"] == "memory://bucket/clips/broken.mp4 is not a video"
    assert messages["withheld"].startswith("memory://bucket/clips/withheld.mp4 cannot be used")
    assert any("lost.mp4 is captured again" in each["event"] for each in report["log"])
    command = json.loads((tmp_path / "fine.json").read_text("utf-8"))
    shown = command[-1]  # on a page, instead of the folder of a download
    assert " capture memory://bucket/clips/fine.mp4 " in shown
    assert "-o memory://bucket/out/fine.npz" in shown
    said = capsys.readouterr()
    assert "SECRET" not in "".join([text, *command, said.out, said.err])


def test_a_worker_without_the_footage_does_not_tell_the_password(
    memory, monkeypatch, tmp_path, capsys
):
    memory.pipe_file("/key:SECRET@bucket/clips/a.mp4", b"clip")
    remote = importlib.import_module("scope.scope_addon.cluster.remote")
    monkeypatch.setattr(remote, "is_folder", lambda url: False)
    answers = []
    of_worker = importlib.import_module("scope.scope_addon.cluster.worker")
    check = of_worker.check_worker

    def noted(wanted):
        answers.append(check(wanted))
        return answers[-1]

    monkeypatch.setattr(of_worker, "check_worker", noted)
    assert run(tmp_path) == 1
    assert "it has no folder memory://bucket/clips" in capsys.readouterr().err
    assert "SECRET" not in str(answers)


def test_files_of_an_earlier_number_of_people_in_a_store_are_named(memory, tmp_path):
    memory.pipe_file("/key:SECRET@bucket/clips/fine.mp4", b"clip")
    memory.pipe_file("/key:SECRET@bucket/out/fine.person2.npz", b"earlier")
    assert run(tmp_path) == 0
    report = json.loads(memory.cat_file(f"/key:SECRET@bucket/out/{REPORT_NAME}"))
    (warning,) = report["files"][0]["report"]["warnings"]
    assert "not part of this result: 'fine.person2.npz';" in warning


def test_results_in_a_store_that_were_cut_are_captured_again(memory, tmp_path):
    memory.pipe_file("/key:SECRET@bucket/clips/fine.mp4", b"clip")

    def outcome():
        assert run(tmp_path) == 0
        (entry,) = json.loads(memory.cat_file(f"/key:SECRET@bucket/out/{REPORT_NAME}"))["files"]
        return entry["status"]

    assert outcome() == "done"
    assert outcome() == "skipped"
    memory.pipe_file("/key:SECRET@bucket/out/fine.npz", b"")
    assert outcome() == "done"
