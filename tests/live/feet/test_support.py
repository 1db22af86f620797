# SPDX-License-Identifier: GPL-3.0-or-later
"""What a body stands on draws its feet to where they rest, and keeps them above the floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scope.scope_addon.live.feet.support import AFTER_A_PAUSE, Support
from scope.solver import Floor, FootContacts, Measurements

POINTS = np.arange(6) + 40
SUPPORT = Support(
    places=np.arange(18.0).reshape(6, 3),
    rests=np.array([0.9, 0.8, 0.0, 0.1, 0.2, 0.0]),
    on_floor=np.array([0.7, 0.6, 0.0, 0.1, 0.0, 0.0]),
    not_below=np.array([0.5, 0.4, 0.3, 0.2, 0.1, 0.0]),
    stands=0.75,
    floor_normal=np.array([0.0, -0.8, -0.6]),
    floor_offset=-1.25,
)


def test_a_frame_gets_the_places_and_the_floor_and_keeps_the_rest() -> None:
    given = Measurements(intrinsics=np.diag([900.0, 900.0, 1.0]))
    found = SUPPORT.added_to(given, POINTS)
    assert given.floor is None
    assert found.intrinsics is given.intrinsics
    assert isinstance(found.foot_contacts, FootContacts)
    assert isinstance(found.floor, Floor)
    np.testing.assert_array_equal(found.foot_contacts.indices, POINTS)
    np.testing.assert_array_equal(found.foot_contacts.points, SUPPORT.places)
    np.testing.assert_array_equal(found.foot_contacts.probability, SUPPORT.rests)
    np.testing.assert_array_equal(found.floor.indices, POINTS)
    np.testing.assert_array_equal(found.floor.normal, SUPPORT.floor_normal)
    np.testing.assert_array_equal(found.floor.contact, SUPPORT.on_floor)
    assert found.floor.below is not None
    np.testing.assert_array_equal(found.floor.below, SUPPORT.not_below)
    assert found.floor.offset == SUPPORT.floor_offset


def test_after_a_pause_only_the_floor_is_left_and_weakly_as_far_as_somebody_stood_on_it() -> None:
    left = SUPPORT.after_a_pause()
    assert not left.rests.any()
    assert not left.on_floor.any()
    np.testing.assert_allclose(left.not_below, AFTER_A_PAUSE * 0.75)
    np.testing.assert_array_equal(left.floor_normal, SUPPORT.floor_normal)
    assert SUPPORT.rests.any()
    assert not replace(SUPPORT, stands=0.0).after_a_pause().not_below.any()
