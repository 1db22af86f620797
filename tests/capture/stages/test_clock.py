# SPDX-License-Identifier: GPL-3.0-or-later
"""Seconds of stages by a clock that the test turns."""

from __future__ import annotations

import pytest
from scope.scope_addon.capture.stages.clock import StageClock


def test_stages_add_up_also_when_they_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("scope.scope_addon.capture.stages.clock.time.perf_counter", lambda: now[0])
    found = StageClock()
    for name, seconds in (("decode", 1.0), ("solver", 2.0), ("decode", 0.5)):
        with found.stage(name):
            now[0] += seconds
        now[0] += 40.0  # between them

    def fail() -> None:
        with found.stage("solver"):
            now[0] += 0.5
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert found.seconds == {"decode": 1.5, "solver": 2.5}
    assert found.rates(30) == {"decode": 20.0, "solver": 12.0, "total": 7.5}


def test_a_stage_that_took_no_time_has_a_rate() -> None:
    found = StageClock()
    found.seconds["decode"] = 0.0
    assert found.rates(3)["decode"] > 1e6
