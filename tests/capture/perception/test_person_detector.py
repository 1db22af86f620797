# SPDX-License-Identifier: GPL-3.0-or-later
"""The person detector: its parts against results by hand, the whole on real images.

Clusters of overlapping boxes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.perception.person_detector import (
    FOR_SMALL,
    IN_PARTS,
    Detection,
    PersonDetector,
    grid_of_squares,
    merge_overlapping,
    overlap_clusters,
    possible_regions,
    squares,
    unique,
)

from ..composites import beside, distant_view


@pytest.fixture(scope="module")
def detector(networks: Path) -> PersonDetector:
    return PersonDetector(threads=1)


def test_overlapping_boxes_become_their_weighted_mean() -> None:
    far: list[float] = [100, 100, 110, 110, 1, 1]
    values = np.array([[0, 0, 10, 10, 4, 4], far, [0, 2, 10, 12, 4, 8]], float)
    score, merged = merge_overlapping(np.array([0.9, 0.8, 0.3]), values)
    np.testing.assert_allclose(score, [0.9, 0.8])
    np.testing.assert_allclose(merged, [[0, 0.5, 10, 10.5, 4, 5], far])


def detection(score: float, shoulders: tuple[float, float], hips: tuple[float, float]) -> Detection:
    """A person whose body circle has a radius of 100 pixels; the region's side is then 250."""
    trunk = np.subtract(hips, shoulders)
    length = float(np.linalg.norm(trunk))
    up = np.array([0.0, -1.0]) if length == 0 else -trunk / length
    top = hips + 100 * up
    return Detection(score, np.zeros(4), np.array([hips, top, shoulders, top], float))


@pytest.mark.parametrize(
    ("shoulders", "hips", "is_kept"),
    [
        ((212, 100), (225, 150), False),  # the same person, seen a little differently
        ((240, 100), (210, 150), True),  # somebody beside, whose hips are pulled here
        ((240, 100), (300, 150), True),  # somebody whose hips are elsewhere
        ((205, 140), (205, 190), False),  # the same trunk, further down
        ((200, 200), (200, 150), False),  # legs, which look like a body upside down
        ((240, 150), (240, 150), False),  # without shoulders, nothing tells that it is another
    ],
)
def test_people_with_shoulders_of_their_own_are_no_duplicates(
    shoulders: tuple[float, float], hips: tuple[float, float], is_kept: bool
) -> None:
    best = detection(0.9, (200, 100), (200, 150))
    other = detection(0.7, shoulders, hips)
    assert unique([other, best]) == ([best, other] if is_kept else [best])


def test_hips_that_pull_each_other_are_put_below_the_shoulders() -> None:
    """The trunks of three people in a row are vertical; the outer ones lean to the middle one."""
    row = [
        detection(0.9, (200, 100), (200, 160)),
        detection(0.8, (160, 100), (180, 160)),
        detection(0.7, (240, 100), (220, 160)),
    ]
    for person, expected in zip(row, [(200, 160), (160, 160), (240, 160)], strict=True):
        own, apart = possible_regions(person, row)
        assert own == person.region
        assert apart.center_px == pytest.approx(expected)
        assert apart.rotation == pytest.approx(0)
        assert 0.7 < apart.side_px / own.side_px < 1


def test_somebody_who_stands_apart_has_one_region() -> None:
    leaning = detection(0.9, (200, 100), (230, 150))
    distant = detection(0.8, (400, 100), (380, 150))
    small = Detection(0.7, np.zeros(4), np.array([[240, 150], [240, 130], [240, 140], [240, 130]]))
    legs = detection(0.6, (230, 200), (225, 150))
    for person in (leaning, distant, small):
        assert possible_regions(person, [leaning, distant, small, legs]) == [person.region]


def test_squares_cover_an_oblong_image() -> None:
    assert squares(500, 500) == []
    assert squares(1080, 1920) == [(0, 0, 1080), (840, 0, 1080)]
    assert squares(900, 300) == [(0, 0, 300), (0, 300, 300), (0, 600, 300)]


@pytest.mark.parametrize(("height", "width"), [(48, 64), (192, 108), (31, 29), (1, 500)])
@pytest.mark.parametrize(("side", "step", "share"), [(1 / 3, 0.6, 0.4 / 3), (0.6, 2 / 3, 0.2)])
def test_every_small_person_is_entirely_in_a_square(
    height: int, width: int, side: float, step: float, share: float
) -> None:
    left, top, side = np.array(grid_of_squares(height, width, side, step)).T
    assert min(left.min(), top.min()) == 0
    assert [(left + side).max(), (top + side).max()] == [width, height]
    person = int(share * min(height, width) - 1)  # corners of squares are whole pixels
    for x in range(0, width - person, 3):
        for y in range(0, height - person, 3):
            around = (
                (left <= x) & (x + person <= left + side) & (top <= y) & (y + person <= top + side)
            )
            assert around.any()


def test_a_small_person_is_found_in_the_small_squares_alone(
    detector: PersonDetector, first_frame: Callable[[str], np.ndarray]
) -> None:
    image = first_frame("clips/squats_5fps")
    (person,) = detector.detect(image)
    distant = distant_view(image)
    assert detector.detect(distant, closely=True) == []
    (small,) = detector.detect_smaller(distant, FOR_SMALL)
    expected = (person.points_px[:2] + 0.5) / 8 - 0.5 + [400, 200]
    assert np.abs(small.points_px[:2] - expected).max() < 0.05 * person.region.side_px / 8


def test_a_small_person_beside_a_larger_one_is_found_in_the_parts_alone(
    detector: PersonDetector, first_frame: Callable[[str], np.ndarray]
) -> None:
    large = first_frame("clips/gesture_square")
    small = first_frame("clips/squats_5fps")
    (person,) = detector.detect(small)
    image = beside(large, small)
    (other,) = detector.detect(image, closely=True)
    assert other.points_px[0, 0] < 576
    scale = 180 / small.shape[0]
    expected = (person.points_px[:2] + 0.5) * scale - 0.5 + [800, 200]
    others = detector.detect_smaller(image, IN_PARTS)
    off = [np.abs(found.points_px[:2] - expected).max() for found in others]
    assert min(off) < 0.05 * person.region.side_px * scale
    assert len(off) == 2


def test_finds_the_squatting_person(
    detector: PersonDetector, first_frame: Callable[[str], np.ndarray]
) -> None:
    (person,) = detector.detect(first_frame("clips/squats_5fps"))
    assert person.score > 0.9
    left, top, right, bottom = person.box_px
    assert 0 < left < right < 720
    assert 0 < top < bottom < person.points_px[0, 1]  # the face is above the hips
    assert 0.2 < (right - left) / person.region.side_px < 0.3
    assert abs(person.region.rotation) < 0.3


def test_detections_follow_the_image(
    detector: PersonDetector, first_frame: Callable[[str], np.ndarray]
) -> None:
    image = first_frame("clips/gesture_square")
    (person,) = detector.detect(image)
    bordered = np.zeros((800, 900, 3), np.uint8)
    bordered[100:676, 200:776] = image
    (moved,) = detector.detect(bordered)
    assert (
        np.abs(moved.points_px[:2] - person.points_px[:2] - [200, 100]).max()
        < 0.04 * person.region.side_px
    )
    (mirrored,) = detector.detect(np.ascontiguousarray(image[:, ::-1]))
    assert (
        np.abs(575 - mirrored.points_px[:2, 0] - person.points_px[:2, 0]).max()
        < 0.04 * person.region.side_px
    )


def test_finds_both_people(
    detector: PersonDetector, first_frame: Callable[[str], np.ndarray]
) -> None:
    found = detector.detect(first_frame("clips/two_people_portrait"))
    assert len(found) == 2
    assert not found[0].region.resembles(found[1].region, 0.2)


def test_no_detections_in_a_blank_image(detector: PersonDetector) -> None:
    blank = np.full((90, 160, 3), 128, np.uint8)
    assert detector.detect(blank) == detector.detect_smaller(blank, IN_PARTS) == []


@pytest.mark.parametrize("quarter_turns", [1, 2, 3])
def test_a_detection_in_a_turned_picture_is_turned_back(quarter_turns: int) -> None:
    """Marked pixels tell where the corners of the box, the hips and the head are."""
    places = np.array([[3, 5], [14, 9], [7, 2], [11, 6]])  # x, y
    image = np.zeros((20, 31), int)
    image[places[:, 1], places[:, 0]] = [1, 2, 3, 4]
    turned = np.rot90(image, quarter_turns)
    row, column = zip(*(np.argwhere(turned == k)[0] for k in (1, 2, 3, 4)), strict=True)
    points = np.stack([column, row], axis=1).astype(float)
    corners = [points[:2].min(axis=0), points[:2].max(axis=0)]
    found = Detection(0.9, np.concatenate(corners), points[2:]).turned_back(quarter_turns, 31, 20)
    np.testing.assert_array_equal(found.points_px, places[2:])
    np.testing.assert_array_equal(found.box_px, [3, 5, 14, 9])
    assert found.score == 0.9


def iou(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union by counting unit squares of boxes with whole corners."""
    inside = [
        {(x, y) for x in range(int(p[0]), int(p[2])) for y in range(int(p[1]), int(p[3]))}
        for p in (a, b)
    ]
    return len(inside[0] & inside[1]) / len(inside[0] | inside[1])


def test_each_box_is_in_the_cluster_of_the_best_box_that_it_overlaps():
    rng = np.random.default_rng(3)
    low = rng.integers(0, 12, (40, 2))
    boxes = np.concatenate([low, low + rng.integers(1, 9, (40, 2))], axis=1).astype(float)
    clusters = [cluster.tolist() for cluster in overlap_clusters(boxes, 0.3)]
    expected = []
    for k in range(len(boxes)):
        for cluster in expected:
            if iou(boxes[cluster[0]], boxes[k]) > 0.3:
                cluster.append(k)
                break
        else:
            expected.append([k])
    assert clusters == expected
    assert 1 < len(clusters) < len(boxes)
