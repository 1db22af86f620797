# SPDX-License-Identifier: GPL-3.0-or-later
"""Setting up says what it does in a few lines, and what installers say only if they fail."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import scope

ROOT = Path(scope.__file__).resolve().parent
# An interpreter whose every command is noisy, as pip, apt and the converter of the networks are.
PYTHON = """#!/bin/sh
case "$*" in
    *version_info*) echo 3.11 ;;
    *-c\\ *) ;;
    *) echo "WARNING: a warning of an installer" >&2; echo "on its way"
       case "$*" in *"$FAILS"*) echo "it failed for this reason" >&2; exit 1 ;; esac ;;
esac
"""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the script is for bash")


@pytest.fixture
def checkout(tmp_path):
    (tmp_path / "scripts" / "requirements").mkdir(parents=True)
    shutil.copy(ROOT / "scripts" / "setup", tmp_path / "scripts")
    (tmp_path / "scripts" / "requirements" / "3.11.txt").touch()
    (tmp_path / "pyproject.toml").touch()
    (tmp_path / "solver").mkdir()
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(PYTHON)
    python.chmod(0o755)
    return tmp_path


def set_up(checkout, fails):
    command = ["bash", str(checkout / "scripts" / "setup")]
    environment = dict(os.environ, FAILS=fails)
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def test_what_installers_say_is_kept_in_a_file(checkout):
    done = set_up(checkout, fails="nothing")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 3
    assert "WARNING" not in done.stderr
    assert "a warning of an installer" in (checkout / ".venv" / "setup.log").read_text()
    assert set_up(checkout, fails="nothing").stderr.splitlines() == ["Building the pose networks."]


@pytest.mark.parametrize("fails", ["--require-hashes", "--editable", "convert_networks"])
def test_it_is_shown_where_one_fails(checkout, fails):
    done = set_up(checkout, fails)
    assert done.returncode == 1
    *_, reason, ours = done.stderr.splitlines()
    assert reason == "it failed for this reason"
    assert ours.startswith("scope: ")
