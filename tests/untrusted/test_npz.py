# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain arrays from .npz files of anyone: what is read, and what is refused in one line of the
caller's error.
"""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.untrusted import files
from scope.scope_addon.untrusted.files import read_npz
from scope.solver.errors import InputError


class OwnError(InputError):
    """As each kind of file has its own."""


ARRAYS = {
    "a": np.arange(6.0).reshape(2, 3),
    "text": np.array("walk"),
    "flags": np.array([True, False]),
}


def saved(path: Path, **more: np.ndarray) -> Path:
    np.savez_compressed(path, **ARRAYS, **more)
    return path


def test_bytes_may_be_an_archive_of_the_larger_kind(tmp_path, monkeypatch):
    """Its directory is followed by another mark, by which numpy did not know it."""
    monkeypatch.setattr(zipfile, "ZIP_FILECOUNT_LIMIT", 1)
    path = saved(tmp_path / "a.npz")
    monkeypatch.undo()
    content = path.read_bytes()
    assert b"PK\x06\x06" in content
    found = read_npz(Path("named.npz"), OwnError, "motion file", content=content)
    assert set(found) == set(ARRAYS)


def test_arrays_come_back_with_their_types(tmp_path):
    found = read_npz(saved(tmp_path / "a.npz"), OwnError, "motion file")
    assert set(found) == set(ARRAYS)
    for key, array in ARRAYS.items():
        np.testing.assert_array_equal(found[key], array)
        assert found[key].dtype == array.dtype


def test_a_file_in_memory_is_read_likewise():
    buffer = io.BytesIO()
    np.savez(buffer, **ARRAYS)
    found = read_npz(Path("named.npz"), OwnError, "motion file", content=buffer.getvalue())
    np.testing.assert_array_equal(found["a"], ARRAYS["a"])
    with pytest.raises(OwnError, match="named.npz"):
        read_npz(Path("named.npz"), OwnError, "motion file", content=buffer.getvalue()[:-30])


def test_only_what_is_wanted_is_read_so_that_the_rest_may_be_anything(tmp_path):
    path = saved(tmp_path / "a.npz", pickled=np.array([{}, None], dtype=object))
    assert set(read_npz(path, OwnError, "motion file", wanted=["a", "absent"])) == {"a"}
    with pytest.raises(OwnError, match=r"a\.npz is not a readable motion file"):
        read_npz(path, OwnError, "motion file")


def test_what_would_unpack_to_too_much_is_refused_before(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "LARGEST_BYTES", 1 << 20)
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, a=np.zeros(1 << 20))
    assert path.stat().st_size < 1 << 16
    with pytest.raises(
        OwnError,
        match=r"bomb\.npz would unpack to 8 MiB, too large for a motion "
        r"file",
    ):
        read_npz(path, OwnError, "motion file")


@pytest.mark.parametrize("content", [b"", b"junk", b"PK\x05\x06" + bytes(18), b"\x93NUMPY\x01\x00"])
def test_what_is_no_archive_of_arrays_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "a.npz"
    path.write_bytes(content)
    if content.startswith(b"PK"):  # an archive without members
        assert read_npz(path, OwnError, "motion file") == {}
        return
    with pytest.raises(OwnError, match=r"a\.npz") as caught:
        read_npz(path, OwnError, "motion file")
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_foreign_member_are_told(tmp_path):
    with pytest.raises(OwnError, match=r"gone\.npz does not exist"):
        read_npz(tmp_path / "gone.npz", OwnError, "motion file")
    path = saved(tmp_path / "a.npz")
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("b.npy", b"\x93NUMPY\x09\x00")
    with pytest.raises(OwnError, match=r"a\.npz is not a readable motion file"):
        read_npz(path, OwnError, "motion file")
