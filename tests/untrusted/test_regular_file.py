# SPDX-License-Identifier: GPL-3.0-or-later
"""Pipes, devices and files that are too large are refused before anything is read."""

import os
from pathlib import Path

import pytest
from scope.scope_addon.untrusted.files import check_regular
from scope.solver.errors import InputError, ModelFileError


def test_files_folders_and_what_does_not_exist_pass(tmp_path):
    (tmp_path / "a.npz").write_bytes(bytes(100))
    (tmp_path / "link.npz").symlink_to(tmp_path / "a.npz")
    for name in ("a.npz", "link.npz", ".", "missing.npz"):
        check_regular(tmp_path / name, InputError, "motion file", 100)


def test_a_large_file_is_refused(tmp_path):
    with (tmp_path / "a.npz").open("wb") as file:
        file.truncate(5 << 20)
    with pytest.raises(
        ModelFileError,
        match=r"a\.npz has 5 MiB, too large for a body file; choose "
        r"another file",
    ):
        check_regular(tmp_path / "a.npz", ModelFileError, "body file", (5 << 20) - 1)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes in folders")
def test_a_pipe_and_a_device_are_refused(tmp_path):
    os.mkfifo(tmp_path / "a.npz")
    for path in (tmp_path / "a.npz", Path(os.devnull)):
        with pytest.raises(
            InputError,
            match=rf"{path} is a pipe or a device, not a regular file; choose a motion "
            rf"file",
        ):
            check_regular(path, InputError, "motion file", 1 << 30)
