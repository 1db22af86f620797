# SPDX-License-Identifier: GPL-3.0-or-later
"""What benchmarks print becomes tables and text of the page, and figures become plots."""

from __future__ import annotations

import re
from html import escape

from scope.benchmarks import report
from scope.benchmarks.page.about import ABOUT
from scope.benchmarks.page.commands import Command, Outcome, commands
from scope.benchmarks.page.content import (
    outcome_section,
    printed_parts,
)


def cells(markup: str) -> list[list[str]]:
    return [
        re.findall(r"<t[hd][^>]*>([^<]*)</t", row) for row in re.findall(r"<tr>(.*?)</tr>", markup)
    ]


def test_tables_are_found_among_other_text():
    printed = (
        "Frames per second <1080p>\n\n"
        + report.table(("clip", "mm"), [("a & b", 12.34), ("c", None)])
        + "\nend"
    )
    words, table, end = printed_parts(printed)
    assert words == "<p>Frames per second &lt;1080p&gt;</p>\n"
    assert end == "<p>end</p>\n"
    assert printed_parts("| one line |") == ["<p>| one line |</p>\n"]
    assert cells(table) == [["clip", "mm"], ["a &amp; b", "12.3"], ["c", ""]]


def test_every_command_says_what_its_tables_were_measured_on():
    for command in {*commands(quick=False), *commands(quick=True)}:
        section = outcome_section(Outcome(command, "printed", "", {}, 1.0, 0))
        about = ABOUT[next(iter(command.arguments), command.script)]
        assert f'<p class="note">{escape(about)}</p>' in section, command.text


def test_a_command_that_failed_says_so():
    outcome = Outcome(
        Command("Speed", "bench", ("solver", "--quick")), "", "first\nno <clips>", {}, 3.2, 1
    )
    section = outcome_section(outcome)
    # in one line
    assert '<code>./scripts/bench solver <span class="option">--quick</span></code>' in section
    assert "Elapsed 0:03 min:s, processor time –, mean load –; it ended with status 1." in section
    assert "<p>no &lt;clips&gt;</p>" in section
