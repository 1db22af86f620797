# SPDX-License-Identifier: GPL-3.0-or-later
"""Lowering the pelvis for the legs to reach the floor."""

import numpy as np
import pytest
from scope.scope_addon.retarget.feet import pelvis_drop


def lowered(fps, seconds=2.0):
    """Return times, needed and computed drop for a leg that is 5 cm too short for a fifth of a
    second.
    """
    times = np.arange(round(seconds * fps)) / fps
    needed = np.where(np.abs(times - 1.0) < 0.095, 0.05, 0.0)
    hips = np.zeros((len(times), 1, 3))
    goals = np.zeros((len(times), 1, 3))
    hips[:, 0, 2] = 1.0 + needed
    return times, needed, pelvis_drop(hips, goals, np.array([1.0]), times)


@pytest.mark.parametrize("fps", [24, 30, 60, 120, 240])
def test_the_pelvis_is_lowered_equally_smoothly_at_any_frame_rate(fps):
    times, needed, found = lowered(fps)
    assert (found >= needed - 1e-9).all()
    assert np.abs(np.gradient(found, times)).max() < 0.4
    assert 0.6 < (found > 1e-6).sum() / fps < 0.8
    # as what is needed: the same backwards
    np.testing.assert_allclose(found[1:], found[:0:-1], atol=1e-12)


def test_a_single_key_gets_its_own_drop():
    assert lowered(1, 2.0)[2].tolist() == pytest.approx([0.0, 0.05])
