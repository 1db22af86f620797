# SPDX-License-Identifier: GPL-3.0-or-later
"""Line plots of the experiments, drawn with OpenCV: one picture with times, one with speedups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from .problem import BODIES

# width, height; left, top, right, bottom
SIZE = (720, 480)
MARGIN = (80, 40, 30, 60)
COLOURS = ((180, 90, 20), (40, 110, 220), (60, 150, 60), (150, 60, 150))
FONT = cv2.FONT_HERSHEY_SIMPLEX
INK = (40, 40, 40)

Lines = Mapping[str, tuple[Sequence[float], Sequence[float]]]


def plot(path: Path, title: str, x_label: str, y_label: str, lines: Lines) -> None:
    """Write a plot with a logarithmic vertical axis. lines: name -> (x, y)."""
    width, height = SIZE
    left, top, right, bottom = MARGIN
    picture = np.full((height, width, 3), 255, np.uint8)
    xs = np.concatenate([np.asarray(x, float) for x, _ in lines.values()])
    ys = np.log10(np.concatenate([np.asarray(y, float) for _, y in lines.values()]))
    x0 = float(xs.min())
    x1 = float(xs.max())
    y0 = float(np.floor(ys.min() * 2) / 2)
    y1 = float(np.ceil(ys.max() * 2) / 2)

    def place(x: float, log_y: float) -> tuple[int, int]:
        across = left + (x - x0) / (x1 - x0) * (width - left - right)
        return round(across), round(
            height - bottom - (log_y - y0) / (y1 - y0) * (height - top - bottom)
        )

    for decade in np.arange(np.floor(y0), np.ceil(y1) + 1):
        for digit in (1, 2, 5):
            at = decade + np.log10(digit)
            if y0 - 1e-9 <= at <= y1 + 1e-9:
                cv2.line(picture, place(x0, at), place(x1, at), (225, 225, 225), 1)
                cv2.putText(
                    picture,
                    f"{10**at:g}",
                    (8, place(x0, at)[1] + 5),
                    FONT,
                    0.5,
                    INK,
                    1,
                    cv2.LINE_AA,
                )
    for x in sorted(set(xs)):
        cv2.putText(
            picture,
            f"{x:g}",
            (place(x, y0)[0] - 14, height - bottom + 22),
            FONT,
            0.5,
            INK,
            1,
            cv2.LINE_AA,
        )
    for number, (name, (x, y)) in enumerate(lines.items()):
        colour = COLOURS[number % len(COLOURS)]
        points = [place(a, float(np.log10(b))) for a, b in zip(x, y, strict=True)]
        cv2.polylines(picture, [np.array(points, np.int32)], False, colour, 2, cv2.LINE_AA)
        for point in points:
            cv2.circle(picture, point, 4, colour, -1, cv2.LINE_AA)
        end = (left + 10 + 160 * (number % 4), height - 8)
        cv2.putText(picture, name, end, FONT, 0.5, colour, 1, cv2.LINE_AA)
    cv2.putText(
        picture, f"{title}: {y_label} by {x_label}", (left, 24), FONT, 0.6, INK, 1, cv2.LINE_AA
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), picture)


def plot_experiment(
    folder: Path, number: int, rows: list[dict[str, float]], suffix: str = ""
) -> list[Path]:
    """Write the pictures of one experiment and return their paths, whose names end with
    ``suffix``.
    """
    key = "P" if number == 3 else "N"
    times = {}
    speedups = {}
    for K, name in BODIES.items():
        chosen = [row for row in rows if row["K"] == K]
        x = [row[key] for row in chosen]
        for method in ("sparse", "dense"):
            times[f"{name} {method}"] = x, [row[method] for row in chosen]
        speedups[name] = x, [row["dense"] / row["sparse"] for row in chosen]
    paths = [folder / f"experiment{number}_{what}{suffix}.png" for what in ("times", "speedups")]
    plot(paths[0], f"Experiment {number}", key, "µs per step", times)
    plot(paths[1], f"Experiment {number}", key, "dense over sparse", speedups)
    return paths
