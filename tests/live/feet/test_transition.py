# SPDX-License-Identifier: GPL-3.0-or-later
"""An offset that changes abruptly is shown without a jump."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.live.feet.transition import Transition

STEP_S = 1 / 600


def shown_after_change(at: int, count: int = 400) -> np.ndarray:
    """Return what is shown (count, 3) of an offset that moves at 0.5 m/s, and is 0 from a frame
    on.
    """
    transition = Transition(2, 6.0)
    shown = []
    where = np.array([True, False])
    for k in range(count):
        before, now = (
            np.array([[0.5 * j * STEP_S, 0.0, 0.0], [1.0, 1.0, 1.0]]) for j in (k - 1, k)
        )
        zero = np.array([[0.0, 0.0, 0.0], [5.0, 5.0, 5.0]])
        if k == at:
            transition.change(where, (before, now), (zero, zero), STEP_S)
        transition.advance(STEP_S)
        assert not transition.remainder[1].any()
        shown.append((now if k < at else zero)[0] + transition.remainder[0])
    return np.array(shown)


def test_position_velocity_and_acceleration_continue() -> None:
    shown = shown_after_change(at=100)[:, 0]
    velocity = np.diff(shown) / STEP_S
    acceleration = np.diff(velocity) / STEP_S
    assert np.abs(velocity[90:102] - 0.5).max() < 0.05  # as if nothing had changed
    # 30000 m/s² if the offset jumped, 300 if the velocity did
    assert np.abs(acceleration[90:99]).max() < 5.0


def test_the_remainder_dies_away() -> None:
    assert np.abs(shown_after_change(at=100)[300:]).max() < 1e-3


def test_the_course_does_not_depend_on_the_frame_rate() -> None:
    coarse = Transition(1, 6.0)
    fine = Transition(1, 6.0)
    one = np.array([[1.0, 2.0, 3.0]])
    zero = np.zeros((1, 3))
    for each in (coarse, fine):
        each.change(np.array([True]), (0.9 * one, one), (zero, zero), 0.05)
    coarse.advance(0.1)
    for _ in range(10):
        fine.advance(0.01)
    np.testing.assert_allclose(coarse.remainder, fine.remainder, atol=1e-12)
