# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose as the values that clients and the panel get."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.live.pose import values

from .test_vmc import pose_of


def test_the_root_rotates_in_the_world_and_joints_relative_to_their_parents(body):
    half = np.sqrt(0.5)
    given = values(pose_of(body), 0.0)["rotations"]
    assert given[0] == pytest.approx([half, half, 0, 0], abs=1e-4)  # model y up becomes world z up
    assert given[5] == [1, 0, 0, 0]


def test_before_somebody_was_seen_there_is_no_body(body):
    given = values(replace(pose_of(body), is_known=False), 12.34)
    assert given == {
        **{"person": 0, "frame": 3, "latency_ms": 12.3, "presence": "seen"},
        **{key: given[key] for key in ("time_s", "settled")},
    }
