# SPDX-License-Identifier: GPL-3.0-or-later
"""What a command printed, as parts of the page: Markdown tables, other text, and plots of its
figures.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import escape
from itertools import groupby

import cv2
import numpy as np

from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.report import page
from ...scope_addon.report.page import Markup
from ...scope_addon.report.plots import Axis, Curve, line_plot
from ..frames import CACHE
from ..perception.accuracy import SHOWN
from ..perception.renders import KNOWN
from .about import ABOUT
from .commands import Outcome
from .curves import Curves
from .failures import captioned
from .paper import convergence_plot, stated_table

BODIES = ((23, "SMPL"), (51, "SMPL+H"))  # number of joints of ours, and whose skeleton has as many
OF = {"N": "the number of measurements N", "P": "the number of shape coefficients P"}
PAPER = (
    "The curves in figures 5 to 7 of the solver's paper are not shown here: they are published as "
    "images only, and "
    "were not digitized. The option --curves plots digitized curves beside these."
)
DETAILS = {  # benchmarks of many tables: which of them are folded, by their first heading
    "renders": re.compile(rf"(?!{CaptureOptions().quality}, {KNOWN[0]})\w+, "),
    "scenes": re.compile(r"\w+, (?!default preset: )"),
}
# What a benchmark has written to files, as it says.
_PICTURE = re.compile(r"^(\S+\.jpg: |Plots are in ).*\n?", re.MULTILINE)
# what a plot's x axis is longer than its curves, over their length
LEFT = 0.06
RIGHT = 0.02
_RULE = re.compile(r"\|(\s*:?-+:?\s*\|)+")


def printed_parts(text: str, details: re.Pattern[str] | None = None) -> list[Markup]:
    """Return Markdown tables as tables and everything else as paragraphs, in their order.

    In the first column, the keys of the evaluation are replaced by its headings. Lines about
    pictures are left out.

    :param details: tables whose first heading it matches come last, folded under that heading.
    """
    parts: list[Markup] = []
    folded: dict[str, list[Markup]] = {}
    for block in re.split(r"\n\s*\n", _PICTURE.sub("", text).strip()):
        for is_table, group in groupby(block.splitlines(), lambda line: line.startswith("|")):
            lines = list(group)
            if is_table and len(lines) > 1 and _RULE.fullmatch(lines[1]):
                cells = [
                    [cell.strip() for cell in line.strip("|").split("|")]
                    for line in (lines[0], *lines[2:])
                ]
                rows = [[with_headings(row[0]), *row[1:]] for row in cells[1:]]
                is_detail = details is not None and details.match(cells[0][0])
                (folded.setdefault(cells[0][0], []) if is_detail else parts).append(
                    page.table(cells[0], rows, numbers=True)
                )
            elif text := " ".join(lines).strip():
                parts.append(Markup(f"<p>{escape(text)}</p>\n"))
    return [*parts, *(page.folded(heading, *tables) for heading, tables in folded.items())]


def with_headings(name: str) -> str:
    """Return the name of a figure with the evaluation's heading for its key, such as ``pa_mpjpe``,
    in it.
    """
    return " ".join(SHOWN[word][0] if word in SHOWN else word for word in name.split(" "))


def plots(outcome: Outcome, curves: Curves) -> list[Markup]:
    """Return plots of a command's figures: of ``bench solver`` and of ``bench smplify``; of others
    none.

    :param curves: digitized speedups of others, see `read_curves`.
    """
    figures = outcome.figures
    parts = []
    if experiments := figures.get("experiments"):
        parts += [stated_table(figures), convergence_plot(figures)]
        if not curves:
            parts.append(Markup(f"<p>{escape(PAPER)}</p>\n"))
        for number, rows in sorted(experiments.items()):
            parts += experiment_plots(str(number), rows, curves)
    if clip := figures.get("clip"):
        parts.append(clip_plot(clip))
    if figures and outcome.command.arguments[:1] == ("smplify",):
        parts += [time_against_accuracy(figures), smplify_pictures(figures)]
    return parts


def smplify_pictures(figures: Iterable[str]) -> Markup:
    """Return the pictures that ``bench smplify`` has made of its clips, as far as they are
    there.
    """
    pictures = []
    for clip in figures:
        image = cv2.imread(str(CACHE / f"smplify_{clip}.jpg"))
        if image is not None:
            pictures.append((np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8), clip))
    note = (
        "Footage; SMPLify's body over it and turned by 90 degrees; Scope's body over it and turned "
        "by 90 degrees."
    )
    return captioned(pictures, note) if pictures else Markup("")


def time_against_accuracy(figures: dict[str, dict[str, dict[str, float]]]) -> Markup:
    """Return the plot of ``bench smplify``: each clip is a point of each method, its error by its
    time a frame.
    """
    methods = dict.fromkeys(method for clip in figures.values() for method in clip)
    curves = []
    for n, method in enumerate(methods):
        rows = sorted(
            (clip[method]["ms"], clip[method]["mpjpe_root"])
            for clip in figures.values()
            if method in clip
        )
        x, y = np.array(rows, float).T
        curves.append(Curve(x, y, page.person_color(n), method, with_points=True, with_line=False))
    x = np.concatenate([curve.x for curve in curves])
    y = np.concatenate([curve.y for curve in curves])
    x_axis = Axis(float(x.min()) / 1.3, float(x.max()) * 1.3, logarithmic=True, unit="ms")
    y_axis = Axis(0.0, 1.1 * float(y.max()))
    title = (
        "MPJPE-root in mm against ms per frame, logarithmic (SMPLify: processor time, Scope: "
        "elapsed); a point per clip"
    )
    svg = line_plot(curves, x_axis, y_axis, label=title, timed=False)
    return page.plot_figure(title, svg, {curve.name: curve.color for curve in curves})


def clip_plot(rows: Sequence[dict[str, float]]) -> Markup:
    """Return the plot of a whole clip as one problem: milliseconds per frame by the number of
    frames.
    """
    curves: list[Curve] = []
    for K, _ in BODIES:
        chosen = [row for row in rows if row["K"] == K]
        x = np.array([row["frames"] for row in chosen], float)
        for key, name in (("linearize_ms", "linearize"), ("step_ms", "step")):
            y = np.array([row[key] for row in chosen], float)
            curves.append(
                Curve(x, y, page.person_color(len(curves)), f"{K} joints, {name}", with_points=True)
            )
    return plot(
        "A whole clip as one problem: ms per frame against the number of frames; y logarithmic",
        curves,
    )


def experiment_plots(
    number: str, rows: Sequence[dict[str, float]], digitized: Curves | None = None
) -> list[Markup]:
    """Return the plots of one experiment: microseconds of a step, and how much slower the dense
    step is.

    :param number: such as 3, or 3_N600 with another number of terms.
    :param digitized: speedups of others, see `read_curves`.
    """
    key = "P" if number.startswith("3") else "N"
    title = f"Experiment {number.replace('_N', ', N = ')}"
    times = []
    speedups = []
    for n, (K, body) in enumerate(BODIES):
        chosen = [row for row in rows if row["K"] == K]
        x = np.array([row[key] for row in chosen], float)
        dense, sparse = (
            np.array([row[method] for row in chosen], float) for method in ("dense", "sparse")
        )
        times.append(
            Curve(x, sparse, page.person_color(2 * n), f"{K} joints, sparse", with_points=True)
        )
        times.append(
            Curve(x, dense, page.person_color(2 * n + 1), f"{K} joints, dense", with_points=True)
        )
        speedups.append(
            Curve(x, dense / sparse, page.person_color(2 * n), f"{K} joints", with_points=True)
        )
        if points := (digitized or {}).get((number, body)):
            x, y = np.array(points, float).T
            speedups.append(
                Curve(x, y, page.person_color(2 * n + 1), f"{body}, digitized", with_points=True)
            )
    return [
        plot(f"{title}: µs per step against {OF[key]}; y logarithmic", times),
        plot(f"{title}: dense over sparse time against {OF[key]}; y logarithmic", speedups),
    ]


def plot(title: str, curves: Sequence[Curve]) -> Markup:
    """Return a plot of curves over common, logarithmic y, with its legend; the values of y are left
    of the curves.
    """
    x = np.concatenate([curve.x for curve in curves])
    y = np.concatenate([curve.y for curve in curves])
    first = float(x.min())
    last = float(x.max()) if x.max() > x.min() else float(x.min()) + 1
    x_axis = Axis(first - LEFT * (last - first), last + RIGHT * (last - first))
    y_axis = Axis(float(y.min()) / 1.3, float(y.max()) * 1.3, logarithmic=True)
    svg = line_plot(curves, x_axis, y_axis, label=title, timed=False)
    return page.plot_figure(title, svg, {curve.name: curve.color for curve in curves})


def outcome_section(outcome: Outcome, curves: Curves | None = None) -> Markup:
    """Return the section of one command: the command, its costs, what it measures, what it printed,
    and plots.

    :param curves: digitized speedups of others, see `read_curves`.
    """
    ended = "" if outcome.status == 0 else f"; it ended with status {outcome.status}"
    last = outcome.said.strip().splitlines()
    said = (
        [Markup(f"<p>{escape(last[-1])}</p>\n")]
        if last and (outcome.status or not outcome.printed.strip())
        else []
    )
    about = ABOUT.get(next(iter(outcome.command.arguments), outcome.command.script))
    costs = (
        f"{minutes_text(outcome.seconds)} min:s, processor time "
        f"{minutes_text(outcome.processor_seconds)}"
    )
    return page.section(
        outcome.command.title,
        page.command_line(outcome.command.text),
        *([page.paragraph(about)] if about else []),
        *said,
        *plots(outcome, curves or {}),
        *printed_parts(outcome.printed, DETAILS.get(next(iter(outcome.command.arguments), ""))),
        note=f"Elapsed {costs}, mean load {load_text(outcome.load)}{ended}.",
    )


def minutes_text(seconds: float | None) -> str:
    """Return a time as minutes and seconds."""
    return "–" if seconds is None else f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def load_text(load: float | None) -> str:
    """Return a load."""
    return "–" if load is None else f"{load:.1f}"
