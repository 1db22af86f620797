# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaving a camera out, and that no choice outlives its measurement."""

import numpy as np
import pytest
from scope.benchmarks.perception.choices import CHOICES, left_out


def test_the_other_cameras_choose():
    errors = np.array([[10.0, 20.0, 30.0], [11.0, 16.0, 31.0], [30.0, 10.0, 10.0]])
    chosen, there = left_out(errors)
    # without the first: 25, 23.5, 10; without the second: 20, 21, 20; without the third: 15, 13.5,
    # 20
    np.testing.assert_array_equal(chosen, [2, 0, 1])
    np.testing.assert_array_equal(there, [30.0, 20.0, 31.0])


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice.what)
def test_a_choice_is_set_and_set_back(choice):
    shipped = choice.shipped
    assert shipped not in choice.others
    with choice.set_to(choice.others[0]):
        assert choice.shipped == choice.others[0]
    assert choice.shipped == shipped


def test_a_choice_is_set_back_after_a_failure():
    shipped = CHOICES[0].shipped

    def fail():
        with CHOICES[0].set_to(0.0):
            raise ArithmeticError

    pytest.raises(ArithmeticError, fail)
    assert CHOICES[0].shipped == shipped
