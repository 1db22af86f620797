# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of the faces' benchmark, on weights made by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scope.benchmarks.perception.faces import BLINKS, closures
from scope.solver.names import EXPRESSIONS


def blinks(*starts):
    out = np.zeros((60, len(EXPRESSIONS)))
    for start in starts:
        out[start : start + 3, BLINKS] = 0.9
    return out


@pytest.mark.parametrize(
    ("found", "figures"),
    [
        ((10, 40), {"closed_found": 1.0, "closed_false": 0.0, "closed_frames": 0.0}),
        ((11, 38), {"closed_found": 1.0, "closed_false": 0.0, "closed_frames": 1.5}),
        ((10, 25), {"closed_found": 0.5, "closed_false": 0.5, "closed_frames": 0.0}),
    ],
)
def test_closures_are_matched_in_time(found, figures):
    assert closures(blinks(*found), blinks(10, 40), np.zeros(60, int)) == figures
