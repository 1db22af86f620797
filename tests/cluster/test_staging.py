# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of attempts: complete and checked results get their final names, and nothing else
does.
"""

import hashlib
import os
import subprocess
import sys

import pytest
from scope.scope_addon.cluster.staging import TOKEN, Staging
from scope.scope_addon.errors import OutputError
from scope.scope_addon.processes import computer


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
    assert not (out / ".scope-attempts").exists()


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
    assert names(out) == [f".scope-attempts/{staging.folder.name}/{TOKEN}"]


def test_results_may_be_on_another_disk(out, tmp_path, monkeypatch):
    staging = Staging(out)
    folder, content = attempt(staging, "0", "good")
    replace = os.replace

    def across(source, target):
        if "scope-attempts" in str(source):
            raise OSError(18, "Invalid cross-device link")
        replace(source, target)

    monkeypatch.setattr(os, "replace", across)
    assert staging.publish(folder, ["below/a.npz"], content)
    assert (out / "below" / "a.npz").read_text("utf-8") == "good"


def test_folders_of_batches_that_were_killed_are_removed_and_those_of_others_stay(out):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    killed = out / ".scope-attempts" / f"{computer()}-{ended.pid}-00000000"
    elsewhere = out / ".scope-attempts" / f"00000000-{ended.pid}-00000000"
    killed.mkdir(parents=True)
    elsewhere.mkdir()
    running = Staging(out)
    found = {path.name for path in (out / ".scope-attempts").iterdir()}
    assert found == {elsewhere.name, running.folder.name}
    os.utime(elsewhere, (1, 1))
    Staging(out).close()
    assert {path.name for path in (out / ".scope-attempts").iterdir()} == {running.folder.name}


def test_a_folder_that_cannot_be_written_is_a_sentence(tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="cannot write"):
        Staging(tmp_path / "out")
