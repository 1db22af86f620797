# SPDX-License-Identifier: GPL-3.0-or-later
"""Line plots and bands over time as inline SVG, which scale with the page without scaling their
text or strokes.

Curves are in the plot area's own coordinates: x from 0 to ``WIDTH`` and y from 0, at the top, to
``HEIGHT``. The area is stretched to the width of the page. Texts are placed in per cent of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

WIDTH = 1000.0
HEIGHT = 100.0
# heights of the plot area, of the space above it, and of the axis below it
_AREA_PX = 120
_TOP_PX = 10
_AXIS_PX = 24
_ROW_PX = 22  # of a band
_MAX_POINTS = 1200  # of a curve; of more, the smallest and the largest of each interval are drawn

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Axis:
    """A linear or logarithmic axis from ``low`` to ``high``, which differ; a logarithmic one has
    ``low`` above 0.

    ``unit`` is written after each value.
    """

    low: float
    high: float
    logarithmic: bool = False
    unit: str = ""

    def share(self, values: Array) -> Array:
        """Return where values (n,) lie between ``low``, 0, and ``high``, 1: (n,)."""
        if self.logarithmic:
            return np.log(np.asarray(values) / self.low) / math.log(self.high / self.low)
        return (np.asarray(values) - self.low) / (self.high - self.low)

    def ticks(self, count: int = 5) -> list[float]:
        """Return at most about ``count`` round values between the ends, both included where they
        are round.
        """
        if self.logarithmic:
            decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            values = [digit * 10.0**decade for decade in decades for digit in (1, 2, 5)]
            inside = [v for v in values if self.low * 0.999 <= v <= self.high * 1.001]
            return (
                inside
                if len(inside) <= count + 2
                else [v for v in inside if f"{v:e}".startswith("1.0")]
            )
        step = _round_step((self.high - self.low) / count)
        first = math.ceil(self.low / step - 1e-9)
        return [n * step for n in range(first, math.floor(self.high / step + 1e-9) + 1)]


@dataclass(frozen=True)
class Curve:
    """y (n,) over x (n,), drawn in a colour of CSS; where y is not finite, the curve has a gap.

    ``with_line``: whether neighbouring points are connected.
    """

    x: Array
    y: Array
    color: str
    name: str = ""
    with_points: bool = False
    with_line: bool = True


@dataclass(frozen=True)
class Span:
    """An interval of x that is marked; ``kind`` becomes its CSS class, ``title`` its tooltip."""

    first: float
    last: float
    kind: str
    title: str


def line_plot(
    curves: Sequence[Curve],
    x_axis: Axis,
    y_axis: Axis,
    *,
    label: str,
    threshold: float | None = None,
    spans: Sequence[Span] = (),
    timed: bool = True,
) -> str:
    """Return an SVG element with curves over a common axis.

    :param label: what the plot shows, for screen readers.
    :param threshold: a value of y at which a dashed line is drawn.
    :param spans: intervals of x that are marked.
    :param timed: whether x is the page's time, whose cursor the plot then shows.
    """
    levels = y_axis.ticks(4)
    lines = [_horizontal(_y(y_axis, level), "grid") for level in levels]
    if threshold is not None and y_axis.low <= threshold <= y_axis.high:
        lines.append(_horizontal(_y(y_axis, threshold), "threshold"))
    marks = [_marked(span, x_axis) for span in spans]
    drawn = [_drawn(curve, x_axis, y_axis) for curve in curves]
    texts = [_level_text(y_axis, level) for level in levels]
    if timed:
        texts.append(_cursor(_AREA_PX))
    return _svg(
        label, _AREA_PX, [*marks, *lines, *drawn], [*_x_texts(x_axis, _AREA_PX), *texts], timed
    )


def band_plot(
    rows: Sequence[tuple[str, Array]], x: Array, x_axis: Axis, *, label: str, color: str
) -> str:
    """Return an SVG element with a row for each of several shares over time, filled up to the
    share.

    :param rows: name and values (n,) from 0 to 1.
    :param x: (n,) in ascending order; each value holds until the next.
    :param label: what the plot shows, for screen readers.
    :param color: of CSS.
    """
    height = HEIGHT / max(len(rows), 1)
    drawn = []
    texts = []
    for number, (name, values) in enumerate(rows):
        bottom = (number + 0.92) * height
        drawn.append(_horizontal(bottom, "grid"))
        path = area_path(x, values, x_axis, bottom, 0.8 * height)
        drawn.append(f'<path d="{path}" fill="{color}" fill-opacity="0.55"/>')
        at = _TOP_PX + (number + 0.92) * _ROW_PX - 5
        texts.append(f'<text class="label" x="4" y="{at:.1f}">{escape(name)}</text>')
    area = _ROW_PX * len(rows)
    return _svg(label, area, drawn, [*texts, *_x_texts(x_axis, area), _cursor(area)], True)


def line_path(x: Array, y: Array, x_axis: Axis, y_axis: Axis) -> str:
    """Return the path of a curve, x (n,) and y (n,), in coordinates of the plot area; it has gaps
    where y has them.
    """
    x, y = thinned(np.asarray(x, float), np.asarray(y, float))
    shown = np.isfinite(y)
    u = WIDTH * x_axis.share(x)
    v = np.full(len(y), np.nan)
    v[shown] = HEIGHT * (1 - y_axis.share(np.clip(y[shown], y_axis.low, y_axis.high)))
    parts = []
    pen = "M"
    for at, to, drawn in zip(u.tolist(), v.tolist(), shown.tolist(), strict=True):
        if drawn:
            parts.append(f"{pen}{at:.1f} {to:.2f}")
        pen = "L" if drawn else "M"
    return "".join(parts)


def area_path(x: Array, values: Array, x_axis: Axis, bottom: float, height: float) -> str:
    """Return the path of steps of values (n,) from 0 to 1 over x (n,), above ``bottom`` and up to
    ``height`` high.
    """
    x, values = thinned(
        np.asarray(x, float), np.nan_to_num(np.clip(np.asarray(values, float), 0, 1))
    )
    ends = np.append(
        x[1:], x[-1] + (np.median(np.diff(x)) if len(x) > 1 else x_axis.high - x_axis.low)
    )
    u, w = (np.clip(WIDTH * x_axis.share(each), 0, WIDTH) for each in (x, ends))
    v = bottom - height * values
    steps = "".join(f"L{a:.1f} {y:.2f}L{b:.1f} {y:.2f}" for a, b, y in zip(u, w, v, strict=True))
    return f"M{u[0]:.1f} {bottom:.2f}{steps}L{w[-1]:.1f} {bottom:.2f}Z"


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Return fewer points of a long curve, x (n,) and y (n,): the smallest and the largest y of
    each interval.
    """
    count = len(x)
    if count <= _MAX_POINTS:
        return x, y
    edges = np.linspace(0, count, _MAX_POINTS // 2 + 1).astype(int)
    kept = []
    for first, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        part = y[first:end]
        if np.isfinite(part).all():
            kept += sorted({first + int(part.argmin()), first + int(part.argmax())})
        else:
            kept.append(first + int(np.flatnonzero(~np.isfinite(part))[0]))
    return x[kept], y[kept]


def _drawn(curve: Curve, x_axis: Axis, y_axis: Axis) -> str:
    name = f"<title>{escape(curve.name)}</title>" if curve.name else ""
    line = line_path(curve.x, curve.y, x_axis, y_axis)
    path = (
        f'<path class="curve" d="{line}" stroke="{curve.color}">{name}</path>'
        if curve.with_line
        else ""
    )
    if not curve.with_points:
        return path
    dots = [
        line_path(np.array([a]), np.array([b]), x_axis, y_axis)
        for a, b in zip(curve.x, curve.y, strict=True)
    ]
    # A line of no length with round ends: a circle would be stretched with the area.
    points = "".join(f"{dot}h0" for dot in dots if dot)
    return f'{path}<path class="points" d="{points}" stroke="{curve.color}"/>'


def _marked(span: Span, x_axis: Axis) -> str:
    first, last = (float(WIDTH * x_axis.share(np.array([at]))[0]) for at in (span.first, span.last))
    return (
        f'<rect class="span {escape(span.kind)}" x="{first:.1f}" y="0" '
        f'width="{max(last - first, 1.5):.1f}" '
        f'height="{HEIGHT:g}"><title>{escape(span.title)}</title></rect>'
    )


def _horizontal(y: float, kind: str) -> str:
    return f'<path class="{kind}" d="M0 {y:.2f}H{WIDTH:g}"/>'


def _y(axis: Axis, value: float) -> float:
    return HEIGHT * (1 - float(axis.share(np.array([value]))[0]))


def _level_text(axis: Axis, level: float) -> str:
    at = _TOP_PX + _AREA_PX * _y(axis, level) / HEIGHT - 3
    return f'<text class="level" x="4" y="{at:.1f}">{level:g}</text>'


def _x_texts(axis: Axis, area_px: int) -> list[str]:
    texts = []
    for value in axis.ticks(8):
        share = 100 * float(axis.share(np.array([value]))[0])
        text = f"{value:g} {axis.unit}".strip()
        anchor = "start" if share < 2 else "end" if share > 98 else "middle"
        texts.append(
            f'<text x="{share:.2f}%" y="{_TOP_PX + area_px + 16}" '
            f'text-anchor="{anchor}">{text}</text>'
        )
    return texts


def _cursor(area_px: int) -> str:
    return f'<line class="cursor" x1="0" x2="0" y1="{_TOP_PX}" y2="{_TOP_PX + area_px}"/>'


def _svg(label: str, area_px: int, drawn: Sequence[str], above: Sequence[str], timed: bool) -> str:
    """Return the element: what is drawn in coordinates of the plot area, and what is above it in
    those of the page.
    """
    height = _TOP_PX + area_px + _AXIS_PX
    return (
        f'<svg class="plot{" timed" if timed else ""}" role="img" aria-label="{escape(label)}" '
        f'width="100%" height="{height}"><svg class="area" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" '
        f'preserveAspectRatio="none" x="0" y="{_TOP_PX}" width="100%" '
        f'height="{area_px}">{"".join(drawn)}</svg>{"".join(above)}</svg>'
    )


def _round_step(least: float) -> float:
    """Return the smallest of 1, 2 and 5 times a power of ten that is not below ``least``."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(digit * power for digit in (1, 2, 5, 10) if digit * power >= least * (1 - 1e-9))
