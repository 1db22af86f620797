# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of attempts: complete and checked results get their final names, and nothing else
does.
"""

import hashlib
import importlib
import os
from pathlib import Path
from unittest.mock import MagicMock

import pytest
from scope.scope_addon import temporary
from scope.scope_addon.cluster.remote import TOKEN, Staging
from scope.scope_addon.errors import OutputError
from scope.scope_addon.job.clip_task import CaptureSettings, ClipTask
from scope.scope_addon.job.request import program_version


@pytest.fixture
def out(tmp_path):
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


def attempt(staging, name, text):
    """Write a result as a worker does; return the attempt's folder and the hash."""
    folder = staging.folder / name
    (folder / "below").mkdir(parents=True)
    (folder / "below" / "a.npz").write_text(text)
    return folder, {
        "below/a.npz": {"sha256": hashlib.sha256(text.encode()).hexdigest(), "bytes": len(text)}
    }


def names(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def test_results_are_renamed_and_replace_earlier_ones(out):
    staging = Staging(out)
    for text in ("first", "second"):
        folder, content = attempt(staging, text, text)
        assert staging.publish(folder, ["below/a.npz"], content)
        assert (out / "below" / "a.npz").read_text("utf-8") == text
    staging.close()
    assert names(out) == ["below/a.npz"]
    assert os.listdir(out) == ["below"]


@pytest.mark.parametrize("damage", ["changed", "cut", "missing", "unknown"])
def test_a_result_that_is_not_what_the_worker_wrote_is_not_published(out, damage):
    staging = Staging(out)
    folder, content = attempt(staging, "0", "good")
    assert staging.publish(folder, ["below/a.npz"], content)
    folder, content = attempt(staging, "1", "better")
    file = folder / "below" / "a.npz"
    if damage == "missing":
        file.unlink()
    elif damage == "unknown":
        content = {}
    else:
        file.write_text({"changed": "BETTER", "cut": ""}[damage])
    assert not staging.publish(folder, ["below/a.npz"], content)
    assert (out / "below" / "a.npz").read_text("utf-8") == "good"


def test_an_attempt_that_was_given_up_can_not_be_published(out):
    """Its worker was thought lost, but still writes."""
    staging = Staging(out)
    folder, content = attempt(staging, "0", "late")
    staging.remove(folder)
    with pytest.raises(FileNotFoundError):
        (folder / "below" / "b.npz").write_text("late")
    assert not staging.publish(folder, ["below/a.npz"], content)
    assert names(out) == sorted([f"{staging.folder.name}-lock", f"{staging.folder.name}/{TOKEN}"])


def test_a_late_worker_makes_no_folder_of_an_attempt_that_was_given_up(out, tmp_path, monkeypatch):
    """Nobody would remove it: the batch may have ended. Nor does one with another version begin."""
    of_worker = importlib.import_module("scope.scope_addon.cluster.worker")
    monkeypatch.setattr(of_worker, "get_worker", lambda: MagicMock(**{"state.nthreads": 1}))
    staging = Staging(out)
    folder = staging.attempt(0)
    staging.close()
    settings = CaptureSettings({}, (".npz",))
    task = ClipTask("a", "a.mp4", str(tmp_path / "a.mp4"), folder, "", settings)
    entry = of_worker.capture_on_worker(task, "key", ("never",), 1, program_version())
    assert entry["status"] == of_worker.LOST
    assert not Path(folder).parent.exists()
    entry = of_worker.capture_on_worker(task, "key", ("never",), 1, "another version")
    assert entry["status"] == of_worker.REFUSED


def test_results_may_be_on_another_disk(out, tmp_path, monkeypatch):
    staging = Staging(out)
    folder, content = attempt(staging, "0", "good")
    replace = os.replace

    def across(source, target):
        if ".attempts-" in str(source):
            raise OSError(18, "Invalid cross-device link")
        replace(source, target)

    monkeypatch.setattr(os, "replace", across)
    assert staging.publish(folder, ["below/a.npz"], content)
    assert (out / "below" / "a.npz").read_text("utf-8") == "good"


def test_the_folder_of_a_batch_that_was_killed_is_removed_and_that_of_a_running_one_stays(out):
    killed = Staging(out)
    os.close(temporary._locks.pop(killed.folder))  # as the end of a process does
    running = Staging(out)
    assert not killed.folder.exists()
    Staging(out).close()
    assert sorted(os.listdir(out)) == [running.folder.name, f"{running.folder.name}-lock"]


def test_a_folder_that_cannot_be_written_is_a_sentence(tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="cannot write"):
        Staging(tmp_path / "out")


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps its pipes in no folder")
@pytest.mark.parametrize("kind", ["link", "pipe", "file"])
def test_what_lies_under_a_name_like_ours_is_neither_followed_nor_removed(out, tmp_path, kind):
    name = ".attempts-scope-0123456789abcdef"
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "footage").mkdir(parents=True)
    os.utime(elsewhere / "footage", (1, 1))
    if kind == "link":
        (out / name).symlink_to(elsewhere)
    elif kind == "pipe":
        os.mkfifo(out / name)
    else:
        (out / name).write_text("a user's")
    Staging(out).close()
    assert os.listdir(out) == [name]
    assert os.listdir(elsewhere) == ["footage"]
