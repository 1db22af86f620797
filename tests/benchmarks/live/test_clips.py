# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips that are played there and back, and their ground truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scope.benchmarks.live.clips import there_and_back_truth


def test_every_frame_of_a_clip_there_and_back_gets_the_truth_of_the_frame_that_it_shows(
    tmp_path: Path,
) -> None:
    """Of four frames, the second has no truth; they are shown as 0 1 2 3 2 1 0 1."""
    truth = tmp_path / "truth.npz"
    target = tmp_path / "looped.npz"
    np.savez(
        truth,
        frame_index=[0, 2, 3],
        joints=np.array([[0.0], [2.0], [3.0]]),
        fps=60.0,
        names=["a", "b"],
    )
    there_and_back_truth(truth, 4, 8, target)
    with np.load(target) as looped:
        assert list(looped["frame_index"]) == [0, 2, 3, 4, 6]
        assert list(looped["joints"][:, 0]) == [0, 2, 3, 2, 0]
        assert looped["fps"] == 60
        assert list(looped["names"]) == ["a", "b"]
