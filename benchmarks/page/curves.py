# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves of a paper that a user has digitized, to be drawn beside ours.

A CSV file with the header ``experiment,body,x,speedup``: the experiment's number, ``SMPL`` or
``SMPL+H``, N or, in Experiment 3, P, and the time of a dense step divided by that of a sparse one,
which depends less on the computer than times do.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

from ...solver.errors import InputError

HEAD = ("experiment", "body", "x", "speedup")
BODIES = ("SMPL", "SMPL+H")
EXPERIMENTS = ("1", "2", "3")

Curves = dict[tuple[str, str], list[tuple[float, float]]]


def read_curves(path: Path) -> Curves:
    """Return the points (x, speedup) of each experiment and body, by increasing x.

    :raises InputError: the file cannot be read, or is something else.
    """
    curves: Curves = {}
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            head, *rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row] or [
                []
            ]
    except OSError as error:
        raise InputError(
            f"{path}: the curves cannot be read ({error.strerror}); choose another file"
        ) from error
    except (ValueError, csv.Error) as error:
        raise InputError(f"{path} is no CSV file ({error}); choose another file") from error
    if tuple(head) != HEAD:
        raise InputError(
            f"{path}: the first line must be {','.join(HEAD)}, but is {','.join(head)[:80]}"
        )
    for number, row in enumerate(rows, 2):
        try:
            experiment, body, x, speedup = row
            point = float(x), float(speedup)
        except ValueError as error:
            raise InputError(
                f"{path}: row {number} needs four values, the last two numbers"
            ) from error
        if experiment not in EXPERIMENTS or body not in BODIES or not _can_be_drawn(*point):
            raise InputError(
                f"{path}: row {number} needs an experiment of {', '.join(EXPERIMENTS)}, one of "
                f"{', '.join(BODIES)}, x "
                "of at least 0, and a speedup above 0"
            )
        curves.setdefault((experiment, body), []).append(point)
    return {key: sorted(points) for key, points in curves.items()}


def _can_be_drawn(x: float, speedup: float) -> bool:
    return math.isfinite(x) and math.isfinite(speedup) and x >= 0 and speedup > 0
