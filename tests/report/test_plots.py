# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinates of plots against values worked out by hand: the plot area is 1000 wide and 100 high,
y downwards.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from scope.scope_addon.report.plots import (
    Axis,
    Curve,
    Span,
    area_path,
    band_plot,
    line_path,
    line_plot,
    thinned,
)


def points(path: str) -> list[tuple[str, float, float]]:
    return [
        (pen, float(x), float(y))
        for pen, x, y in re.findall(
            r"([ML])([-\d.]+) "
            r"([-\d.]+)",
            path,
        )
    ]


def test_a_curve_lies_where_its_values_are():
    path = line_path(np.array([0.0, 1.0, 4.0]), np.array([0.0, 5.0, 10.0]), Axis(0, 4), Axis(0, 20))
    assert points(path) == [("M", 0, 100), ("L", 250, 75), ("L", 1000, 50)]
    decades = Axis(1, 100, logarithmic=True)
    path = line_path(np.array([0.0, 1.0, 2.0]), np.array([1.0, 10.0, 100.0]), Axis(0, 2), decades)
    assert points(path) == [("M", 0, 100), ("L", 500, 50), ("L", 1000, 0)]


def test_a_curve_has_a_gap_where_a_value_is_missing_and_stays_inside_the_area():
    y = np.array([1.0, np.nan, 1.0, 99.0])
    path = line_path(np.arange(4.0), y, Axis(0, 3), Axis(0, 2))
    assert points(path) == [("M", 0, 50), ("M", 666.7, 50), ("L", 1000, 0)]


def test_shares_are_drawn_as_steps_that_hold_until_the_next_value():
    path = area_path(np.array([0.0, 1.0]), np.array([1.0, 0.25]), Axis(0, 2), 100, 80)
    assert points(path) == [
        *(("M", 0, 100), ("L", 0, 20), ("L", 500, 20)),
        *(("L", 500, 80), ("L", 1000, 80), ("L", 1000, 100)),
    ]


def test_a_long_curve_keeps_its_extremes_and_its_gaps():
    y = np.sin(np.arange(50_000) / 300)
    y[12_345] = 7.0
    y[33_333] = -9.0
    y[20_000] = np.nan
    x, kept = thinned(np.arange(50_000.0), y)
    assert len(kept) <= 1200
    assert (np.diff(x) > 0).all()
    assert (np.nanmax(kept), np.nanmin(kept)) == (7.0, -9.0)
    assert x[kept == 7.0] == 12_345
    assert np.isnan(kept).sum() == 1


@pytest.mark.parametrize(
    ("axis", "ticks"),
    [
        (Axis(3, 43), [10, 20, 30, 40]),
        (Axis(0.8, 30, logarithmic=True), [1, 2, 5, 10, 20]),
        (Axis(1, 1e5, logarithmic=True), [1, 10, 100, 1000, 1e4, 1e5]),
    ],
)
def test_ticks_are_round_and_between_the_ends(axis, ticks):
    assert axis.ticks(4) == pytest.approx(ticks)


def test_plots_are_well_formed_and_names_are_escaped():
    times = np.arange(5.0)
    svg = line_plot(
        [Curve(times, times, "red", '<b>&"', with_points=True)],
        Axis(0, 4, unit="s"),
        Axis(0, 5),
        label='"><script>',
        threshold=2.5,
        spans=[Span(1, 2, "far", "<i>")],
    )
    root = ET.fromstring(svg)
    assert root.attrib["aria-label"] == '"><script>'
    assert [e.text for e in root.iter("title")] == ["<i>", '<b>&"']
    mark = next(root.iter("rect")).attrib
    assert (mark["x"], mark["width"]) == ("250.0", "250.0")
    threshold = next(e for e in root.iter("path") if e.attrib.get("class") == "threshold")
    assert threshold.attrib["d"] == "M0 50.00H1000"
    assert [e.text for e in root.iter("text")][:5] == ["0 s", "0.5 s", "1 s", "1.5 s", "2 s"]
    band = ET.fromstring(band_plot([("a<b", times / 4)], times, Axis(0, 4), label="x", color="red"))
    assert next(e.text for e in band.iter("text") if e.attrib["class"] == "label") == "a<b"
