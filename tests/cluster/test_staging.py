# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of attempts: complete and checked results get their final names, and nothing else
does.
"""

import hashlib
import os
import subprocess
import sys
import time

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


def aged(path):
    """Let a file or folder look a month old."""
    month_ago = time.time() - 30 * 24 * 3600
    os.utime(path, (month_ago, month_ago), follow_symlinks=False)


def test_a_link_to_another_folder_is_refused_and_nothing_there_is_removed(out, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "footage").mkdir(parents=True)
    aged(elsewhere / "footage")
    (out / ".scope-attempts").symlink_to(elsewhere)
    with pytest.raises(OutputError, match="is a link to another folder"):
        Staging(out)
    assert os.listdir(elsewhere) == ["footage"]


def test_only_old_folders_that_a_batch_has_made_are_removed(out, tmp_path):
    attempts = out / ".scope-attempts"
    foreign = "0badcafe-12-0123abcd"  # of another computer, whose process cannot be asked about
    own = attempts / foreign
    own.mkdir(parents=True)
    (own / TOKEN).write_text("token")
    named_alike = attempts / foreign.replace("12", "13")
    named_alike.mkdir()
    (named_alike / "take.mp4").write_text("footage")
    other_name = attempts / "footage"
    other_name.mkdir()
    (other_name / TOKEN).write_text("not a batch's")
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / TOKEN).write_text("not a batch's")
    link = attempts / foreign.replace("12", "14")
    link.symlink_to(outside)
    for path in (own, named_alike, other_name, outside, link):
        aged(path)
    staging = Staging(out)
    staging.close()
    assert sorted(os.listdir(attempts)) == sorted([named_alike.name, other_name.name, link.name])
    assert names(named_alike) == ["take.mp4"]
    assert names(outside) == [TOKEN]
