# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands of the page are scripts of the repository, and what running them gave is kept as it is."""

from __future__ import annotations

import json
import shlex
import subprocess
from pathlib import Path

import pytest
from scope.benchmarks.__main__ import ELSEWHERE
from scope.benchmarks.page import commands
from scope.benchmarks.page.commands import SCRIPTS, Command, motion_files, run, run_capture

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("quick", [True, False])
def test_every_command_is_a_script(quick):
    for command in commands.commands(quick):
        assert (ROOT / "scripts" / command.script).is_file()
        assert f"-m {SCRIPTS[command.script]}" in (ROOT / "scripts" / command.script).read_text("utf-8")
        assert ("--quick" in command.arguments) == (quick and command.script == "bench")


def test_a_full_run_measures_every_benchmark_but_those_of_blender_live_and_many_machines():
    run = {command.arguments[0] for command in commands.commands(quick=False) if command.script == "bench"}
    assert {"solver", *ELSEWHERE} - run == {"choices", "blender", "live", "cluster"}
    assert run <= {"solver", *ELSEWHERE}


def test_figures_are_those_of_this_run_alone(tmp_path, monkeypatch):
    (tmp_path / "gate.json").write_text('{"old": 1}')
    (tmp_path / "a.npz").write_text("old")
    done = {"status": 1, "json": None}

    def fake(arguments, **_):
        if done["json"]:
            Path(arguments[arguments.index("--json") + 1]).write_text(json.dumps(done["json"]))
        return subprocess.CompletedProcess(arguments, done["status"], "printed", "said")

    monkeypatch.setattr(commands.subprocess, "run", fake)
    failed = run(Command("Gate", "gate", ()), tmp_path, lambda text: None)
    assert (failed.figures, failed.status, failed.printed, failed.said) == ({}, 1, "printed", "said")
    done |= {"status": 0, "json": {"new": 2}}
    assert run(Command("Gate", "gate", ()), tmp_path, lambda text: None).figures == {"new": 2}
    done |= {"status": 3, "json": None}
    said = []
    outcome = run_capture(Path("a b.mp4"), tmp_path / "a.npz", said.append)
    assert (outcome.status, outcome.figures) == (3, {})
    target = shlex.quote(str(tmp_path / "a.npz"))
    assert said == [f"running ./scripts/capture 'a b.mp4' -o {target} --people all --json --quiet"]
    assert not (tmp_path / "a.npz").exists()


def test_everybody_is_captured_where_no_truth_says_who_it_is_about(tmp_path, monkeypatch):
    def fake(arguments, **_):
        return subprocess.CompletedProcess(arguments, 3, "", "")

    monkeypatch.setattr(commands.subprocess, "run", fake)
    for name in ("truth_cam1.npz", "roll_truth.npz"):
        (tmp_path / name).touch()
    for name, everybody in (("cam1", False), ("roll", False), ("walk", True)):
        outcome = run_capture(tmp_path / f"{name}.mp4", tmp_path / f"{name}.npz", lambda text: None)
        assert ("--people" in outcome.command.arguments) == everybody
    for name in ("b.person2.npz", "b.person1.npz", "bb.person1.npz", "c.npz"):
        (tmp_path / name).touch()
    assert [path.name for path in motion_files(tmp_path, "b")] == ["b.person1.npz", "b.person2.npz"]
    assert [path.name for path in motion_files(tmp_path, "c")] == ["c.npz"]
