# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig that takes the importer too long, or too much memory, ends the command with one sentence;
and what Blender's module leaves.
"""

import os
import signal
import subprocess
import sys

import pytest
from scope.scope_addon.temporary import remove_abandoned

CODE = """
import pathlib, sys, time
from scope.scope_addon.command_line import blender_module as b
b.BASE_S, b.BASE_BYTES = {seconds}, 100_000_000
with b.bounded_import(pathlib.Path(sys.argv[1])):
    pass
with b.bounded_import(pathlib.Path(sys.argv[1])):
    {work}
print("whole", flush=True)
"""


@pytest.mark.parametrize(
    ("seconds", "work", "says"),
    [
        (
            300,
            "block = bytearray(b'1') * 300_000_000; time.sleep(300)",
            "takes more than 0.1 GB of memory; export",
        ),
        (
            0.6,
            "import os; os.dup2(os.open(os.devnull, os.O_WRONLY), 2)\n    while True: pass",
            "Blender did not finish importing this file within 1 s; export it again",
        ),
        (300, "block = bytearray(b'1') * 30_000_000", None),
    ],
)
def test_time_and_memory_are_bounded(tmp_path, seconds, work, says):
    rig = tmp_path / "rig.fbx"
    rig.write_bytes(b"short")
    command = [sys.executable, "-c", CODE.format(seconds=seconds, work=work), rig]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    if says is None:
        assert (done.returncode, done.stdout, done.stderr) == (0, "whole\n", "")
    else:
        assert (done.returncode, done.stdout) == (1, "")
        assert done.stderr.startswith(f"scope: {rig}: ")
        assert says in done.stderr
        assert done.stderr.count("\n") == 1


KILLED = """
import os, signal
from scope.scope_addon.command_line.blender_module import load_blender
load_blender()
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.usefixtures("blender_module")
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
def test_what_a_killed_process_has_left_of_blenders_module_is_removed_by_the_next_one(tmp_path):
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    killed = subprocess.run([sys.executable, "-c", KILLED], env=environment, check=False)
    assert killed.returncode == -signal.SIGKILL
    assert list(tmp_path.iterdir())
    remove_abandoned(tmp_path)
    assert list(tmp_path.iterdir()) == []
