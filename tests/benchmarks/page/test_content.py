# SPDX-License-Identifier: GPL-3.0-or-later
"""What benchmarks print becomes tables and text of the page, and figures become plots."""

from __future__ import annotations

import math
import re
from html import escape

import cv2
import numpy as np
import pytest
from scope.benchmarks import report
from scope.benchmarks.page import content
from scope.benchmarks.page.about import ABOUT
from scope.benchmarks.page.commands import Command, Outcome, commands
from scope.benchmarks.page.content import (
    experiment_plots,
    outcome_section,
    printed_parts,
    time_against_accuracy,
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


@pytest.mark.parametrize(
    ("what", "shown", "folded"),
    [
        (
            "renders",
            ["best, nothing given", "MPJPE-root / PA-MPJPE mm, nothing given", "preset"],
            ["best, focal length given", "balanced, nothing given", "fast, height given"],
        ),
        (
            "scenes",
            [
                "test: people",
                "test: MPJPE-root, more than the default, mm",
                "new, default preset: performers",
            ],
            ["test, preset fast: depth flips", "new, default preset, statures given: performers"],
        ),
        ("solver", ["one iteration, K=23 P=10 N=120, us"], []),
    ],
)
def test_of_many_tables_those_of_details_are_folded(what, shown, folded):
    heads = [*folded[:2], *shown, *folded[1:]]  # the second of the folded has two tables
    printed = "\n\n".join(report.table((head, "mm"), [("a", 1.0)]) for head in heads)
    section = outcome_section(Outcome(Command("", "bench", (what,)), printed, "", {}, 1.0, 0))
    assert re.findall(r"<summary>([^<]*)</summary><div", section) == folded
    assert [row[0] for row in cells(section)[::2]] == [*shown, *folded[:2], *folded[1:]]


def test_experiments_are_plotted_where_their_values_are():
    rows = [
        {"K": K, "N": N, "sparse": 10.0, "dense": 10.0 * factor}
        for K, factor in ((23, 10), (51, 100))
        for N in (120, 600)
    ]
    times, speedups = experiment_plots("1", rows)
    assert "51 joints, dense" in times
    found = [
        float(y) for y in re.findall(r'class="curve" d="M55\.6 ([\d.]+)L981\.5', speedups)
    ]  # not under the values of y
    share = math.log(1.3) / math.log(100 * 1.3**2 / 10)  # the axis goes from 10 / 1.3 to 100 * 1.3
    assert found == pytest.approx([100 * (1 - share), 100 * share], abs=0.01)
    assert 'class="cursor"' not in times
    of_more_terms = experiment_plots("3_N600", [{**row, "P": row["N"] // 60} for row in rows])
    assert (
        "Experiment 3, N = 600: µs per step against the number of shape coefficients P"
        in of_more_terms[0]
    )


def test_every_command_says_what_its_tables_were_measured_on():
    for command in {*commands(quick=False), *commands(quick=True)}:
        section = outcome_section(Outcome(command, "printed", "", {}, 1.0, 0))
        about = ABOUT[next(iter(command.arguments), command.script)]
        assert f'<p class="note">{escape(about)}</p>' in section, command.text


def test_where_plots_were_written_is_not_shown():
    assert printed_parts("| a |\n|---|\n| b |\n\nPlots are in /somewhere/build") == printed_parts(
        "| a |\n|---|\n| b |"
    )


def test_keys_of_the_evaluation_get_their_headings():
    (table,) = printed_parts(report.table(("figure", "now"), [("sample pa_mpjpe", 48.1)]))
    assert cells(table)[1] == ["sample PA-MPJPE mm", "48.1"]


def test_time_and_accuracy_of_a_method_are_a_point_for_each_clip():
    figures = {
        "cam1": {
            "dense": {"mpjpe_root": 100.0, "ms": 400.0},
            "Scope": {"mpjpe_root": 50.0, "ms": 4.0},
        },
        "cam2": {
            "dense": {"mpjpe_root": 50.0, "ms": 40.0},
            "Scope": {"mpjpe_root": 25.0, "ms": 4.0},
        },
    }
    drawn = time_against_accuracy(figures)
    (dense, scope) = re.findall(r'class="points" d="([^"]*)"', drawn)
    low = math.log(4.0 / 1.3)
    high = math.log(400.0 * 1.3)

    def at(ms: float) -> float:
        return 1000 * (math.log(ms) - low) / (high - low)

    def points(path: str) -> list[float]:
        return [float(number) for number in re.findall(r"[\d.]+(?= |h)", path)]

    height = 100 / 110  # the axis ends 10 % above the largest error
    expected = [at(40), 100 - 50 * height, at(400), 100 - 100 * height]
    assert points(dense) == pytest.approx(expected, abs=0.06)
    assert points(scope) == pytest.approx(
        [at(4), 100 - 25 * height, at(4), 100 - 50 * height], abs=0.06
    )
    outcome = Outcome(Command("SMPLify", "bench", ("smplify",)), "", "", figures, 1.0, 0)
    assert drawn in outcome_section(outcome)


def test_clips_are_not_connected_and_their_pictures_are_shown(tmp_path, monkeypatch):
    monkeypatch.setattr(content, "CACHE", tmp_path)
    cv2.imwrite(str(tmp_path / "smplify_b.jpg"), np.full((40, 60, 3), 200, np.uint8))
    figures = {
        clip: {"Scope": {"mpjpe_root": 50.0, "ms": ms}} for clip, ms in (("a", 3.0), ("b", 5.0))
    }
    printed = "/somewhere/smplify_b.jpg: 60 x 40, 1 kB, quality 34\n" + report.table(
        ("b", "mm"), [("Scope", 50.0)]
    )
    section = outcome_section(
        Outcome(Command("SMPLify", "bench", ("smplify",)), printed, "", figures, 1.0, 0)
    )
    assert 'class="curve"' not in section
    assert 'class="points"' in section
    assert re.findall(r'width="60" height="40" alt="b"><figcaption>([^<]*)<', section) == ["b"]
    assert "somewhere" not in section
    assert cells(section)[-1] == ["Scope", "50"]


def test_a_command_that_failed_says_so():
    outcome = Outcome(
        Command("Speed", "bench", ("solver", "--quick")), "", "first\nno <clips>", {}, 3.2, 1
    )
    section = outcome_section(outcome)
    # in one line
    assert '<code>./scripts/bench solver <span class="option">--quick</span></code>' in section
    assert "Elapsed 0:03 min:s, processor time –, mean load –; it ended with status 1." in section
    assert "<p>no &lt;clips&gt;</p>" in section
