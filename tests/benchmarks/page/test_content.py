# SPDX-License-Identifier: GPL-3.0-or-later
"""What benchmarks print becomes tables and text of the page, and figures become plots."""

from __future__ import annotations

import math
import re

import pytest
from scope.benchmarks import report
from scope.benchmarks.page.commands import Command, Outcome
from scope.benchmarks.page.content import experiment_plots, outcome_section, printed_parts


def cells(markup: str) -> list[list[str]]:
    return [re.findall(r"<t[hd][^>]*>([^<]*)</t", row) for row in re.findall(r"<tr>(.*?)</tr>", markup)]


def test_tables_are_found_among_other_text():
    printed = "Frames per second <1080p>\n\n" + report.table(("clip", "mm"), [("a & b", 12.34), ("c", None)]) + "\nend"
    words, table, end = printed_parts(printed)
    assert words == "<p>Frames per second &lt;1080p&gt;</p>\n"
    assert end == "<p>end</p>\n"
    assert printed_parts("| one line |") == ["<p>| one line |</p>\n"]
    assert cells(table) == [["clip", "mm"], ["a &amp; b", "12.3"], ["c", ""]]


def test_experiments_are_plotted_where_their_values_are():
    rows = [
        {"K": K, "N": N, "sparse": 10.0, "dense": 10.0 * factor}
        for K, factor in ((23, 10), (51, 100))
        for N in (120, 600)
    ]
    times, speedups = experiment_plots("1", rows)
    assert "SMPL+H, dense" in times
    found = [float(y) for y in re.findall(r'class="curve" d="M0\.0 ([\d.]+)L1000\.0', speedups)]
    share = math.log(1.3) / math.log(100 * 1.3**2 / 10)  # the axis goes from 10 / 1.3 to 100 * 1.3
    assert found == pytest.approx([100 * (1 - share), 100 * share], abs=0.01)
    assert 'class="cursor"' not in times


def test_keys_of_the_evaluation_get_their_headings():
    (table,) = printed_parts(report.table(("figure", "now"), [("sample pa_mpjpe", 48.1)]))
    assert cells(table)[1] == ["sample PA-MPJPE mm", "48.1"]


def test_a_command_that_failed_says_so():
    outcome = Outcome(Command("Speed", "bench", ("solver", "--quick")), "", "first\nno <clips>", {}, 3.2, 1)
    section = outcome_section(outcome)
    assert "./scripts/bench solver --quick" in section
    assert "It took 3 s; it ended with status 1." in section
    assert "<p>no &lt;clips&gt;</p>" in section
