# SPDX-License-Identifier: GPL-3.0-or-later
"""A run that was interrupted is kept as far as it came, and goes on from there."""

from __future__ import annotations

from pathlib import Path

import pytest
from scope.benchmarks.page import __main__ as module
from scope.benchmarks.page.commands import Command, Outcome
from scope.benchmarks.page.commands import commands as listed
from scope.benchmarks.page.recorded import FILE, PREVIOUS, Run, read_run, write_run
from scope.scope_addon.errors import SetupError
from scope.solver.errors import InputError

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


def test_a_run_goes_on_as_quick_or_whole_as_it_began(done, monkeypatch):
    asked = []
    monkeypatch.setattr(module, "clips", lambda quick: CLIPS[: 1 if quick else 2])
    monkeypatch.setattr(module, "commands", lambda quick: asked.append(quick) or COMMANDS)
    for began in (True, False):
        done.clear()
        with pytest.raises(KeyboardInterrupt):
            module.measure(began)
        run = module.measure(not began, resume=True)
        assert [each[0] for each in run.captured] == (["sample"] if began else ["sample", "b"])
        assert run.quick is began
    assert asked == [True, True, False, False]


@pytest.mark.parametrize("failure", [KeyboardInterrupt, SetupError])
def test_an_earlier_run_is_not_taken_for_one_that_stopped_at_its_first_clip(
    done, tmp_path, monkeypatch, failure
):
    """Whatever of the earlier run is kept, its first clip's motion is gone."""
    earlier = Run(
        [], [Outcome(COMMANDS[0], "hours", "", {}, 9000.0, 0)], "earlier", {}, quick=False
    )
    write_run(tmp_path, earlier)

    def stopped(video, target, say):
        raise failure

    monkeypatch.setattr(module, "run_capture", stopped)
    for _ in range(2):  # the second has nothing to keep, and leaves what the first kept
        with pytest.raises(failure):
            module.measure(False)
        assert not (tmp_path / FILE).exists()
        with pytest.raises(InputError, match="holds no run"):
            module.measure(False, resume=True)
    (tmp_path / PREVIOUS).rename(tmp_path / FILE)
    assert read_run(tmp_path) == earlier


def test_a_run_without_the_motion_of_its_first_clip_has_no_page(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(module, "FOLDER", tmp_path)
    clip = Outcome(Command("sample.mp4", "capture", ("sample.mp4",)), "", "", {}, 60.0, 0)
    for captured in ([("sample", Path("sample.mp4"), clip)], []):
        write_run(tmp_path, Run(captured, [], "", {}, quick=False))
        monkeypatch.setattr(
            module.sys, "argv", ["report", "--recorded", str(tmp_path), str(tmp_path / "out.html")]
        )
        assert module.main() == 1
        assert "no motion of its first clip" in capsys.readouterr().err


def test_all_that_an_unfinished_run_lacks_is_named():
    gate, solver, *long = listed(quick=False)
    quick_solver = listed(quick=True)[1]
    measured = [Outcome(gate, "", "", {}, 1.0, 0)]
    assert module.left_out(Run([], measured, "", {}, quick=False)) == [solver, *long]
    assert module.left_out(Run([], measured, "", {}, quick=True)) == [quick_solver, *long]
    everything = [Outcome(each, "", "", {}, 1.0, 0) for each in (gate, solver, *long)]
    assert module.left_out(Run([], everything, "", {}, quick=False)) == []


def test_the_page_says_what_each_command_costs():
    gate = Outcome(Command("", "gate", ()), "", "", {}, 61.5, 0, 122.9, 3.14)
    solver = Outcome(Command("", "bench", ("solver",)), "", "", {}, 3600.0, 0)
    text = "".join(module.costs([gate, solver]))
    assert "./scripts/gate</th><td>1:01</td><td>2:02</td><td>3.1</td>" in text
    assert "./scripts/bench solver</th><td>60:00</td><td>–</td><td>–</td>" in text
    assert "all</th><td>61:01</td><td>–</td>" in text
    assert "all</th><td>2:03</td><td>4:05</td>" in module.costs([gate, gate])[0]
    assert "all</th><td>60:00</td><td>–</td>" in module.costs([solver])[0]


def test_without_an_earlier_run_there_is_nothing_to_go_on_with(done):
    with pytest.raises(InputError, match="holds no run"):
        module.measure(False, resume=True)
    assert done == []


def test_a_clip_that_could_not_be_captured_says_why(body, tmp_path):
    outcome = Outcome(
        Command("b.mp4", "capture", ("b.mp4",)), "", "first\nnobody <was> found\n", {}, 1.0, 3
    )
    section = module.capture_section(tmp_path, "b", Path("b.mp4"), outcome, body)
    assert "The capture ended with status 3." in section
    assert "nobody &lt;was&gt; found" in section
    assert "./scripts/capture b.mp4" in section
