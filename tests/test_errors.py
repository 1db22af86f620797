# SPDX-License-Identifier: GPL-3.0-or-later
"""Lack of memory is recognized, in whatever words a library says it.

Numbers with their noun. Hints of the solver to programmers.
"""

from __future__ import annotations

import errno
import os
import subprocess
import sys

import cv2
import numpy as np
import pytest
from scope.scope_addon.command_line.live_command import _summary
from scope.scope_addon.errors import lacks_memory, system_error_message
from scope.scope_addon.job.request import WARM_UP
from scope.scope_addon.notices import counted

from .fuzz.system_calls import AVAILABLE, NO_MEMORY, traced

LOADING = """
import sys
from scope.scope_addon.errors import lacks_memory
try:
    import cv2
except BaseException as error:
    print(lacks_memory(error), error)
"""

# A person far under the floor, as one who leaps off a roof, of whom the solver says so.
HINT = """
import numpy as np
from scope.solver import Floor, Keypoints3D, Measurements
def hint(*_, **__):
    points = Keypoints3D(range(5), np.full((5, 3), [0.0, 3.0, 5.0]), np.ones(5))
    floor = Floor([0], np.array([0.0, -1.0, 0.0]), -1.0, np.ones(1))
    Measurements(keypoints3d=points, floor=floor).packed_tables(22, 100)
    return 0
"""
PROGRAMS = {
    "a program that calls the solver": "hint()",
    "the same, which loads a body with the application": """
import scope.scope_addon.untrusted.body_file
hint()""",
}
PROCESSES = {
    "the command line": """
from scope.scope_addon import cli
cli.main = hint
cli.run()""",
    "a worker of Blender": """
import sys
from pathlib import Path
from scope.scope_addon.job import worker
worker.run = worker.end_with_parent = hint
worker.main(Path(sys.argv[1]))""",
}


@pytest.mark.parametrize("name", PROGRAMS | PROCESSES)
def test_hints_to_programmers_reach_these_alone(name, tmp_path) -> None:
    """Users of a capture cannot negate the normal of a floor."""
    command = [sys.executable, "-c", HINT + (PROGRAMS | PROCESSES)[name], str(tmp_path)]
    done = subprocess.run(command, input=WARM_UP, capture_output=True, text=True, check=True)
    if name in PROGRAMS:
        assert "ScopeWarning: Most 3D keypoints lie" in done.stderr
    else:
        assert not done.stderr


def test_a_defect_is_not_lack_of_memory() -> None:
    assert lacks_memory(MemoryError())
    assert not lacks_memory(ValueError("operands could not be broadcast"))


def test_opencv_without_memory() -> None:
    with pytest.raises(cv2.error) as caught:
        # more than the addresses that a process has
        cv2.resize(np.zeros((2, 2), np.uint8), (2**30, 2**24))
    assert lacks_memory(caught.value)


@pytest.mark.slow
@pytest.mark.skipif(not AVAILABLE, reason="traces system calls of Linux on x86-64")
def test_libraries_that_cannot_be_loaded(tmp_path) -> None:
    command = [sys.executable, "-c", LOADING]
    subprocess.run(command, check=True)
    count = len(traced(command, tmp_path, 0, NO_MEMORY).calls)
    said = [traced(command, tmp_path, n, NO_MEMORY) for n in range(count - 5, count + 1)]
    failed = [each.stdout for each in said if each.stdout.strip()]
    assert len(failed) > 1
    assert all(text.startswith("True") for text in failed), failed


@pytest.mark.parametrize(
    ("number", "advice"),
    [
        (errno.ENOSPC, "free disk space or memory and try again"),
        (
            errno.EACCES,
            "check the permissions of that file or folder, and whether another program has it open",
        ),
        (errno.ENAMETOOLONG, "choose a shorter name"),
        (errno.ENOENT, "check that this file or folder, and the current folder, still exist"),
    ],
)
def test_the_advice_fits_the_systems_error(number: int, advice: str) -> None:
    text = system_error_message(OSError(number, os.strerror(number), "walk.npz"))
    assert "walk.npz" in text
    assert text.endswith(f"; {advice}")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((0, "frame"), "0 frames"),
        ((1, "frame"), "1 frame"),
        ((2, "frame"), "2 frames"),
        ((3, "person", "people"), "3 people"),
    ],
)
def test_one_is_in_the_singular(arguments, text):
    assert counted(*arguments) == text


def test_a_live_capture_of_one_frame_is_summed_up_in_the_singular():
    latency = {"median": 40.0, "p95": 60.0}
    report = {
        "poses": 1,
        "poses_per_second": 30.0,
        "latency_ms": latency,
        "dropped": 0,
        "damaged": 0,
        "frames": 1,
        "outputs": [],
    }
    assert _summary(report).startswith("1 pose, 30/s")
    assert _summary(report).endswith("0 of 1 frame dropped")
