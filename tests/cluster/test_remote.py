# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage and results in a store: listing, and what is published; `file://` and `memory://` stand
for other stores.
"""

import os

import pytest
from scope.scope_addon import temporary
from scope.scope_addon.cluster import remote
from scope.scope_addon.cluster.remote import RemoteStaging, mirror_footage, mirror_results, upload
from scope.scope_addon.errors import OutputError, UsageError
from scope.scope_addon.footage import display_text
from scope.scope_addon.job.batch import REPORT_NAME
from scope.solver.errors import InputError

from ..required import package

fsspec = package("fsspec")


@pytest.fixture
def store():
    """A store in memory with a clip and an earlier result."""
    memory = fsspec.filesystem("memory")
    for path in list(memory.store):
        del memory.store[path]
    memory.pipe_file("/bucket/clips/below/a.mp4", b"clip")
    memory.pipe_file("/bucket/clips/out/old.mp4", b"result")
    memory.pipe_file(f"/bucket/clips/out/{REPORT_NAME}", b"{}")
    return memory


def files(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


@pytest.mark.parametrize(
    ("url", "said"), [("s3://key:SECRET@b/clips", "ValueError"), ("s3://b/clips", "no bucket b")]
)
def test_what_a_store_says_of_an_address_with_a_password_is_not_told(url, said):
    with pytest.raises(InputError, match=said) as raised, remote.store_errors(InputError, url):
        raise ValueError(f"there is no bucket {url.removeprefix('s3://').removesuffix('/clips')}")
    assert "SECRET" not in display_text(str(raised.value))


def test_footage_and_results_are_mirrored_by_their_names(store, tmp_path):
    folder = mirror_footage(
        "memory://bucket/clips", "memory://bucket/clips/out", tmp_path / "clips"
    )
    assert files(folder) == ["below/a.mp4"]
    assert (folder / "below" / "a.mp4").read_bytes() == b""
    folder = mirror_results("memory://bucket/clips/out", tmp_path / "out")
    assert files(folder) == ["old.mp4", REPORT_NAME]
    assert (folder / REPORT_NAME).read_text("utf-8") == "{}"


def test_names_that_lead_elsewhere_are_left_out(store, tmp_path, monkeypatch):
    names = ["/bucket/a.mp4", "/bucket/../../b.mp4", "/bucket/c\\..\\d.mp4"]
    monkeypatch.setattr(type(store), "find", lambda *_: names)
    assert files(mirror_footage("memory://bucket", "", tmp_path / "clips")) == ["a.mp4"]


def test_a_numbered_picture_is_downloaded_with_its_sequence_if_that_is_wanted(store, tmp_path):
    for name in ("f_08.png", "f_09.png", "f_10.png", "g_09.png", "f_09.mp4", "f_below/f_11.png"):
        store.pipe_file(f"/bucket/pictures/{name}", name.encode())
    url = "memory://bucket/pictures/f_08.png"
    sequence = ["f_08.png", "f_09.png", "f_10.png"]
    for with_sequence, names in ((True, sequence), (False, sequence[:1])):
        folder = tmp_path / str(with_sequence)
        folder.mkdir()
        path = remote.download(url, folder, with_sequence=with_sequence)
        assert path == folder / "f_08.png"
        assert files(folder) == names
        assert (folder / names[-1]).read_text("utf-8") == names[-1]


def test_results_replace_earlier_ones_and_nothing_else_stays(store, tmp_path):
    out = "memory://bucket/out"
    file = tmp_path / "a.npz"
    for text in ("first", "second"):
        staging = RemoteStaging(out)
        file.write_text(text)
        upload(file, f"{staging.attempt(0)}/below/a.npz")
        assert staging.publish(
            staging.attempt(0), ["below/a.npz"], {"below/a.npz": {"bytes": len(text)}}
        )
        staging.write_report(file)
        staging.close()
        assert store.find("/bucket/out") == [
            "/bucket/out/below/a.npz",
            f"/bucket/out/{REPORT_NAME}",
        ]
        assert store.cat_file("/bucket/out/below/a.npz").decode() == text


def test_what_a_killed_batch_of_this_machine_has_left_is_removed(store, monkeypatch, tmp_path):
    monkeypatch.setattr(remote, "lasting_folder", lambda: tmp_path)
    out = "memory://bucket/out"
    killed = RemoteStaging(out)
    os.close(temporary._locks.pop(tmp_path / "batches" / killed.token))  # as a process's end does
    store.pipe_file("/bucket/out/.scope-attempts/elsewhere/token", b"another machine's")
    running = RemoteStaging(out)
    RemoteStaging(out).close()
    left = {path.split("/")[-2] for path in store.find("/bucket/out")}
    assert left == {running.token, "elsewhere"}
    running.close()
    assert list((tmp_path / "batches").iterdir()) == []


@pytest.mark.parametrize("damage", ["cut", "given up"])
def test_a_damaged_or_late_result_is_not_published(store, tmp_path, damage):
    staging = RemoteStaging("memory://bucket/out")
    (tmp_path / "a.npz").write_text("result")
    upload(tmp_path / "a.npz", f"{staging.attempt(0)}/a.npz")
    if damage == "given up":
        staging.remove(staging.attempt(0))
    assert not staging.publish(
        staging.attempt(0), ["a.npz"], {"a.npz": {"bytes": 7 if damage == "cut" else 6}}
    )
    staging.close()
    assert not store.exists("/bucket/out/a.npz")


def test_an_upload_that_is_cut_is_an_error(store, tmp_path, monkeypatch):
    (tmp_path / "a.npz").write_text("result")
    monkeypatch.setattr(
        type(store), "put_file", lambda self, file, path: self.pipe_file(path, b"res")
    )
    with pytest.raises(OSError, match="not as large"):
        upload(tmp_path / "a.npz", "memory://bucket/out/a.npz")


def test_what_a_store_raises_is_a_sentence(store, tmp_path, monkeypatch):
    def fails(*_):
        raise RuntimeError("no\nsuch bucket")

    monkeypatch.setattr(type(store), "find", fails)
    with pytest.raises(
        InputError, match="memory://bucket cannot be used .no such bucket.; check the address"
    ):
        mirror_footage("memory://bucket", "", tmp_path / "clips")
    with pytest.raises(OutputError):
        mirror_results("memory://bucket", tmp_path / "out")
    with pytest.raises(UsageError, match="nosuch://bucket cannot be used"):
        remote.is_folder("nosuch://bucket")
