# SPDX-License-Identifier: GPL-3.0-or-later
"""The clip that is captured, and the run that is killed, by what they do to a few frames and a
small program.
"""

from __future__ import annotations

import sys

import pytest

pytest.importorskip("pty", reason="the benchmark reads a terminal")
from scope.benchmarks import interrupted

from ..job.processes import wait_for

PROGRAM = """
import subprocess, sys, time
from scope.scope_addon.command_line.terminal import ProgressBar
code = "import time; x = b'x' * 50_000_000; print('in', flush=True); time.sleep(600)"
child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
child.stdout.readline()
print("a warning", file=sys.stderr)
bar = ProgressBar(sys.stderr, show=sys.stderr.isatty())
bar("reading", 3, 3)
for k in range(1, 101):
    bar("finding the person", k, 100)
    if k == int(sys.argv[1]):
        time.sleep(600)
child.kill()
"""


class RunThatIsWatched(interrupted.Run):
    """It is not killed before the memory of its child was seen, which happens twice a second."""

    def _note(self, stage: str, done: int, total: int) -> None:
        if done >= 40:
            wait_for(lambda: self.peak_mib > 50)
        super()._note(stage, done, total)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_a_run_is_killed_with_its_children_at_a_share_of_the_frames() -> None:
    environment = {"PYTHONPATH": ":".join(sys.path)}
    run = RunThatIsWatched([sys.executable, "-c", PROGRAM, "60"], environment, kill_at=0.4)
    assert run.status == -9
    assert run.seen["finding the person from"][1] == 1
    assert 40 <= run.seen["finding the person"][1] < 60
    assert run.seen["reading"][1] == 3
    assert run.said.strip() == "a warning"
    whole = interrupted.Run([sys.executable, "-c", PROGRAM, "0"], environment)
    assert whole.status == 0
    assert whole.seen["finding the person"][1] >= 99  # what follows the last number is no line
