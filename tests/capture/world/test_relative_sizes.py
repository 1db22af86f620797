# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes of people on one floor, for heights of the camera that are known."""

import numpy as np
import pytest
from scope.scope_addon.capture.world.relative_sizes import Stander, relative_sizes, stander

from .placed_people import TRUTH, UP, stands_at

NOWHERE = float("nan")


def seen_alone(
    true_m: float, captured_m: float, camera_m: float = 2.0, is_known: bool = False
) -> Stander:
    """Somebody who is taken for ``captured_m`` by a camera at that height."""
    return Stander(camera_m * captured_m / true_m, captured_m, is_known)


KNOWN = seen_alone(1.72, 1.72, is_known=True)


def test_beside_somebody_of_known_stature_the_floor_tells_the_sizes_of_others():
    """A child has that size; an adult moves towards it, because floor and estimate have errors."""
    adult, child, known = relative_sizes([seen_alone(1.6, 1.7), seen_alone(1.1, 1.66), KNOWN])
    assert known == 1.0
    assert child == pytest.approx(1.1 / 1.66, abs=0.02)
    assert 1.6 / 1.7 + 0.01 < adult < 1.0 - 0.01


@pytest.mark.parametrize(
    "other",
    [
        Stander(NOWHERE, 1.7, False),  # whose feet were not seen
        Stander(0.3, 1.7, False),  # too near to the camera's height
        Stander(1.2, 1.7, False),  # on something 0.8 m high: a giant on the same floor
        Stander(9.0, 1.7, False),  # far below: not even a baby
    ],
    ids=["unseen", "at the camera's height", "higher", "lower"],
)
def test_who_is_not_on_the_floor_keeps_the_size(other):
    np.testing.assert_array_equal(relative_sizes([KNOWN, other]), 1.0)


def test_without_a_known_stature_nothing_changes():
    np.testing.assert_array_equal(
        relative_sizes([seen_alone(1.72, 1.72), seen_alone(1.1, 1.66)]), 1.0
    )


def test_the_height_of_the_camera_is_measured_from_feet_in_contact():
    placed = stands_at(TRUTH)
    found = stander(placed, UP, is_known=True)
    assert found.height_m == pytest.approx(
        float((placed.contact_points[0, :4] @ -UP).max()), abs=1e-5
    )
    assert found.stature_m == placed.body.stature(placed.betas)
