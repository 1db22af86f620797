# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes of clips: what they print is returned, and they end when they are not wanted any
more.
"""

import sys
import threading

import pytest
from scope.scope_addon.job import clip_runner as module
from scope.scope_addon.job.clip_runner import ClipProcesses
from scope.scope_addon.parent import STOPPED

from ..processes import wait_for

# Ends when its standard input does, as a capture with --stop-with-stdin.
WAITING = "import sys; print('begun', flush=True); sys.stdin.read(); sys.exit(130)"


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """No process is killed because a busy computer has not even begun it."""
    monkeypatch.setattr(module, "_GRACE_S", 600.0)


def test_a_process_runs_to_its_end_while_it_is_wanted():
    code = "import sys; print('out'); print('err', file=sys.stderr); sys.exit(7)"
    assert ClipProcesses().run([sys.executable, "-c", code], lambda: True) == (7, "out\n", "err\n")


def test_a_process_that_is_not_wanted_any_more_ends():
    answers = iter([True, False])
    status, stdout, _ = ClipProcesses().run([sys.executable, "-c", WAITING], lambda: next(answers))
    assert (status, stdout) == (STOPPED, "begun\n")


def test_a_process_that_ignores_the_end_of_its_input_is_killed(monkeypatch):
    monkeypatch.setattr(module, "_GRACE_S", 0.1)
    code = "import time; time.sleep(600)"
    status, _, _ = ClipProcesses().run([sys.executable, "-c", code], lambda: False)
    assert status != 0


def test_nothing_starts_after_the_stop():
    processes = ClipProcesses()
    found = []
    thread = threading.Thread(
        target=lambda: found.append(processes.run([sys.executable, "-c", WAITING]))
    )
    thread.start()
    wait_for(lambda: processes._running)
    processes.stop()
    thread.join(300)
    assert found[0][0] == STOPPED
    assert processes.run(["/no/such/program"]) == (STOPPED, "", "")
