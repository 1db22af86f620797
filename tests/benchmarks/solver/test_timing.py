# SPDX-License-Identifier: GPL-3.0-or-later
"""Times are of work, not of waiting for a core."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from scope.benchmarks.solver import timing


@pytest.mark.parametrize(("resolution", "expected"), [(1e-9, 3.0), (1e-2, 1003.0)])
def test_waiting_does_not_count_where_the_system_tells_it_from_work(
    monkeypatch, resolution, expected
):
    now = {"work": 0.0, "wait": 0.0}

    def run(n):
        now["work"] += 3e-6 * n
        now["wait"] += 1e-3 * n  # other programs have the core

    monkeypatch.setattr(
        timing,
        "time",
        SimpleNamespace(
            thread_time=lambda: now["work"],
            perf_counter=lambda: now["work"] + now["wait"],
            get_clock_info=lambda name: SimpleNamespace(resolution=resolution),
        ),
    )
    assert timing.take_turns({"a": run}, {"a": 5}, 3) == pytest.approx({"a": expected})
