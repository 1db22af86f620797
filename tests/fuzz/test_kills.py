# SPDX-License-Identifier: GPL-3.0-or-later
"""A command that is killed, or that the disk or the memory fails, at a few calls; at all by
./scripts/fuzz --faults.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from .disks import new_disk, problem_with
from .kills import COMMANDS, check_command
from .system_calls import AVAILABLE, CUT, FULL, KILL, NO_MEMORY, traced

pytestmark = pytest.mark.skipif(not AVAILABLE, reason="traces system calls of Linux on x86-64")
BY_NAME = {command.name: command for command in COMMANDS}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "action", "calls"),
    [
        ("npz", KILL, (-2,)),  # before it renames
        ("npz", NO_MEMORY, (-1,)),
        ("blend", FULL, (7,)),  # Blender does not say so
        ("usdc", FULL, (-18,)),  # nor does it where a piece in the middle is refused
        ("cache", KILL, (31,)),  # before a capture is moved into it
        ("cache", FULL, (5,)),
        ("compile", KILL, (8,)),  # before it renames
    ],
)
def test_files_are_old_or_whole_and_the_next_run_is_good(
    name: str, action: str, calls: tuple[int, ...]
) -> None:
    assert check_command(BY_NAME[name], action, calls) == (len(calls), [])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ext4", "btrfs"])
def test_a_power_cut_leaves_old_or_whole_files_and_keeps_what_was_said_to_be_there(
    kind: str,
) -> None:
    """A small command before it renames; every command, step and file system by --faults.

    btrfs writes a synced file alone, and ext4 whatever came before it.
    """
    if problem := problem_with(kind):
        pytest.skip(problem)
    assert check_command(BY_NAME["npz"], CUT, (-2,), kind) == (1, [])


WITHOUT_SYNC = """
import os, sys
with open(sys.argv[1] + ".new", "w") as file:
    file.write("whole")
os.replace(sys.argv[1] + ".new", sys.argv[1])
"""


def test_a_file_that_is_not_synced_is_lost_by_a_power_cut() -> None:
    """Otherwise the test above would find nothing."""
    if problem := problem_with("ext4"):
        pytest.skip(problem)
    with new_disk("ext4") as disk:
        path = disk.folder / "file"
        path.write_text("old")
        disk.sync()
        subprocess.run([sys.executable, "-c", WITHOUT_SYNC, str(path)], check=True)
        assert path.read_text() == "whole"
        disk.cut()
        assert path.read_text() != "whole"


PROGRAM = """
import os, subprocess, sys
folder = sys.argv[1]
with open(f"{folder}/a", "w") as file:
    file.write("x" * 20000)
subprocess.run(["mv", f"{folder}/a", f"{folder}/b"])
"""


def test_every_write_of_every_process_is_seen(tmp_path: Path) -> None:
    """Otherwise no fault would happen, and all would be well."""
    command = [sys.executable, "-c", PROGRAM, str(tmp_path)]
    whole = traced(command, tmp_path, 0, KILL)
    assert [call.split()[0] for call in whole.calls] == ["open", "write", "rename"]
    assert whole.status == 0
    (tmp_path / "b").unlink()
    killed = traced(command, tmp_path, 2, KILL)
    assert killed.status == -9
    assert (tmp_path / "a").stat().st_size == 0
    full = traced(command, tmp_path, 3, FULL)
    assert "No space left" in full.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
