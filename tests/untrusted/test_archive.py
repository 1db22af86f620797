# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged headers of arrays, which numpy reads as Python literals, give a sentence."""

import os
import random
import struct
import zipfile
from contextlib import suppress
from pathlib import Path

import pytest
from scope.scope_addon.untrusted.files import npz_keys, read_npz
from scope.solver.errors import ModelFileError

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
    for _ in range(300):
        characters = list(HEADER)
        for _ in range(chance.randint(1, 4)):
            characters[chance.randrange(len(characters))] = chance.choice(
                "'\"()[]{}\n\t \\,:0e#\x00é;="
            )
        check(archive(tmp_path / "a.npz", "".join(characters)))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes in folders")
def test_a_pipe_has_no_arrays(tmp_path):
    os.mkfifo(tmp_path / "a.npz")
    assert npz_keys(tmp_path / "a.npz") == set()
