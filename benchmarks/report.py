# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of `./scripts/bench solver` as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from .solver.problem import BODIES
from .solver.steps import TARGETS, growth, growth_in_joints

FRAME_TARGETS = {
    "iteration": 30.0,
    "prior_23_joints": 5.0,
    "cold_frame_ms": 0.8,
    "warm_frame_ms": 0.2,
}
STARTUP_TARGETS = {"first_call_s": 20.0, "cached_call_s": 0.3}
NAMES = {  # of the figures in the table of targets
    "iteration": "whole iteration, all terms",
    "prior_23_joints": "joint prior of 23 joints",
    "cold_frame_ms": "one frame to convergence, cold, ms",
    "warm_frame_ms": "one frame to convergence, warm, ms",
    "first_call_s": "first call, compiling, s",
    "cached_call_s": "first call of a later session, s",
}
CLIP_TABLES = {  # what the tables of whole clips show, by their keys in the figures
    "clip": "Linearization and step of a whole clip, K joints: ms per frame, two threads",
    "clip_gradients": "Elimination over time and conjugate gradients, ms per frame; gap: frames "
    "that see nothing",
    "clip_dense": "A clip's step by elimination and as one dense matrix, ms per step, one thread",
    "clip_frames": "All frames as one problem, and frames alone with smoothing, ms per frame",
    "clip_outlines": "Linearization without outlines, with one in one frame in six, and in all, ms "
    "per frame",
}


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(x) for x in line) + " |" for line in lines)


def rows_table(rows: Sequence[dict[str, float]]) -> str:
    """Return rows of one kind as a table, their keys as its head."""
    return table(list(rows[0]), [[_exact(x) for x in row.values()] for row in rows])


def _step_name(key: str) -> str:
    """Return the name of a target step, such as "step K=23 P=10 N=52, with the joint prior" for
    K23_P10_N52_prior.
    """
    sizes = key.removesuffix("_prior")
    name = "step " + " ".join(f"{part[0]}={part[1:]}" for part in sizes.split("_"))
    return f"{name}, with the joint prior" if key != sizes else name


def _cell(x: object) -> str:
    if x is None:
        return ""
    return (
        f"{x:.3g}"
        if isinstance(x, float) and x < 100
        else f"{x:.0f}"
        if isinstance(x, float)
        else str(x)
    )


def target_lines(figures: dict[str, Any]) -> str:
    """Return the target table, from whatever of it was measured."""
    rows: list[list[object]] = []
    for name, (_, _, _, _, target) in TARGETS.items():
        ratio = figures["dense_over_sparse"][name]
        called = figures["dense_over_called"][name]
        text = f"dense: {ratio:.1f} x, {called:.1f} x if both are called from Python"
        rows.append([_step_name(name), figures["gn_step"][name], target, text])
    for name, target in (FRAME_TARGETS | STARTUP_TARGETS).items():
        if figures.get(name) is not None:
            rows.append([NAMES[name], figures[name], target, None])
    return table(("median, one thread, µs unless stated", "measured", "target", ""), rows)


def experiment_lines(number: int, rows: list[dict[str, float]]) -> str:
    """Return one experiment on both bodies: sparse and dense times, speedup, and the larger body
    over the smaller.
    """
    key = "P" if number == 3 else "N"
    by_place = {(row["K"], row[key]): row for row in rows}
    lines: list[list[object]] = []
    for at in sorted({row[key] for row in rows}):
        a = by_place[23, at]
        b = by_place[51, at]
        speedups = [a["dense"] / a["sparse"], b["dense"] / b["sparse"]]
        ratios = [b["sparse"] / a["sparse"], b["dense"] / a["dense"]]
        lines.append([at, a["sparse"], a["dense"], b["sparse"], b["dense"], *speedups, *ratios])
    small = BODIES[23]
    large = BODIES[51]
    head = (key, f"{small} "
                 "sparse", f"{small} "
                           "dense", f"{large} sparse", f"{large} dense", f"speedup {small}",
            "speedup "
            f"{large}", f"{large} / {small} sparse", f"{large} / {small} dense")  # fmt: skip
    counts = (
        " and ".join(str(N) for N in dict.fromkeys(row["N"] for row in rows)) if number == 3 else ""
    )
    title = f"Experiment {number}{f', N = {counts}' if counts else ''}, µs per step"
    text = f"{title}\n\n" + table(head, lines)
    if number < 3:
        fits = [
            f"{m} K={K}: N^{growth(rows, K, m):.2f}" for K in (23, 51) for m in ("sparse", "dense")
        ]
        text += "\n\nGrowth from N = 120 to 600: " + ", ".join(fits)
    joints = [f"{m}: K^{growth_in_joints(rows, m):.2f}" for m in ("sparse", "dense")]
    return text + "\n\nGrowth from K = 23 to 51: " + ", ".join(joints)


def joint_lines(rows: list[dict[str, float]]) -> str:
    """Return the times of steps with growing K, and their exponents from one K to the next."""
    lines: list[list[object]] = []
    before: dict[float, dict[str, float]] = {}
    for row in rows:
        exponents = ["", ""]
        if row["P"] in before:
            last = before[row["P"]]
            exponents = [
                f"{math.log(row[m] / last[m]) / math.log(row['K'] / last['K']):.2f}"
                for m in ("sparse", "dense")
            ]
        lines.append([row["P"], row["K"], row["sparse"], row["dense"], *exponents])
        before[row["P"]] = row
    head = ("P", "K", "sparse", "dense", "sparse: exponent of K", "dense: exponent of K")
    return "Growth with the joints, N = 600, µs per step\n\n" + table(head, lines)


def frame_lines(convergence: list[dict[str, Any]]) -> str:
    """Return the convergence report on real frames."""
    keys = (
        "kind",
        "tolerance",
        "frames",
        "milliseconds",
        "iterations",
        "converged",
        "cost",
    )
    return table(keys, [[_exact(row[k]) for k in keys] for row in convergence])


def _exact(x: object) -> object:
    return f"{x:g}" if isinstance(x, float) and x < 1e-2 else x
