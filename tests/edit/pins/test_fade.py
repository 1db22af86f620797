# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolating what is known at a few keys, and fading it out."""

import numpy as np
import pytest
from scope.scope_addon.edit.pins.fade import faded

TIMES = np.arange(0, 4, 0.001)


@pytest.mark.parametrize("known", [[1.0], [1.0, 1.3], [1.0, 2.0, 2.4]])
def test_it_meets_what_is_known_and_starts_and_ends_at_rest(known):
    known = np.array(known)
    values = np.array([[1.0, -2.0], [3.0, 0.5], [2.0, 2.0]])[: len(known)]
    reach = np.full(len(known), 0.4)
    curve = faded(TIMES, known, values, reach)
    np.testing.assert_allclose(faded(known, known, values, reach), values, atol=1e-12)
    outside = (TIMES < known[0] - 0.4) | (TIMES > known[-1] + 0.4)
    assert (curve[outside] == 0).all()
    speed = np.diff(curve, axis=0) / 0.001
    # no jump: a broken line would have one of 5 per second
    assert np.abs(np.diff(speed, axis=0)).max() < 0.2
    assert curve.max() <= values.max() + 1e-12
    assert curve.min() >= min(values.min(), 0) - 1e-12


def test_far_apart_it_fades_out_in_between():
    curve = faded(TIMES, np.array([1.0, 3.0]), np.array([1.0, 1.0]), np.array([0.4, 0.4]))
    assert (curve[(TIMES > 1.4) & (TIMES < 2.6)] == 0).all()
