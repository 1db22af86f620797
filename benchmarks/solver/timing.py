# SPDX-License-Identifier: GPL-3.0-or-later
"""Timing that tolerates a busy machine: medians over many short, alternating batches."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np


def take_turns(runs: Mapping[str, Callable[[int], object]], counts: Mapping[str, int], rounds: int) -> dict[str, float]:
    """Return the median time of one repetition of each run, in microseconds.

    runs[name](n) repeats its work n times; counts[name] is n in one batch. The batches of all runs alternate, so that
    other load on the machine affects all alike and ratios stay meaningful.
    """
    times: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run(2)  # compile, and touch the memory
    for _ in range(rounds):
        for name, run in runs.items():
            n = counts[name]
            start = time.perf_counter()
            run(n)
            times[name].append((time.perf_counter() - start) / n)
    return {name: float(np.median(t)) * 1e6 for name, t in times.items()}
