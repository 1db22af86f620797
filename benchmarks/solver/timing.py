# SPDX-License-Identifier: GPL-3.0-or-later
"""Timing that tolerates a busy machine: medians of processor time over many short, alternating
batches.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np

FINEST_S = 1e-6  # of a clock whose resolution suffices


def take_turns(
    runs: Mapping[str, Callable[[int], object]], counts: Mapping[str, int], rounds: int
) -> dict[str, float]:
    """Return the median processor time of one repetition of each run, in microseconds.

    Everything runs in one thread. While it waits for a core, which on a busy machine long batches
    do more often than short ones, no processor time passes. Where the system counts that in ticks,
    the time of the clock is taken.

    runs[name](n) repeats its work n times; counts[name] is n in one batch. The batches of all runs
    alternate, so that caches that other programs use affect all alike.
    """
    clock = (
        time.thread_time
        if time.get_clock_info("thread_time").resolution < FINEST_S
        else time.perf_counter
    )
    times: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run(2)  # compile, and touch the memory
    for _ in range(rounds):
        for name, run in runs.items():
            n = counts[name]
            start = clock()
            run(n)
            times[name].append((clock() - start) / n)
    return {name: float(np.median(t)) * 1e6 for name, t in times.items()}
