# SPDX-License-Identifier: GPL-3.0-or-later
"""What the solver's paper states in words about its speed, beside what was measured here.

Its curves (figures 5 to 7) exist as pictures alone; `curves` reads digitized ones. docs/paper.md
goes through all of its tables and experiments.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...scope_addon.report import page
from ...scope_addon.report.page import Markup
from ...scope_addon.report.plots import Axis, Curve, line_plot
from ..frames import REPORTED
from ..solver.steps import growth, growth_in_joints

SOURCE = "the paper (Fan et al., ICCV 2021)"
FRAME_MS = 4.0  # on average, until one frame has converged, on an Intel Xeon E3-1505M
# exponents of time in joints and measurements: the paper's, and earlier work's as it says
LINEAR = 1.0
CUBIC = 3.0
_KINDS = {"cold": "cold: no earlier estimate", "warm": "warm: from the frame before"}


def stated_table(figures: Mapping[str, Any]) -> Markup:
    """Return a table of what the paper states and of what ``bench solver`` measured; empty without
    its figures.

    :param figures: of ``bench solver``.
    """
    rows: list[Sequence[str]] = []
    converged = {
        row["kind"]: row
        for row in (figures.get("convergence") or [])
        if row["tolerance"] == REPORTED
    }
    if converged:
        found = ", ".join(f"{row['milliseconds']:.2f} {kind}" for kind, row in converged.items())
        rows.append(
            ("one frame to convergence, ms", f"below {FRAME_MS:g} on average", f"{found} (medians)")
        )
    if steps := figures.get("experiments", {}).get("1"):  # P = 0, growing N
        by_terms = " and ".join(f"{growth(steps, K, 'sparse'):.2f}" for K in (23, 51))
        rows.append(
            (
                "exponent of a step's time in measurements",
                f"{LINEAR:g}",
                f"{by_terms} (23 and 51 joints)",
            )
        )
        sparse, dense = (f"{growth_in_joints(steps, method):.2f}" for method in ("sparse", "dense"))
        rows.append(("exponent of a step's time in joints", f"{LINEAR:g}", sparse))
        rows.append(("exponent of a dense step's time in joints", f"{CUBIC:g}", dense))
    if not rows:
        return Markup("")
    return page.table(("quantity", SOURCE, "here"), rows)


def convergence_plot(figures: Mapping[str, Any]) -> Markup:
    """Return milliseconds of a frame by the relative decrease at which it stops, below the paper's
    time; or nothing.
    """
    rows = figures.get("convergence") or []
    curves = []
    for n, (kind, name) in enumerate(_KINDS.items()):
        chosen = sorted(
            (row["tolerance"], row["milliseconds"]) for row in rows if row["kind"] == kind
        )
        if chosen:
            x, y = np.array(chosen, float).T
            curves.append(Curve(x, y, page.person_color(n), name, with_points=True))
    if not curves:
        return Markup("")
    ends = np.array(
        [min(curve.x.min() for curve in curves), max(curve.x.max() for curve in curves)]
    )
    curves.append(
        Curve(
            ends, np.full(2, FRAME_MS), page.person_color(len(curves)), f"{FRAME_MS:g} ms: {SOURCE}"
        )
    )
    lowest = min(float(curve.y.min()) for curve in curves)
    x_axis = Axis(float(ends[0]) / 1.2, float(ends[1]) * 1.2, logarithmic=True)
    title = (
        "Milliseconds until a frame has converged, by the relative decrease at which it stops; "
        "both logarithmic"
    )
    svg = line_plot(
        curves,
        x_axis,
        Axis(lowest / 1.3, 1.3 * FRAME_MS, logarithmic=True),
        label=title,
        timed=False,
    )
    return page.plot_figure(title, svg, {curve.name: curve.color for curve in curves})
