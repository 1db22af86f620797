# SPDX-License-Identifier: GPL-3.0-or-later
"""What the paper states stands beside what was measured, and its time lies where it is on the
plot's axis.
"""

from __future__ import annotations

import math
import re

import pytest
from scope.benchmarks.page.paper import convergence_plot, stated_table

# the sparse step grows with the square root of N and not with K, the dense one with N and with K
# squared
ROWS = [
    {"K": K, "N": N, "P": 10, "sparse": math.sqrt(N), "dense": float(N * K**2)}
    for K in (23, 51)
    for N in (120, 240, 480)
]
CONVERGENCE = [
    {"kind": kind, "tolerance": tolerance, "triggs": triggs, "milliseconds": ms * (1 + 9 * triggs)}
    for kind, ms in (("cold", 0.4), ("warm", 0.1))
    for tolerance in (1e-4, 1e-6)
    for triggs in (0.0, 0.9)
]


def test_exponents_and_times_are_those_that_were_measured():
    shown = stated_table({"experiments": {"1": ROWS}, "convergence": CONVERGENCE})
    rows = [
        re.findall(r"<t[hd][^>]*>([^<]*)</t", row) for row in re.findall(r"<tr>(.*?)</tr>", shown)
    ][1:]
    assert [row[1:] for row in rows] == [
        ["4 on average", "0.40 cold, 0.10 warm (medians)"],
        ["1", "0.50 and 0.50 (23 and 51 joints)"],
        ["1", "0.00"],
        ["3", "2.00"],
    ]


def test_without_real_frames_only_the_exponents_are_there():
    shown = stated_table({"experiments": {"1": ROWS}, "convergence": []})
    assert "to convergence" not in shown
    assert "exponent" in shown
    assert (stated_table({}), convergence_plot({"convergence": []})) == ("", "")
    assert stated_table({"experiments": {"3": ROWS}}) == ""


def test_the_papers_time_is_a_line_above_ours():
    shown = convergence_plot({"convergence": CONVERGENCE})
    assert "4 ms: the paper" in shown
    low = math.log(0.1 / 1.3)
    high = math.log(4 * 1.3)
    heights = {
        name: [float(y) for y in re.findall(r"[ML][\d.]+ ([\d.]+)", path)]
        for path, name in re.findall(r'class="curve" d="([^"]*)"[^>]*><title>(\w+)', shown)
    }
    for name, ms in (("cold", 0.4), ("warm", 0.1), ("4", 4.0)):
        assert heights[name] == pytest.approx(
            [100 * (1 - (math.log(ms) - low) / (high - low))] * 2, abs=0.01
        ), name
