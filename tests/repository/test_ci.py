# SPDX-License-Identifier: GPL-3.0-or-later
"""The hosted CI runs what `.ci/run` runs."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PREPARES = {"./scripts/setup", "./scripts/debian"}  # which the others call where they need it


def scripts(text: str) -> set[str]:
    return set(re.findall(r"^(?:\s*command: )?(\./scripts/\w+)", text, re.MULTILINE))


def test_every_script_of_the_local_run_is_in_the_hosted_one() -> None:
    local = scripts((ROOT / ".ci" / "run").read_text("utf-8"))
    assert {"./scripts/check", "./scripts/test", "./scripts/gate", "./scripts/fuzz"} <= local
    assert local - PREPARES == scripts((ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8"))


def test_all_that_is_run_exists() -> None:
    assert [name for name in scripts((ROOT / ".ci" / "run").read_text("utf-8")) if not (ROOT / name).is_file()] == []


# Sitecustomize of a Python without Blender's module.
WITHOUT_BLENDER = """
from importlib.machinery import PathFinder
found = PathFinder.find_spec
PathFinder.find_spec = classmethod(
    lambda cls, name, *where: None if name in ("bpy", "mathutils") else found(name, *where)
)
"""


def test_what_runs_without_blender_can_be_collected_without_it(tmp_path: Path) -> None:
    """On Windows and macOS; a test file that imports Blender's module would keep all the others from running."""
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8")
    (arguments,) = re.findall(r"python -m pytest --numprocesses auto --dist loadfile\n((?: +--ignore.*\n)+)", workflow)
    (tmp_path / "sitecustomize.py").write_text(WITHOUT_BLENDER)
    environment = dict(os.environ, PYTHONPATH=str(tmp_path), CI="1")
    command = [sys.executable, "-m", "pytest", "--collect-only", *shlex.split(arguments)]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:]
