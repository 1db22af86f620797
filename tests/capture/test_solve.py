# SPDX-License-Identifier: GPL-3.0-or-later
"""The progress of stages that run for one person after the other."""

from __future__ import annotations

import pytest
from scope.scope_addon.capture.solve import progress_of_person


@pytest.mark.parametrize(
    ("count", "expected"),
    [
        (1, [("finding the shape", 0, 0), ("solving", 1, 4), ("solving", 4, 4)]),
        (
            2,
            [("finding the shape", 0, 2), ("solving", 1, 8), ("solving", 4, 8)]
            + [("finding the shape", 1, 2), ("solving", 5, 8), ("solving", 8, 8)],
        ),
    ],
)
def test_steps_count_for_all_people_together(count, expected):
    reported = []
    for number in range(count):
        progress = progress_of_person(lambda *message: reported.append(message), number, count)
        progress("finding the shape", 0, 0)
        progress("solving", 1, 4)
        progress("solving", 4, 4)
    assert reported == expected
