# SPDX-License-Identifier: GPL-3.0-or-later
"""A run of the report is read as it was written, and anything else is refused in one sentence."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scope.benchmarks.page.commands import Command, Outcome
from scope.benchmarks.page.recorded import FILE, Run, read_run, write_run
from scope.solver.errors import InputError


def test_a_run_is_read_as_it_was_written(tmp_path):
    gate = Outcome(Command("Gate", "gate", ()), "| a |", "", {"pa_mpjpe": 48.1}, 2.5, 1, 4.5, 3.25)
    clip = Outcome(
        Command("a b.mp4", "capture", ("a b.mp4", "--json")), "", "said", {"frames": 3}, 1.0, 0
    )
    run = Run(
        [("a b", Path("a b.mp4"), clip)],
        [gate],
        "2026-01-02 03:04",
        {"Machine": "two cores"},
        quick=True,
    )
    write_run(tmp_path, run)
    assert read_run(tmp_path) == run
    assert run.everything == [clip, gate]


def test_a_run_from_before_costs_were_measured_is_read(tmp_path):
    gate = Outcome(Command("Gate", "gate", ()), "", "", {}, 2.5, 0)
    write_run(tmp_path, Run([], [gate], "", {}, quick=True))
    content = json.loads((tmp_path / FILE).read_text())
    for key in ("processor_seconds", "load"):
        del content["measured"][0][key]
    (tmp_path / FILE).write_text(json.dumps(content))
    assert read_run(tmp_path).measured == [gate]


def test_what_is_no_run_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"holds no run of \./scripts/report: No such file"):
        read_run(tmp_path)
    (tmp_path / FILE).write_text("{")
    with pytest.raises(InputError, match="is no JSON"):
        read_run(tmp_path)
    for content in (
        [],
        {"captured": []},
        {"captured": [{}], "measured": [], "time": "", "facts": {}},
    ):
        (tmp_path / FILE).write_text(json.dumps(content))
        with pytest.raises(InputError, match="is not of this version"):
            read_run(tmp_path)
