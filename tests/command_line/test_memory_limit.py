# SPDX-License-Identifier: GPL-3.0-or-later
"""A shell that limits memory gives one sentence, not a crash: at 1.5 GB, Blender's module would be half loaded."""

import subprocess
import sys

import pytest

pytest.importorskip("resource", reason="Windows has no such limit")


@pytest.mark.skipif(sys.platform != "linux", reason="macOS does not enforce the limit")
@pytest.mark.parametrize(
    ("limit_kb", "output", "says"),
    [
        (1_500_000, "out.glb", "this shell limits a process to 1.54 GB of address space, but a capture needs 3.20 GB"),
        (500_000, "out.npz", "this shell limits a process to 0.51 GB of address space, but a capture needs 2.50 GB"),
        (250_000, "out.npz", "there is too little memory to load the program; free memory"),
        (110_000, "out.npz", "there is too little memory to load the program; free memory"),
    ],
)
def test_a_low_limit_is_one_sentence(tmp_path, limit_kb, output, says):
    command = f'ulimit -v {limit_kb}; exec "$0" -m scope.scope_addon capture -o "$1"'
    done = subprocess.run(
        ["bash", "-c", command, sys.executable, tmp_path / output], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.startswith(f"scope: {says}")
    assert done.stderr.count("\n") == 1
    assert not any(tmp_path.iterdir())
