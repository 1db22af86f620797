# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged headers of arrays, which numpy reads as Python literals, give a sentence, and so does a
disk that fails to read for a moment.
"""

import builtins
import errno
import io
import os
import random
import shutil
import struct
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.retarget.import_motions import import_motions
from scope.scope_addon.untrusted.body_file import load_body
from scope.scope_addon.untrusted.files import npz_keys, read_npz
from scope.solver.body_file import ASSETS
from scope.solver.errors import InputError, ModelFileError

from ..made_motion import made_motion

HEADER = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }"
# What numpy's reader raises at these: TokenError, IndentationError, SyntaxError, TypeError,
# OverflowError, ValueError.
KNOWN = (
    "('''",
    "{\n  1\n 2}",
    "{'a' 1 +",
    "{'descr': 1, 'fortran_order': 2, 'shape': ()}",
    "[" * 300,
    "{'shape': (1e999,)}",
)


def archive(path: Path, header: str) -> Path:
    text = header.encode("latin1") + b"\n"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(
            "a.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + bytes(48)
        )
    return path


def check(path: Path) -> None:
    """Read the array: the file gives it or one sentence."""
    with suppress(ModelFileError):
        read_npz(path, ModelFileError, "body file")


@pytest.mark.parametrize("header", KNOWN)
def test_headers_at_which_numpy_fails(tmp_path, header):
    path = archive(tmp_path / "a.npz", header)
    with pytest.raises(ModelFileError, match=r"a\.npz is not a readable"):
        read_npz(path, ModelFileError, "body file")


def test_a_long_header_is_refused_in_one_line(tmp_path):
    """Numpy says so in three."""
    path = archive(tmp_path / "a.npz", HEADER + " " * 30_000)
    with pytest.raises(ModelFileError) as caught:
        read_npz(path, ModelFileError, "body file")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_random_headers_never_give_a_traceback(tmp_path):
    chance = random.Random(7)
    for _ in range(80):
        characters = list(HEADER)
        for _ in range(chance.randint(1, 4)):
            characters[chance.randrange(len(characters))] = chance.choice(
                "'\"()[]{}\n\t \\,:0e#\x00é;="
            )
        check(archive(tmp_path / "a.npz", "".join(characters)))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes in folders")
def test_a_pipe_has_no_arrays(tmp_path):
    os.mkfifo(tmp_path / "a.npz")
    assert npz_keys(tmp_path / "a.npz", ModelFileError, "body file") == set()


class Disk:
    """A disk on which one read of a file fails, and all others succeed.

    :param n: number of the read that fails.
    """

    def __init__(self, path: Path, n: int) -> None:
        self._path = path
        self._n = n
        self.reads = 0

    def open(self, file, mode="r", *rest, **named):
        """Open a file as `open` does."""
        if mode != "rb" or Path(file) != self._path:
            return OPEN(file, mode, *rest, **named)
        disk = self

        class File(io.FileIO):
            def readinto(self, buffer):
                disk.reads += 1
                if disk.reads == disk._n:
                    raise OSError(errno.EIO, os.strerror(errno.EIO))
                return super().readinto(buffer)

        return io.BufferedReader(File(file), 1 << 16)


OPEN = io.open


# numpy leaves a file open whose archive it cannot read.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("read", [import_motions, load_body])
def test_a_read_that_fails_once_never_leads_to_another_reading(tmp_path, monkeypatch, read):
    """A motion of ours and a body mean something else to whoever does not see all their names."""
    path = tmp_path / "a.npz"
    if read is load_body:
        shutil.copy(ASSETS / "body" / "scope.npz", path)
    else:
        made_motion(load_body("scope"), np.zeros((2, 72)), np.zeros((2, 3))).save(path)
    found = repr(read(path))
    said = []
    n = 0
    while True:
        n += 1
        disk = Disk(path, n)
        monkeypatch.setattr(builtins, "open", disk.open)
        monkeypatch.setattr(io, "open", disk.open)
        try:
            assert repr(read(path)) == found, f"after a fault at read {n} of {disk.reads}"
        except InputError as error:
            said.append(str(error))
        monkeypatch.undo()
        if disk.reads < n:
            break
    assert len(said) == n - 1
    assert not any("\n" in text for text in said)
