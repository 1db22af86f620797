# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands of the page are scripts of the repository, and what running them gave is kept as it
is.
"""

from __future__ import annotations

import json
import os
import shlex
from pathlib import Path

import numpy as np
import pytest
from scope.benchmarks.__main__ import ELSEWHERE
from scope.benchmarks.page import commands
from scope.benchmarks.page.commands import (
    SCRIPTS,
    Command,
    Outcome,
    motion_files,
    run,
    run_capture,
    timed,
    worst_clips,
)

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("quick", [True, False])
def test_every_command_is_a_script(quick):
    for command in commands.commands(quick):
        assert (ROOT / "scripts" / command.script).is_file()
        assert f"-m {SCRIPTS[command.script]}" in (ROOT / "scripts" / command.script).read_text(
            "utf-8"
        )
        assert ("--quick" in command.arguments) == (quick and command.script == "bench")


def test_a_full_run_measures_every_benchmark_but_those_of_blender_live_and_many_machines():
    run = {
        command.arguments[0]
        for command in commands.commands(quick=False)
        if command.script == "bench"
    }
    assert {"solver", *ELSEWHERE} - run == {"choices", "blender", "live", "cluster"}
    assert run <= {"solver", *ELSEWHERE}


def test_figures_are_those_of_this_run_alone(tmp_path, monkeypatch):
    (tmp_path / "gate.json").write_text('{"old": 1}')
    (tmp_path / "a.npz").write_text("old")
    done = {"status": 1, "json": None}

    def fake(command, arguments):
        if done["json"]:
            Path(arguments[arguments.index("--json") + 1]).write_text(json.dumps(done["json"]))
        return Outcome(command, "printed", "said", {}, 1.0, done["status"])

    monkeypatch.setattr(commands, "timed", fake)
    failed = run(Command("Gate", "gate", ()), tmp_path, lambda text: None)
    assert (failed.figures, failed.status, failed.printed, failed.said) == (
        {},
        1,
        "printed",
        "said",
    )
    done |= {"status": 0, "json": {"new": 2}}
    assert run(Command("Gate", "gate", ()), tmp_path, lambda text: None).figures == {"new": 2}
    done |= {"status": 3, "json": None}
    said = []
    outcome = run_capture(Path("a b.mp4"), tmp_path / "a.npz", said.append)
    assert (outcome.status, outcome.figures) == (3, {})
    target = shlex.quote(str(tmp_path / "a.npz"))
    assert said == [f"running ./scripts/capture 'a b.mp4' -o {target} --people all --json --quiet"]
    assert not (tmp_path / "a.npz").exists()


def test_a_command_costs_the_processor_time_of_the_processes_that_it_starts_too(monkeypatch):
    """The inner process computes for half a second of processor time; the outer one sleeps for a
    while, then ends.
    """
    monkeypatch.setattr(commands, "LOAD_EVERY_S", 0.1)
    spin = "import time\nwhile time.process_time() < 0.5: pass"
    code = (
        f"import subprocess, sys, time; subprocess.run([sys.executable, '-c', {spin!r}]); "
        f"time.sleep(1); "
    )
    code += "print('a'); print('b', file=sys.stderr); sys.exit(3)"
    outcome = timed(Command("Spin", "bench", ()), ["-c", code])
    assert (outcome.printed, outcome.said, outcome.status, outcome.figures) == ("a\n", "b\n", 3, {})
    assert outcome.seconds > 1.5
    if hasattr(os, "getloadavg"):  # not on Windows
        assert 0.5 <= outcome.processor_seconds < outcome.seconds
        assert outcome.load >= 0


def test_everybody_is_captured_where_no_truth_says_who_it_is_about(tmp_path, monkeypatch):
    monkeypatch.setattr(
        commands, "timed", lambda command, arguments: Outcome(command, "", "", {}, 1.0, 3)
    )
    for name in ("truth_cam1.npz", "roll_truth.npz"):
        np.savez(tmp_path / name, joints=np.zeros(3))
    np.savez(tmp_path / "test_00_truth.npz", limbs=np.zeros(3))  # of several people
    for name, everybody in (("cam1", False), ("roll", False), ("walk", True), ("test_00", True)):
        outcome = run_capture(tmp_path / f"{name}.mp4", tmp_path / f"{name}.npz", lambda text: None)
        assert ("--people" in outcome.command.arguments) == everybody


def test_commands_name_files_of_the_checkout_from_its_root(monkeypatch):
    monkeypatch.setattr(
        commands, "timed", lambda command, arguments: Outcome(command, "", "", {}, 1.0, 3)
    )
    data = ROOT.parent / "shared" / "data"
    outcome = run_capture(
        data / "no such clip.mp4", ROOT / "build" / "report" / "no.npz", lambda text: None
    )
    assert outcome.command.arguments[:3] == (
        "../shared/data/no such clip.mp4",
        "-o",
        "build/report/no.npz",
    )


def test_motion_files_are_those_of_everybody_in_their_order(tmp_path):
    for name in (
        "bb.person1.npz",
        "b.personal.npz",
        "c.npz",
        *(f"b.person{n}.npz" for n in range(12, 0, -1)),
    ):
        (tmp_path / name).touch()
    assert [path.name for path in motion_files(tmp_path, "b")] == [
        f"b.person{n}.npz" for n in range(1, 13)
    ]
    assert [path.name for path in motion_files(tmp_path, "c")] == ["c.npz"]


def test_the_worst_rendered_clips_are_shown_too(tmp_path, monkeypatch):
    monkeypatch.setattr(commands, "CACHE", tmp_path)
    for name in (
        "renders/roll.mp4",
        "renders/walk.mp4",
        "scenes/test_00.mp4",
        "scenes/test_01.mp4",
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    shots = {
        "walk": {"mpjpe_root": 40.0},
        "roll": {"mpjpe_root": 132.46},
        "lost": {"coverage": 0.0},
    }
    given = {
        "nothing given": shots | {"sample": {"mpjpe_root": 900.0}, "mean": {"mpjpe_root": 950.0}}
    }
    people = [("test_00", float("nan")), ("test_01", 120.0), ("test_00", 60.0)]
    rows = [
        {"clip": clip, "mpjpe_root": error, "found": float(error > 0)} for clip, error in people
    ]
    outcomes = [
        Outcome(
            Command("Renders", "bench", ("renders",)), "", "", {"fast": {}, "best": given}, 1.0, 0
        ),
        Outcome(
            Command("Scenes", "bench", ("scenes",)),
            "",
            "",
            {"test": {"people": {"default preset": rows}}},
            1.0,
            0,
        ),
        Outcome(Command("Scenes", "bench", ("scenes",)), "", "", {}, 1.0, 1),
    ]
    found = worst_clips(outcomes)
    assert [(name, path.parent.name) for name, path, _ in found] == [
        ("roll", "renders"),
        ("walk", "renders"),
        ("test_01", "scenes"),
        ("test_00", "scenes"),
    ]
    assert "132.5 mm" in found[0][2]
    assert found[2][2] == "The worst person of the test scenes: MPJPE-root is 120.0 mm."
    assert "not found" in found[3][2]


def test_a_scene_that_is_shown_for_two_reasons_gives_both(tmp_path, monkeypatch):
    monkeypatch.setattr(commands, "CACHE", tmp_path)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "test_00.mp4").touch()
    rows = [
        {"clip": "test_00", "mpjpe_root": error, "found": float(error > 0)}
        for error in (120.0, float("nan"))
    ]
    figures = {"test": {"people": {"default preset": rows}}}
    ((name, _, why),) = worst_clips(
        [Outcome(Command("Scenes", "bench", ("scenes",)), "", "", figures, 1.0, 0)]
    )
    assert name == "test_00"
    assert "MPJPE-root is 120.0 mm. A person" in why
    assert "not found" in why
