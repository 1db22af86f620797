# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard streams that are closed, full, or read by nobody: the right status and message, and whole results."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon import cli

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the shell's redirections are those of POSIX")

COMPLETE = "all results are complete"
MOTION = """
import sys
from scope.scope_addon import cli
cli.run_capture = lambda args: (args.output[0].write_text("motion"), print("of a library"), {"frames": 3})[-1]
cli.run()
"""


def shell(redirection: str, output: Path) -> subprocess.CompletedProcess:
    """Run a command line that captures nothing, but writes a file, with a shell's redirections."""
    command = shlex.join([sys.executable, "-c", MOTION, "capture", "-o", str(output), "--json"])
    line = redirection.replace("COMMAND", command)
    return subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)


@pytest.mark.parametrize(
    ("redirection", "says"),
    [
        ("COMMAND > /dev/full", "written to standard output (No space left on device)"),
        ("COMMAND >&-", "written to standard output"),
    ],
)
def test_a_report_that_cannot_be_written(tmp_path, redirection, says):
    done = shell(redirection, tmp_path / "a.npz")
    assert done.returncode == 1
    assert says in done.stderr
    assert COMPLETE in done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr
    assert (tmp_path / "a.npz").read_text() == "motion"


def test_a_report_that_nobody_reads(tmp_path):
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-c", MOTION, "capture", "-o", str(tmp_path / "a.npz"), "--json"]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert done.returncode == 1
    assert "cannot be written to standard output (Broken pipe); all results are complete" in done.stderr
    assert "Exception" not in done.stderr


@pytest.mark.parametrize("redirection", ["COMMAND 2>&-", "COMMAND <&- 2>&-", "COMMAND <&-"])
def test_messages_that_cannot_be_written_change_nothing(tmp_path, redirection):
    done = shell(redirection, tmp_path / "a.npz")
    assert (done.returncode, done.stdout) == (0, '{"frames": 3}\n')
    assert (tmp_path / "a.npz").read_text() == "motion"  # and no message


def test_an_error_of_our_own_is_one_sentence(capsys, monkeypatch):
    def fail(_: object) -> None:
        np.linalg.inv(np.zeros((2, 2)))

    monkeypatch.setattr(cli, "run_capture", fail)
    assert cli.main(["capture"]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("scope: an internal error, LinAlgError: Singular matrix; please report it")
    assert err.count("\n") == 1
    monkeypatch.setenv("SCOPE_TRACEBACK", "1")
    with pytest.raises(np.linalg.LinAlgError):
        cli.main(["capture"])
