# SPDX-License-Identifier: GPL-3.0-or-later
"""The scripts that make environments take the Python that they are told, or else the first one that
runs: one of pyenv's names may stand for a version that is not installed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(os.name == "nt", reason="they are scripts for bash")

# In place of Python: makes environments with itself, and does in no time what it is asked.
PYTHON = """#!/bin/sh
case "$*" in
    *version_info*) echo VERSION ;;
    "-m venv "*) mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
esac
exit STATUS
"""
NAMES = ("python3.11", "python3.13", "python3", "python")


def make_python(path: Path, version: str, status: int = 0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(PYTHON.replace("VERSION", version).replace("STATUS", str(status)))
    path.chmod(0o755)


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """A copy of what the scripts need; no Python in PATH but one that cannot run."""
    for name in ("3.11.txt", "3.13.txt", "site.txt"):
        target = tmp_path / "scripts" / "requirements" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "scripts" / "requirements" / name, target)
    for name in ("setup", "solver_environment", "site"):
        shutil.copy(ROOT / "scripts" / name, tmp_path / "scripts" / name)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    for name in NAMES:
        make_python(tmp_path / "bin" / name, "", 127)
    return tmp_path


def run(program: Path, script: str, python: str = "") -> subprocess.CompletedProcess[str]:
    path = f"{program / 'bin'}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "PYTHON": python}
    command = [str(program / "scripts" / script)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("script", "made"),
    [("solver_environment", "solver_environment"), ("site", "site_environment")],
)
def test_a_python_that_does_not_run_is_passed_over(program: Path, script: str, made: str) -> None:
    make_python(program / "bin" / "python3.13", "3.13")
    done = run(program, script)
    assert done.returncode == 0, done.stderr
    assert "3.13" in (program / "build" / made / "bin" / "python").read_text()


@pytest.mark.parametrize("script", ["setup", "solver_environment", "site"])
def test_a_python_that_is_named_is_taken_though_its_path_has_spaces(
    program: Path, script: str
) -> None:
    named = program / "with a space" / "python"
    make_python(named, "3.11")
    done = run(program, script, str(named))
    made = {"setup": ".venv", "site": "build/site_environment"}
    environment = program / made.get(script, "build/solver_environment")
    assert (environment / "bin" / "python").read_text() == named.read_text(), done.stderr


@pytest.mark.parametrize(
    ("script", "version", "status"),
    [("setup", "3.9", 0), ("solver_environment", "3.9", 0), ("site", "3.11", 1)],
)
def test_no_other_python_is_taken_for_one_that_cannot_be_used(
    program: Path, script: str, version: str, status: int
) -> None:
    make_python(program / "bin" / "python3.11", "3.11")
    named = program / "named"
    make_python(named, version, status)
    done = run(program, script, str(named))
    assert done.returncode == 1
    assert "scope: " in done.stderr
    assert str(named) in done.stderr
    assert not list(program.glob("**/bin/activate"))
    assert not (program / ".venv" / "bin").exists()
    assert not (program / "build").exists()


@pytest.mark.parametrize(("version", "status"), [("3.13", 0), ("", 127)])
def test_an_environment_of_another_python_than_the_named_one_is_said_and_kept(
    program: Path, version: str, status: int
) -> None:
    (program / "solver").mkdir()
    (program / "assets" / "networks").mkdir(parents=True)
    (program / "assets" / "networks" / "built.json").touch()
    first = program / "first"
    make_python(first, "3.11")
    assert run(program, "setup", str(first)).returncode == 0
    named = program / "named"
    make_python(named, version, status)
    done = run(program, "setup", str(named))
    assert done.returncode == 1
    assert f".venv has Python 3.11, and PYTHON={named} is another one" in done.stderr
    assert (program / ".venv" / "bin" / "python").read_text() == first.read_text()
    # Another path of the same version, and none at all, go on as before.
    make_python(named, "3.11")
    for python in (str(named), ""):
        done = run(program, "setup", python)
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("script", ["solver_environment", "site"])
def test_an_environment_of_another_python_than_the_named_one_is_made_anew(
    program: Path, script: str
) -> None:
    made = program / "build" / f"{script.removesuffix('_environment')}_environment" / "bin/python"
    first = program / "first"
    make_python(first, "3.11")
    assert run(program, script, str(first)).returncode == 0
    # One that cannot be used changes nothing, and is said.
    named = program / "named"
    make_python(named, "", 127)
    done = run(program, script, str(named))
    assert done.returncode == 1
    assert str(named) in done.stderr
    assert made.read_text() == first.read_text()
    # Another path of the same version, and none at all, go on as before.
    make_python(named, "3.11")
    named.write_text(named.read_text() + "# at another path\n")
    for python in (str(named), ""):
        done = run(program, script, python)
        assert (done.returncode, done.stderr) == (0, "")
        assert made.read_text() == first.read_text()
    make_python(named, "3.13")
    assert run(program, script, str(named)).returncode == 0
    assert made.read_text() == named.read_text()
