# SPDX-License-Identifier: GPL-3.0-or-later
"""Digitized curves are read from a table, and drawn over the same axes as ours."""

from __future__ import annotations

import math
import re

import pytest
from scope.benchmarks.page.content import experiment_plots
from scope.benchmarks.page.curves import read_curves
from scope.solver.errors import InputError


def test_points_are_sorted_by_experiment_and_body(tmp_path):
    path = tmp_path / "curves.csv"
    path.write_text(
        "\ufeffexperiment, body,x,speedup\n3,SMPL,10,4\n\n3,SMPL,0,2.5\n1,SMPL+H,120,9e1\n", "utf-8"
    )
    assert read_curves(path) == {
        ("3", "SMPL"): [(0.0, 2.5), (10.0, 4.0)],
        ("1", "SMPL+H"): [(120.0, 90.0)],
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the first line must be experiment,body,x,speedup, but is "),
        ("x,y\n1,2\n", "but is x,y"),
        ("experiment,body,x,speedup\n3,SMPL,10\n", "row 2 needs four values"),
        ("experiment,body,x,speedup\n3,SMPL,10,1\n3,SMPL,a,1\n", "row 3 needs four values"),
        ("experiment,body,x,speedup\n4,SMPL,10,1\n", "an experiment of 1, 2, 3"),
        ("experiment,body,x,speedup\n3,STAR,10,1\n", "one of SMPL, SMPL"),
        ("experiment,body,x,speedup\n3,SMPL,10,0\n", "a speedup above 0"),
        ("experiment,body,x,speedup\n3,SMPL,nan,1\n", "x of at least 0"),
        ("experiment,body,x,speedup\n3,SMPL,10,inf\n", "a speedup above 0"),
        ("experiment\0\n", "curves.csv"),
    ],
)
def test_another_file_is_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "curves.csv"
    path.write_text(text, "utf-8")
    with pytest.raises(InputError) as caught:
        read_curves(path)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_are_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_curves(tmp_path / "absent.csv")
    (tmp_path / "a.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="no CSV file"):
        read_curves(tmp_path / "a.csv")


def test_a_digitized_curve_lies_where_its_values_are():
    rows = [{"K": K, "N": N, "sparse": 1.0, "dense": 10.0} for K in (23, 51) for N in (120, 600)]
    speedups = experiment_plots(
        "1", rows, {("1", "SMPL"): [(120.0, 100.0), (600.0, 10.0)], ("2", "SMPL"): [(1, 1)]}
    )[1]
    assert "SMPL, digitized" in speedups
    assert "SMPL+H, digitized" not in speedups
    height = [
        [float(y) for y in pair]
        for pair in re.findall(
            r'class="curve" d="M[\d.]+ ([\d.]+)L[\d.]+ ([\d.]+)" stroke="[^"]*"><title>SMPL, '
            r"d",
            speedups,
        )
    ]
    share = math.log(1.3) / math.log(100 * 1.3**2 / 10)  # the axis goes from 10 / 1.3 to 100 * 1.3
    assert height == [pytest.approx([100 * share, 100 * (1 - share)], abs=0.01)]
