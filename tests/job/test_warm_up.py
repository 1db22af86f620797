# SPDX-License-Identifier: GPL-3.0-or-later
"""After a warm-up, a capture has nothing left to compile."""

import json
import subprocess
import sys

from scope.scope_addon.job.process import START_SCRIPT, WorkerProcess

from .processes import wait_for

# With the lowest priority, it takes seventy times as long while every core has other work, such as
# other tests.
START = """
import os, runpy
os.nice = lambda _: 0
runpy.run_path({script!r}, run_name="__main__")
"""
CAPTURE = """
import json, sys, tempfile, time
from pathlib import Path
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.job.request import ROOT, JobRequest
from scope.scope_addon.job.worker import Reporter, run
from scope.scope_addon.machine_code.code_cache import compiled_kernels
with tempfile.TemporaryDirectory() as folder:
    request = JobRequest(str(SAMPLE), quality="fast", end="0.2", threads=1)
    status = run(request, Path(folder), Reporter(sys.stderr))
print(json.dumps([status, compiled_kernels(ROOT)]))
"""


def test_a_capture_after_a_warm_up_compiles_nothing(tmp_path):
    folder = tmp_path / "job"
    folder.mkdir()
    script = tmp_path / "start.py"
    script.write_text(START.format(script=str(START_SCRIPT)))
    worker = WorkerProcess(None, folder, None, [sys.executable, "-I"], script)
    messages = []
    wait_for(lambda: messages.extend(worker.poll()) or worker.finished)
    worker.wait()
    worker.close()
    assert messages[-1]["compiled"] >= 0
    done = subprocess.run(
        [sys.executable, "-c", CAPTURE], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout) == [0, 0], done.stderr[-2000:]
