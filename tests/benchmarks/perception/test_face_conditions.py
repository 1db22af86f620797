# SPDX-License-Identifier: GPL-3.0-or-later
"""A long clip in pieces: each counts as a clip of its own, and nothing else changes."""

import numpy as np
from scope.benchmarks.perception.face_conditions import in_pieces
from scope.tools.calibrate_face.observe import SeenFaces


def test_pieces_are_as_long_as_asked_and_belong_to_one_person():
    seconds = np.tile(np.arange(360) / 30, 2)
    person = np.repeat([0, 1], 360)
    seen = SeenFaces(
        {"seconds": seconds, "person": person},
        np.zeros((720, 478, 3)),
        np.ones(720),
        np.zeros((720, 52)),
    )
    pieces = in_pieces(seen, 5.0)
    assert pieces.landmarks is seen.landmarks
    counts = {}
    for p in np.unique(pieces.truth["person"]):
        rows = np.flatnonzero(pieces.truth["person"] == p)
        assert len(set(person[rows])) == 1
        assert np.ptp(seconds[rows]) < 5.0
        counts[int(p)] = len(rows)
    assert sorted(counts.values()) == [60, 60, 150, 150, 150, 150]
