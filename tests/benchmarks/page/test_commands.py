# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands of the page are scripts of the repository, and what running them gave is kept as it
is.
"""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from scope.benchmarks.page import commands
from scope.benchmarks.page.commands import (
    SCRIPTS,
    Command,
    Outcome,
    run,
    run_capture,
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
