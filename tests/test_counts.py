# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers with their noun."""

import pytest
from scope.scope_addon.command_line.live_command import _summary
from scope.scope_addon.counts import counted


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((0, "frame"), "0 frames"),
        ((1, "frame"), "1 frame"),
        ((2, "frame"), "2 frames"),
        ((3, "person", "people"), "3 people"),
    ],
)
def test_one_is_in_the_singular(arguments, text):
    assert counted(*arguments) == text


def test_a_live_capture_of_one_frame_is_summed_up_in_the_singular():
    latency = {"median": 40.0, "p95": 60.0}
    report = {
        "poses": 1,
        "poses_per_second": 30.0,
        "latency_ms": latency,
        "dropped": 0,
        "damaged": 0,
        "frames": 1,
        "outputs": [],
    }
    assert _summary(report).startswith("1 pose, 30/s")
    assert _summary(report).endswith("0 of 1 frame dropped")
