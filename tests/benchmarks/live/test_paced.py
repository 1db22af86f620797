# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulated machine processes as many frames as its costs allow, and the same ones every time."""

import pytest
from scope.benchmarks.live.paced import Costs, EveryFrame, simulated
from scope.scope_addon.cli import SAMPLE

FRAME_S = 1 / 30  # of the sample clip
COSTS = Costs(
    frame_s=0.3,
    spread=0.0,
    largest_s=0.0,
    reference_s=0.0,
    estimate_s=0.0,
    first_estimate_s=0.0,
    shared=1.0,
)


def test_poses_and_latency_follow_from_the_costs(body, networks):
    recording, told = simulated(body, SAMPLE, "fast", EveryFrame, COSTS)
    assert told["poses_per_second"] == pytest.approx(10 / 3, abs=0.15)
    assert 300.0 <= told["latency_ms"]["median"] <= 1000 * (0.3 + FRAME_S)
    assert told["dropped"] == pytest.approx(8 * told["poses"], abs=9)
    again, told_again = simulated(body, SAMPLE, "fast", EveryFrame, COSTS)
    assert told_again == told
    assert again.timestamps.tolist() == recording.timestamps.tolist()
