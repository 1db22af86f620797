# SPDX-License-Identifier: GPL-3.0-or-later
"""Versions of the program; requests themselves are in test_worker.py."""

import os

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
