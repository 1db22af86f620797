# SPDX-License-Identifier: GPL-3.0-or-later
"""The hosted CI runs what `.ci/run` runs."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ..required import package

ROOT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
RELEASE = ROOT / ".github" / "workflows" / "release.yml"
PREPARES = {"./scripts/setup", "./scripts/debian"}  # which the others call where they need it


def scripts(text: str) -> set[str]:
    return set(re.findall(r"^(?:\s*command: )?(\./scripts/\w+)", text, re.MULTILINE))


def test_every_script_of_the_local_run_is_in_the_hosted_one() -> None:
    local = scripts((ROOT / ".ci" / "run").read_text("utf-8"))
    assert {"./scripts/check", "./scripts/test", "./scripts/gate", "./scripts/fuzz"} <= local
    assert local - PREPARES == scripts(
        (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8")
    )


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_actions_of_others_are_pinned_by_hash(workflow: Path) -> None:
    """A tag can be moved to other code."""
    used = re.findall(r"uses: (\S+)", workflow.read_text("utf-8"))
    assert len(used) >= 3
    assert [
        action for action in used if not re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", action)
    ] == []


def jobs_of(workflow: Path) -> dict[str, dict[str, Any]]:
    return package("yaml").safe_load(workflow.read_text("utf-8"))["jobs"]


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_no_job_leaves_the_token_in_the_checkout(workflow: Path) -> None:
    """Actions of others, tests and packages run in it, and nothing is pushed."""
    jobs = {name: job for name, job in jobs_of(workflow).items() if name != "draft"}
    steps = [step for job in jobs.values() for step in job["steps"]]
    checkouts = [
        step["with"] for step in steps if step.get("uses", "").startswith("actions/checkout@")
    ]
    assert len(checkouts) == len(jobs) > 1
    assert [
        settings for settings in checkouts if settings.get("persist-credentials") is not False
    ] == []


def test_only_the_draft_of_a_release_may_write() -> None:
    """It checks out nothing and runs nothing of the repository's."""
    jobs = jobs_of(RELEASE)
    assert [name for name, job in jobs.items() if "permissions" in job] == ["draft"]
    assert not any("checkout" in step.get("uses", "") for step in jobs["draft"]["steps"])


def test_a_release_is_made_by_the_script_of_every_maintainer() -> None:
    commands = [step.get("run", "") for step in jobs_of(RELEASE)["build"]["steps"]]
    (release,) = [command for command in commands if command.startswith("./scripts/release ")]
    options = set(re.findall(r"--[a-z-]+", release))
    assert options <= set(re.findall(r"--[a-z-]+", (ROOT / "scripts/release").read_text("utf-8")))
    assert "--dry-run" not in options


@pytest.mark.skipif(os.name == "nt", reason="the first bash there may be that of another Linux")
def test_every_step_is_a_script_that_bash_can_read() -> None:
    """With the values of the matrix filled in."""
    checked = 0
    for job in [job for workflow in WORKFLOWS for job in jobs_of(workflow).values()]:
        for entry in job.get("strategy", {}).get("matrix", {}).get("include", [{}]):
            for step in job["steps"]:
                script = step.get("run", "")
                for name, value in entry.items():
                    script = script.replace(f"${{{{ matrix.{name} }}}}", value)
                assert "${{" not in script
                done = subprocess.run(
                    ["bash", "-n"], input=script, capture_output=True, text=True, check=False
                )
                assert done.returncode == 0, done.stderr
                checked += bool(script)
    assert checked > 15


# Sitecustomize of a Python without Blender's module.
WITHOUT_BLENDER = """
from importlib.machinery import PathFinder
found = PathFinder.find_spec
PathFinder.find_spec = classmethod(
    lambda cls, name, *where: None if name in ("bpy", "mathutils") else found(name, *where)
)
"""


@pytest.mark.slow
def test_what_runs_without_blender_can_be_collected_without_it(tmp_path: Path) -> None:
    """On Windows and macOS; a test file that imports Blender's module would keep all the others
    from running.
    """
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8")
    (arguments,) = re.findall(
        r"python -m pytest --numprocesses auto --dist loadfile\n((?: "
        r"+--ignore.*\n)+)",
        workflow,
    )
    (tmp_path / "sitecustomize.py").write_text(WITHOUT_BLENDER)
    environment = dict(os.environ, PYTHONPATH=str(tmp_path), CI="1")
    command = [sys.executable, "-m", "pytest", "--collect-only", *shlex.split(arguments)]
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-3000:]
