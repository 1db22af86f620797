# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames on several threads: the same results in the same order, and really at the same time."""

import sys
import threading
import time

import numpy as np
import pytest
from scope.solver import ShapeError, fit, fit_batch

from .test_frame_solver import measured, scene

BODY, STATE = scene(5)


def frames(n):
    return [measured(BODY, STATE, noise=1.0, seed=k) for k in range(n)]


def test_every_frame_comes_out_as_alone():
    batch = frames(20)
    alone = [fit(BODY, m) for m in batch]
    for threads in (1, 3, 0):
        for a, b in zip(alone, fit_batch(BODY, batch, threads=threads), strict=True):
            assert (a.status, a.cost, a.iterations) == (b.status, b.cost, b.iterations)
            np.testing.assert_array_equal(a.t_camera_part, b.t_camera_part)
            np.testing.assert_array_equal(a.state.beta, b.state.beta)


def test_initial_states_are_used_where_they_are_given():
    batch = frames(3)
    first = fit(BODY, batch[0])
    warm = fit_batch(BODY, batch, init=[first.state, None, first.state], threads=2)
    for found, m, init in zip(warm, batch, [first.state, None, first.state], strict=True):
        np.testing.assert_array_equal(found.t_camera_part, fit(BODY, m, init=init).t_camera_part)
    with pytest.raises(ShapeError, match="one initial state per frame, 3"):
        fit_batch(BODY, batch, init=[None])


def test_nothing_to_fit_is_no_result_and_a_bad_frame_is_told():
    assert fit_batch(BODY, []) == []
    batch = frames(20)
    batch[17].keypoints3d.points = np.zeros((1, 3))
    with pytest.raises(ShapeError, match="3D keypoints"):
        fit_batch(BODY, batch, threads=2)


def test_other_threads_run_while_the_kernels_do():
    """With the GIL held, a thread that only counts would stand still for a fit's whole length."""
    from scope.solver import FrameSolver, Options, Stage

    endless = Options(stages=[Stage(tolerance=0.0, max_iterations=4000)])
    solver = FrameSolver(BODY, options=endless)
    m = measured(BODY, STATE, noise=30.0)
    solver.fit(m)
    ticks: list[None] = []
    done = threading.Event()

    def count():
        while not done.is_set():
            ticks.append(None)
            time.sleep(0)

    # Of a fit's milliseconds Python sees the first and last few microseconds: many ticks mean that
    # the kernel let go. How many fits that takes, a busy computer decides, which may not let the
    # thread run. Meanwhile, Python does not switch threads by itself.
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)
    counter = threading.Thread(target=count)
    counter.start()
    shared = fits = 0
    try:
        while shared < 10 and fits < 20_000:
            before = len(ticks)
            solver.fit(m)
            shared = shared + (len(ticks) - before >= 5)
            fits = fits + 1
    finally:
        sys.setswitchinterval(interval)
        done.set()
        counter.join()
    assert shared == 10
