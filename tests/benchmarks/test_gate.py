# SPDX-License-Identifier: GPL-3.0-or-later
"""The gate lets noise pass and stops what is worse, on made figures; and its record names what it
measures.
"""

import math

import pytest
from scope.benchmarks import gate
from scope.benchmarks.gate import Figure, read, verdict

RECORD = {"error": Figure(70.0, 0.5), "time": Figure(10.0, 2.0)}


@pytest.mark.parametrize(
    ("error", "time", "worse"),
    [
        (70.0, 10.0, []),
        (70.5, 12.0, []),
        (60.0, 5.0, []),
        (70.6, 10.0, ["error"]),
        (69.0, 12.1, ["time"]),
        (math.nan, math.nan, ["error", "time"]),
    ],
)
def test_only_what_is_worse_by_more_than_its_noise_fails(error, time, worse):
    assert verdict(RECORD, {"error": error, "time": time})[1] == worse


@pytest.mark.parametrize(
    ("variables", "status"),
    [
        ({}, 0),
        ({"CI": "1"}, 1),
        ({"CI": "1", "SCOPE_WITHOUT_SHARED": "1"}, 0),
        ({"SCOPE_WITHOUT_SHARED": "1"}, 0),
    ],
)
def test_a_recorded_figure_that_is_not_measured_fails_in_ci(monkeypatch, capsys, variables, status):
    for name in ("CI", "SCOPE_WITHOUT_SHARED"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    ratios = {name: figure.value for name, figure in read().items() if name.startswith("time of")}
    monkeypatch.setattr("sys.argv", ["gate"])
    monkeypatch.setattr(gate, "clips", dict)
    monkeypatch.setattr(gate, "ratios", lambda *_: ratios)
    assert gate.main() == status
    said = capsys.readouterr().out
    assert ("gate: recorded, but not measured: pose2sim flipped, " in said) == bool(status)


def test_a_ratio_of_times_fails_only_if_it_is_worse_in_all_runs(monkeypatch):
    def least(*times):
        runs = iter(times)
        monkeypatch.setattr(gate, "ratios", lambda *_: {"time": next(runs)})
        return gate.unloaded_ratios(None, RECORD), list(runs)

    assert least(11.0, 10.0, 10.0) == ({"time": 11.0}, [10.0, 10.0])
    assert least(30.0, 11.0, 10.0) == ({"time": 11.0}, [10.0])
    assert least(30.0, 14.0, 13.0) == ({"time": 13.0}, [])


def test_an_update_without_the_clips_keeps_the_accuracy(monkeypatch, tmp_path):
    record = tmp_path / "gate.json"
    record.write_text(
        '{"sample flipped": {"value": 0.1, "noise": 0.02}, "time of old": {"value": 9, "noise": 1}}'
    )
    monkeypatch.setattr(gate, "RECORD", record)
    monkeypatch.setattr(gate, "clips", dict)
    monkeypatch.setattr(gate, "ratios", lambda *_: {"time of a step": 2.0})
    gate.update(None)
    found = read(record)
    assert list(found) == ["sample flipped", "time of a step"]
    assert found["sample flipped"] == Figure(0.1, 0.02)
