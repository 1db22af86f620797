# SPDX-License-Identifier: GPL-3.0-or-later
"""`./scripts/setup` that a full disk or a kill interrupts says so in one sentence, and makes anew
what may be half installed when it is run again.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(os.name == "nt", reason="it is a script for bash")

# In place of Python: makes environments with itself, and does what setup asks of one in no time.
# The n-th installation of a package fails as $FAILING says.
PYTHON = """#!/bin/sh
case "$*" in
    *version_info*) echo 3.11 ;;
    "-m venv .venv")
        mkdir -p .venv/bin && cp "$0" .venv/bin/python
        if [ "$FAILING" = venv ]; then echo 'Errno 28: No space left on device' >&2; exit 1; fi ;;
    *"pip"*install*)
        echo "$@" >>installed
        if [ "$FAILING" = full ]; then
            echo half >.venv/half
            echo 'ERROR: [Errno 28] No space left on device' >&2
            exit 1
        fi
        if [ "$FAILING" = kill ]; then echo half >.venv/half; kill -9 $PPID; fi
        if [ "$FAILING" = connection ]; then echo 'ERROR: no route' >&2; exit 1; fi ;;
    *convert_networks*) mkdir -p assets/networks && touch assets/networks/built.json ;;
esac
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """A copy of what setup needs."""
    for name in ("scripts/setup", "scripts/requirements/3.11.txt", "pyproject.toml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    (tmp_path / "solver").mkdir()
    python = tmp_path / "python3.11"
    python.write_text(PYTHON)
    python.chmod(0o755)
    return tmp_path


def set_up(program: Path, failing: str = "") -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHON": str(program / "python3.11"), "FAILING": failing}
    environment.pop("SCOPE_BPY", None)
    command = [str(program / "scripts" / "setup")]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def assert_is_repaired(program: Path) -> None:
    done = set_up(program)
    assert done.returncode == 0, done.stderr
    assert not (program / ".venv" / "half").exists()
    done = set_up(program)
    assert done.returncode == 0
    assert done.stderr == ""


@pytest.mark.parametrize("failing", ["venv", "full"])
def test_a_full_disk_is_named_and_the_next_run_begins_again(program: Path, failing: str) -> None:
    done = set_up(program, failing)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("scope: the disk of ")
    assert "free some space and run this again" in last
    assert_is_repaired(program)


def test_a_killed_installation_begins_again(program: Path) -> None:
    assert set_up(program, "kill").returncode == -9
    assert (program / ".venv" / "half").exists()
    assert_is_repaired(program)


def test_what_is_brought_up_to_date_and_killed_begins_again(program: Path) -> None:
    assert set_up(program).returncode == 0
    with (program / "pyproject.toml").open("a") as file:
        file.write("# another version\n")
    assert set_up(program, "kill").returncode == -9
    assert_is_repaired(program)


def test_another_failure_is_not_called_a_full_disk(program: Path) -> None:
    last = set_up(program, "connection").stderr.splitlines()[-1]
    if shutil.disk_usage(program).free > 200 << 20:
        assert "look above for the one that failed and at your connection" in last
