# SPDX-License-Identifier: GPL-3.0-or-later
"""Least squares for the amounts of one expression, and the file of all: mirrored, rounded, without
small ones.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.face import EXPRESSIONS
from ...scope_addon.retarget.expression_map import MOVED, TURNED, ExpressionMap, load_expression_map

Channel = tuple[str, str]  # control, and how it moves
Amounts = dict[Channel, float]
MIRRORED = ("left", "yaw", "roll")  # channels whose sign changes
EYES = {"eyeLookDown": ("pitch", 11.4), "eyeLookUp": ("pitch", -9.8), "eyeLookIn": ("yaw", -15.0)}
EYES["eyeLookOut"] = ("yaw", 15.0)  # degrees, of the left eye, as the shapes turn the eyeballs
_MIN_AMOUNT = {True: 0.015, False: 0.4}  # moves, and turns in degrees, that are written


@dataclass(frozen=True)
class Problem:
    """What a rig shows: ``show`` gives, for amounts (n,) of its channels, what is compared with a
    target (m,).
    """

    channels: list[Channel]
    show: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    jacobian: NDArray[np.float64]  # (m, n) at rest
    scale: NDArray[np.float64]  # (n,) by which the ridge measures amounts
    ridge: float
    least: NDArray[np.float64]  # (n,) below which an amount is left out

    def fit(
        self,
        target: NDArray[np.float64],
        free: NDArray[np.bool_],
        base: NDArray[np.float64],
        steps: int,
    ) -> NDArray[np.float64]:
        """Return the amounts x (n,) beyond ``base`` that show a target: min |target - show(base +
        x)|² + λ²|x/scale|².

        :param free: (n,) which channels may be used.
        """
        free = free.copy()
        x = np.zeros(len(base))
        # twice, what is small is left out, and the others are fitted again
        for factor in (0.7, 1.0, 1.0):
            rows = np.flatnonzero(free)
            x = np.zeros(len(base))
            A = (self.jacobian * self.scale)[:, rows]
            for _ in range(steps):
                residual = target - self.show(base + x)
                gradient = A.T @ residual - self.ridge**2 * (x / self.scale)[rows]
                x[rows] += (
                    np.linalg.solve(A.T @ A + self.ridge**2 * np.eye(len(rows)), gradient)
                    * self.scale[rows]
                )
            small = np.abs(x) < self.least * factor
            free &= ~small
        return np.where(small, 0.0, x)


def jacobian(
    channels: list[Channel], show: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return how what a rig shows changes with each channel (m, n), by differences."""
    columns = []
    for k, (_, channel) in enumerate(channels):
        x = np.zeros(len(channels))
        x[k] = 0.05 if channel in MOVED else 4.0
        columns.append(show(x) / x[k])
    return np.stack(columns, axis=1)


def free_of(channels: list[Channel], expression: str, jaw: str) -> NDArray[np.bool_]:
    """Return which channels an expression may use: the jaw's only where it moves, the eyes' are
    given.
    """
    ways = {"jawOpen": "pitch", "jawLeft": "left", "jawForward": "forward"}
    return np.array(
        [(b != jaw or ways.get(expression) == c) and not b.startswith("eye.") for b, c in channels],
        bool,
    )


def eye_amounts(expression: str) -> Amounts:
    """Return how the left eye turns."""
    return {
        ("eye.L", way): angle for name, (way, angle) in EYES.items() if expression == f"{name}Left"
    }


def share_shown(wanted: NDArray[np.float64], shown: NDArray[np.float64]) -> float:
    """Return which share of a target is shown: 1 - |wanted - shown| / |wanted|."""
    return 1.0 - float(np.linalg.norm(wanted - shown) / np.linalg.norm(wanted))


def write_map(path: Path, fitted: dict[str, Amounts], by_hand: dict[str, Amounts]) -> ExpressionMap:
    """Write the map, one channel per line, and return it.

    :param fitted: of the expressions in the middle and on the left; those on the right are their
        mirror images.
    :param by_hand: in place of fitted ones.
    """
    controls: dict[str, dict[str, dict[str, float]]] = defaultdict(lambda: defaultdict(dict))
    for expression in EXPRESSIONS:
        left = other(expression) if expression.endswith("Right") else expression
        found = by_hand.get(left) or fitted[left]
        if expression == other(expression):
            mirrored = mirror(found)
            found = {
                c: (found.get(c, 0.0) + mirrored.get(c, 0.0)) / 2 for c in {**found, **mirrored}
            }
        elif expression != left:
            found = mirror(found)
        for (bone, channel), value in found.items():
            value = round(value, 2 if channel in MOVED else 1)
            if abs(value) > _MIN_AMOUNT[channel in MOVED]:
                controls[bone][channel][expression] = value
    blocks = []
    for bone in sorted(controls):
        lines = [
            f'    "{c}": {json.dumps(controls[bone][c])}'
            for c in (*MOVED, *TURNED)
            if c in controls[bone]
        ]
        blocks.append(f"  {json.dumps(bone)}: {{\n" + ",\n".join(lines) + "}")
    head = '{"format": "scope expression map", "version": 1, "controls": {\n'
    path.write_text(head + ",\n".join(blocks) + "\n}}\n", "utf-8")
    return load_expression_map(path)


def mirror(amounts: Amounts) -> Amounts:
    """Return the amounts of the other side."""
    return {(other(b), c): -value if c in MIRRORED else value for (b, c), value in amounts.items()}


def other(name: str) -> str:
    """Return the bone or expression of the other side."""
    if name.endswith(("Left", "Right")):
        return name[:-4] + "Right" if name.endswith("Left") else name[:-5] + "Left"
    return re.sub(r"[.](L|R)(?=[.]|$)", lambda side: ".R" if side[1] == "L" else ".L", name)
