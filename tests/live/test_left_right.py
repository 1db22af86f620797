# SPDX-License-Identifier: GPL-3.0-or-later
"""Left and right without looking ahead: swaps of the network are undone in the frames in which they
come.
"""

from __future__ import annotations

from concurrent.futures import Future

import numpy as np
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.left_right import MIRROR_PARTNER
from scope.scope_addon.live.left_right import CausalLeftRight

from ..capture.tracking.test_left_right import walker

COUNT = 60


def read(swapped: np.ndarray, answers: dict[int, int | None], *, wait: bool = False) -> np.ndarray:
    """Return which frames (COUNT,) are read with left and right exchanged against the truth.

    :param swapped: (COUNT,) frames in which the network exchanges them.
    :param answers: the reference network's: frame that it was asked about, and frame before which
        it answers; None: it has answered at once.
    """
    truth = walker(COUNT, np.pi / 2)
    sides = CausalLeftRight(wait=wait)
    wrong = []
    pending: dict[int, Future] = {frame: Future() for frame in answers}
    for k in range(COUNT):
        for frame, due in answers.items():
            if (due if due is not None else frame) == k:
                pending[frame].set_result(truth[frame])
        seen = truth[k][MIRROR_PARTNER] if swapped[k] else truth[k]
        given = Observation(
            seen[:, :2],
            seen[:, 0],
            seen,
            1.0,
            Region((0.0, 0.0), 1.0, 0.0),
            k == 0,
            None,
            pending.get(k),
        )
        found = sides(given)
        assert np.array_equal(found.keypoints_px, found.world_landmarks[:, :2])
        assert np.array_equal(found.keypoints_confidence, found.world_landmarks[:, 0])
        wrong.append(not np.array_equal(found.world_landmarks, truth[k]))
    return np.array(wrong)


def frames(*numbers: range) -> np.ndarray:
    """Return the mask (COUNT,) of frames."""
    return np.isin(np.arange(COUNT), [n for each in numbers for n in each])


def test_a_swap_during_the_capture_is_undone_from_its_first_frame_on() -> None:
    assert not read(frames(range(10, 11), range(20, 38)), {0: None}).any()


def test_a_person_who_is_found_swapped_is_turned_by_the_first_answer() -> None:
    assert not read(frames(range(7)), {0: None}).any()
    assert read(frames(range(7)), {})[:7].all()  # nothing else tells
