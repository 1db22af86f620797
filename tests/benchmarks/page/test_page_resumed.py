# SPDX-License-Identifier: GPL-3.0-or-later
"""A run that was interrupted is kept as far as it came, and goes on from there."""

from __future__ import annotations

from pathlib import Path

import pytest
from scope.benchmarks.page import __main__ as module
from scope.benchmarks.page.commands import Command, Outcome
from scope.benchmarks.page.recorded import read_run

CLIPS = [("sample", Path("sample.mp4")), ("b", Path("b.mp4"))]
COMMANDS = [
    Command("Gate", "gate", ()),
    Command("Solver", "bench", ("solver",)),
    Command("Faces", "bench", ("faces",)),
]


@pytest.fixture
def done(tmp_path, monkeypatch):
    """The names of the commands that ran, of which the second benchmark is interrupted once."""
    found: list[str] = []

    def capture(video, target, say):
        found.append(video.stem)
        return Outcome(Command(video.name, "capture", (str(video),)), "", "", {}, 60.0, 0)

    def measure(command, folder, say):
        found.append(command.title)
        if command.title == "Solver" and found.count("Solver") == 1:
            raise KeyboardInterrupt
        return Outcome(command, "printed", "", {}, 90.0, 0)

    for name, value in {
        **{
            "FOLDER": tmp_path,
            "clips": lambda quick: CLIPS,
            "commands": lambda quick: COMMANDS,
            "run": measure,
        },
        **{"run_capture": capture, "revision": lambda: "abc"},
    }.items():
        monkeypatch.setattr(module, name, value)
    return found


def test_what_was_measured_is_not_measured_again(done, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(module.sys, "argv", ["report", str(tmp_path / "out.html")])
    assert module.main() == 130
    assert "interrupted; --resume goes on" in capsys.readouterr().err
    assert [outcome.command.title for outcome in read_run(tmp_path).measured] == ["Gate"]
    monkeypatch.setattr(module, "revision", lambda: "def")
    run = module.measure(False, resume=True)
    assert done == ["sample", "b", "Gate", "Solver", "Solver", "Faces"]
    assert run == read_run(tmp_path)
    assert [each[0] for each in run.captured] == ["sample", "b"]
    assert [outcome.command for outcome in run.measured] == COMMANDS
    assert (run.facts["Revision"], run.facts["Resumed by revision"]) == ("abc", "def")
    for revision in ("def", "abc", "ghi"):
        monkeypatch.setattr(module, "revision", lambda revision=revision: revision)
        run = module.measure(False, resume=True)
    assert run.facts["Resumed by revision"] == "def, ghi"
