# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracking people through real clips, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.tracker import PeopleTracker

Frames = Callable[..., Iterator[np.ndarray]]


@pytest.fixture(scope="module")
def tracker_of_module(networks: Path) -> PeopleTracker:
    return PeopleTracker("fast", threads=2)


@pytest.fixture(scope="module")
def tracker_of_many(networks: Path) -> PeopleTracker:
    return PeopleTracker("fast", threads=2, people=12)


@pytest.fixture
def tracker(tracker_of_module: PeopleTracker) -> PeopleTracker:
    tracker_of_module.reset()
    return tracker_of_module


@pytest.mark.slow
def test_a_somersault_is_tracked_all_the_way_round(frames: Frames) -> None:
    """The man turns over once in the air, against the sun, between frames 165 and 183."""
    tracker = PeopleTracker("best", threads=2)
    seen: dict[int, dict[int, Observation]] = {}
    for index, image in enumerate(frames("clips/walk_side_static", start=154, stop=187), 154):
        for tracklet, observation in tracker.step(image):
            # the man in the air, not the woman on the grass
            if observation.keypoints_px[:, 1].mean() < 600:
                seen.setdefault(tracklet, {})[index] = observation
    (man,) = (track for track in seen.values() if 165 in track)
    assert set(range(156, 187)) <= set(man)
    head_above_hips = {
        k: o.keypoints_px[[23, 24], 1].mean() - o.keypoints_px[0, 1] for k, o in man.items()
    }
    assert head_above_hips[156] > 0
    assert head_above_hips[170] < 0
    assert head_above_hips[186] > 0


@pytest.mark.slow
def test_a_person_who_walks_out_of_the_picture_is_lost(frames: Frames) -> None:
    """The woman on the grass leaves at the left edge between frames 195 and 207, and nothing
    replaces her.

    The man runs behind a tree between frames 223 and 229, and no person is found in its bark.
    """
    tracker = PeopleTracker("best", 2, 2)
    seen: dict[int, list[int]] = {}
    for index, image in enumerate(frames("clips/walk_side_static", start=185), 185):
        for tracklet, _ in tracker.step(image):
            seen.setdefault(tracklet, []).append(index)
    # a tracklet of a third of a second or more is a person
    lasting = sorted(
        (frames for frames in seen.values() if len(frames) >= 10), key=lambda frames: frames[-1]
    )
    woman, man = lasting
    assert 195 <= woman[-1] <= 207
    assert 223 <= man[-1] <= 226  # behind a tree


@pytest.mark.parametrize("clip", ["run_moving_camera", "squats_5fps"])
def test_person_is_found_once_and_kept(tracker: PeopleTracker, frames: Frames, clip: str) -> None:
    seen = [tracker.step(image) for image in frames(f"clips/{clip}", stop=12)]
    found = [observations[0][1] for observations in seen if [n for n, _ in observations] == [0]]
    assert len(found) == len(seen)
    assert [o.acquired for o in found] == [True] + [False] * (len(found) - 1)
    for before, after in zip(found, found[1:], strict=False):
        assert after.region.resembles(before.region, 0.25)
    assert found[-1].keypoints_px.shape == (33, 2)
    assert found[-1].world_landmarks.shape == (33, 3)
    assert all(((o.keypoints_confidence >= 0) & (o.keypoints_confidence <= 1)).all() for o in found)
    # left and right are checked from the first frame on
    assert found[0].reference_landmarks is not None
    assert sum(o.reference_landmarks is not None for o in found) <= 1 + len(found) // 8


def test_two_people_are_tracked_and_nobody_twice(
    tracker_of_many: PeopleTracker, frames: Frames
) -> None:
    tracker_of_many.reset()
    for image in frames("clips/two_people_portrait", stop=9):
        observations = dict(tracker_of_many.step(image))
        assert sorted(observations) == [0, 1]
        assert observations[0].region.center_px[0] > 500 > observations[1].region.center_px[0]


# Between the shoulders of everybody in two photographs, read from these.
_SHOULDERS_PX = {
    # A man in front of the shelf hides nobody; one in green hides half of another one.
    "shelf_c0": [[280, 212], [375, 215], [580, 210], [895, 224]],
    # A man with a drill stands at the shoulder of a man in green, another one behind the shelf.
    "shelf_c1": [[453, 240], [555, 237], [755, 259], [930, 247]],
}


@pytest.mark.parametrize("photograph", _SHOULDERS_PX)
def test_everybody_who_stands_close_together_in_a_photograph_is_found(
    shared: Path, photograph: str
) -> None:
    path = shared / f"data/people/inputs/{photograph}.jpg"
    image = np.ascontiguousarray(cv2.imread(str(path))[:, :, ::-1]).astype(np.uint8)
    tracker = PeopleTracker("best", threads=2, people=12)
    shoulders_px = sorted(
        observation.keypoints_px[[11, 12]].mean(axis=0).tolist()
        for _, observation in tracker.step(image)
    )
    assert len(shoulders_px) == 4
    off_px = np.linalg.norm(np.array(shoulders_px) - _SHOULDERS_PX[photograph], axis=1)
    assert off_px.max() < 30  # of shoulders that are 140 pixels wide


def test_two_people_side_by_side_are_both_found(
    tracker_of_many: PeopleTracker, frames: Frames
) -> None:
    """Of two people before black, the brighter pixel counts; shoulders touch at 50 pixels."""
    left, right = (next(frames(f"people/inputs/plumb_studio_{name}")) for name in (383, 386))
    alone_px = []
    for image in (left, right):
        tracker_of_many.reset()
        ((_, alone),) = tracker_of_many.step(image)
        alone_px.append(alone.keypoints_px)
    shoulders_px = [keypoints_px[[11, 12]].mean(axis=0) for keypoints_px in alone_px]
    for apart_px in (-55, 70):
        moved = np.round(shoulders_px[0] - shoulders_px[1] + [apart_px, 0])
        shift = np.array([[1, 0, moved[0]], [0, 1, moved[1]]])
        image = np.maximum(left, cv2.warpAffine(right, shift, left.shape[1::-1]))
        tracker_of_many.reset()
        found = [observation.keypoints_px for _, observation in tracker_of_many.step(image)]
        assert len(found) == 2
        for truth_px in (alone_px[0], alone_px[1] + moved):
            off_px = min(
                np.linalg.norm(truth_px - keypoints_px, axis=1).mean() for keypoints_px in found
            )
            assert off_px < 20  # pixels of a person with a height of about 260


@pytest.mark.slow
def test_somebody_half_hidden_by_another_person_is_found_and_followed(frames: Frames) -> None:
    """The one in front hides one arm, half of the trunk and a leg."""
    tracker = PeopleTracker("best", threads=2, people=12)
    front, behind = (
        list(islice(frames(f"people/inputs/plumb_studio_{name}"), 8)) for name in (501, 378)
    )
    alone = []
    for images in (front, behind):
        tracker.reset()
        alone.append([tracker.step(image)[0][1] for image in images])
    shoulders_px = [seen[0].keypoints_px[[11, 12]].mean(axis=0) for seen in alone]
    moved = np.round(shoulders_px[0] - shoulders_px[1] + [67, 0])
    shift = np.array([[1, 0, moved[0]], [0, 1, moved[1]]])

    tracker.reset()
    off_px = []
    for k, (image, other) in enumerate(zip(front, behind, strict=True)):
        shown = _person_shown(tracker, image, alone[0][k].region)
        moved_image = cv2.warpAffine(other, shift, image.shape[1::-1])
        found = tracker.step(np.where(shown[..., None], image, moved_image))
        truth_px = alone[1][k].keypoints_px + moved
        off_px.append(
            min(np.linalg.norm(truth_px - o.keypoints_px, axis=1).mean() for _, o in found)
        )
        assert len(found) <= 2
    assert np.sum(np.array(off_px) < 30) >= 7  # of a person with a height of 260 pixels


def _person_shown(tracker: PeopleTracker, image: np.ndarray, region: Region) -> np.ndarray:
    """Return which pixels (H, W) of an image show the person of a region, by the network's mask."""
    assert tracker.mask_network is not None
    probability = tracker.mask_network.mask(image, region)
    corners_crop = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    pixels_crop = corners_crop * len(probability)
    pixels = region.image_from_crop(corners_crop)
    A = cv2.getAffineTransform(pixels_crop.astype(np.float32), pixels.astype(np.float32))
    return cv2.warpAffine(probability, A, image.shape[1::-1]) > 0.5


def test_masks_come_with_the_frame_for_which_they_were_requested(
    tracker: PeopleTracker, frames: Frames
) -> None:
    images = list(frames("clips/gesture_square", stop=6))
    found = [
        tracker.step(image, upcoming, upcoming_with_masks=k in (1, 2))[0][1]
        for k, (image, upcoming) in enumerate(zip(images, [*images[1:], None], strict=True))
    ]
    assert [o.mask is not None for o in found] == [False, False, True, True, False, False]
    tracker.reset()
    plain = [tracker.step(image)[0][1] for image in images]
    for one, other in zip(found, plain, strict=True):
        np.testing.assert_allclose(one.keypoints_px, other.keypoints_px, atol=0.1)
    mask = found[2].mask
    assert mask is not None
    assert mask.region == found[2].region
    assert mask.image_size == (images[0].shape[1], images[0].shape[0])
    at = (
        np.rint(mask.region.crop_from_image(found[2].keypoints_px) * 256 - 0.5)
        .astype(int)
        .clip(0, 255)
    )
    assert np.median(mask.probability[at[:, 1], at[:, 0]]) > 0.9


def test_odd_images(tracker: PeopleTracker) -> None:
    for shape in ((1, 1), (17, 5)):
        assert tracker.step(np.zeros((*shape, 3), np.uint8)) == []
