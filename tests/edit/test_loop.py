# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the cycle of a walk and close it."""

import numpy as np
import pytest
from scope.scope_addon.edit import loop
from scope.scope_addon.edit.clip import Clip, about_z
from scope.scope_addon.errors import UsageError
from scope.solver.rotations import exp

from .walking import BETAS, BODY, NAMES, walk


def test_the_cycle_of_a_walk_is_found_and_closed():
    clip = walk(5.0, period=1.1)
    rng = np.random.default_rng(2)
    noisy = Clip(
        clip.times,
        clip.rotations @ exp(0.02 * rng.standard_normal((len(clip), len(NAMES), 3))),
        clip.root,
    )
    found = loop.best_cycle(noisy, BODY, BETAS, 0.3, 4.7)
    length = clip.times[found.last] - clip.times[found.first]
    assert abs(length / 1.1 - round(length / 1.1)) < 0.05
    assert found.error_m < 0.03
    closed = loop.close_cycle(noisy, found)
    np.testing.assert_allclose(closed.rotations[-1], closed.rotations[0], atol=1e-9)
    assert closed.root[-1, 2] == pytest.approx(closed.root[0, 2])
    travelled = closed.root[-1, 1] - closed.root[0, 1]
    assert travelled == pytest.approx(-1.2 * length, abs=0.02)  # the way is kept
    assert closed.times[0] == 0.0
    with pytest.raises(UsageError, match="does not fit"):
        loop.best_cycle(clip, BODY, BETAS, 0.0, 0.2)


def turning(angles, seconds):
    """Return a walk whose heading has the given angles (T,), radians."""
    clip = walk(seconds)
    turn = about_z(angles)
    rotations = clip.rotations.copy()
    rotations[:, 0] = turn @ rotations[:, 0]
    steps = np.diff(clip.root, axis=0, prepend=clip.root[:1])
    root = clip.root[0] + np.cumsum((turn @ steps[..., None])[..., 0], axis=0)
    return Clip(clip.times, rotations, root)


def test_a_cycle_that_is_repeated_does_not_turn():
    times = walk(8.0).times
    curve = turning(0.8 * times[:181], 6.0)
    with pytest.raises(UsageError, match=r"turns by \d+ degrees.*turn Repeat off"):
        loop.best_cycle(curve, BODY, BETAS, 0.0, 6.0, most_turn=loop.MIN_TURN)
    once = loop.best_cycle(curve, BODY, BETAS, 0.0, 6.0)
    assert curve.times[once.last] - curve.times[once.first] > 0.9
    # The longest cycle would turn.
    corner = turning(np.interp(times, [3.5, 4.5], [0.0, 1.5]), 8.0)
    found = loop.best_cycle(corner, BODY, BETAS, 0.0, 8.0, most_turn=loop.MIN_TURN)
    closed = loop.close_cycle(corner, found)
    np.testing.assert_allclose(closed.rotations[-1], closed.rotations[0], atol=1e-9)
    assert corner.times[found.last] - corner.times[found.first] > 1.9


def sitting(seconds=4.0):
    """Return a person who sits still: measurement noise and a slow sway of a few millimetres."""
    clip = walk(seconds, speed=0.0)
    still = np.repeat(clip.rotations[:1], len(clip), axis=0)
    rng = np.random.default_rng(3)
    noise = exp(0.005 * rng.standard_normal((len(clip), len(NAMES), 3)))
    root = clip.root[:1] + 0.004 * np.sin(clip.times)[:, None] * [1.0, 0.0, 0.0]
    return Clip(clip.times, still @ noise, root)


def test_a_person_who_stays_still_has_no_cycle():
    clip = sitting()
    with pytest.raises(UsageError, match="no cycle was found"):
        loop.best_cycle(clip, BODY, BETAS, 0.0, 4.0)
    idle = loop.best_cycle(clip, BODY, BETAS, 0.0, 4.0, 2.0, least_movement_m=0.0)
    assert clip.times[idle.last] - clip.times[idle.first] >= 2.0
