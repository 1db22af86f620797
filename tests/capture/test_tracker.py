# SPDX-License-Identifier: GPL-3.0-or-later
"""Following one person through real clips."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from scope.scope_addon.capture.tracker import PersonTracker
from scope.solver.errors import SetupError, ShapeError

Frames = Callable[..., Iterator[np.ndarray]]


@pytest.fixture(scope="module")
def tracker_of_module() -> PersonTracker:
    try:
        return PersonTracker("balanced", threads=2)
    except SetupError as error:
        pytest.skip(f"the networks are not built: {error}")


@pytest.fixture
def tracker(tracker_of_module: PersonTracker) -> PersonTracker:
    tracker_of_module.reset()
    return tracker_of_module


@pytest.mark.parametrize("clip", ["walk_side_static", "run_moving_camera", "squats_5fps", "two_people_portrait"])
def test_person_is_found_once_and_kept(tracker: PersonTracker, frames: Frames, clip: str) -> None:
    seen = [tracker.step(image) for image in frames(f"clips/{clip}", stop=40)]
    found = [observation for observation in seen if observation is not None]
    assert len(found) >= 0.98 * len(seen)
    assert [o.acquired for o in found] == [True] + [False] * (len(found) - 1)
    for before, after in zip(found, found[1:], strict=False):
        assert after.region.resembles(before.region, 0.25)
    assert found[-1].keypoints_px.shape == (33, 2)
    assert found[-1].world_landmarks.shape == (33, 3)
    assert all(((o.keypoints_confidence >= 0) & (o.keypoints_confidence <= 1)).all() for o in found)


def test_a_hand_is_no_person(tracker: PersonTracker, frames: Frames) -> None:
    seen = [tracker.step(image) for image in frames("clips/hand_closeup", every=9)]
    assert sum(observation is not None for observation in seen) <= 0.1 * len(seen)


def test_lost_and_found_again(tracker: PersonTracker, frames: Frames) -> None:
    images = list(frames("clips/run_moving_camera", stop=6))
    blank = np.zeros_like(images[0])
    before = [tracker.step(image) for image in images[:3]]
    assert [tracker.step(blank) for _ in range(3)] == [None] * 3
    after = [tracker.step(image) for image in images[3:]]
    assert None not in before + after
    assert after[0].acquired
    assert after[0].region.resembles(before[-1].region, 0.1)


def test_the_same_person_is_preferred_after_a_loss(tracker: PersonTracker, frames: Frames) -> None:
    """Two people side by side; whichever was followed, hidden for a moment, is followed again."""
    (person,) = frames("clips/squats_5fps", stop=1)
    larger = np.concatenate([person, person], axis=1)
    for hidden, alone_x in ((slice(0, 720), 720), (slice(720, 1440), 0)):
        tracker.reset()
        alone = larger.copy()
        alone[:, hidden] = 0
        first = tracker.step(alone)
        assert tracker.step(np.zeros_like(larger)) is None
        again = tracker.step(larger)
        assert first is not None
        assert again is not None
        assert alone_x <= again.region.center_px[0] < alone_x + 720
        assert again.region.resembles(first.region, 0.1)


def test_reset_forgets(tracker: PersonTracker, frames: Frames) -> None:
    (image,) = frames("clips/gesture_square", stop=1)
    first = tracker.step(image)
    tracker.step(image)
    tracker.reset()
    again = tracker.step(image)
    assert first is not None
    assert again is not None
    assert again.acquired
    np.testing.assert_array_equal(again.keypoints_px, first.keypoints_px)


def test_odd_images(tracker: PersonTracker) -> None:
    for shape in ((1, 1), (3, 500), (17, 5)):
        assert tracker.step(np.zeros((*shape, 3), np.uint8)) is None
    with pytest.raises(ShapeError, match=r"\(5, 5\)"):
        tracker.step(np.zeros((5, 5), np.uint8))
