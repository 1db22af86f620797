# SPDX-License-Identifier: GPL-3.0-or-later
"""Bars: found where they are, not in dark scenes or doorways; and the camera that is assumed
between them.
"""

from fractions import Fraction

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.bars import content_size, find_bars
from scope.scope_addon.capture.camera.camera_rotation import BackgroundTracker
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.camera.line_segments import find_segments

WIDTH = 960
HEIGHT = 540


def scene(width: int, height: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def barred(
    left: int = 0, right: int = 0, top: int = 0, bottom: int = 0, black: int = 0
) -> np.ndarray:
    noise = np.random.default_rng(1).integers(0, 9, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    picture = black + noise
    picture[top : HEIGHT - bottom, left : WIDTH - right] = scene(
        WIDTH - left - right, HEIGHT - top - bottom
    )
    return picture


@pytest.mark.parametrize("sides", [(328, 328, 0, 0), (0, 0, 70, 70), (120, 121, 30, 30)])
def test_bars_are_found(sides: tuple[int, int, int, int]) -> None:
    left, right, top, bottom = sides
    bars = find_bars(barred(*sides, black=8))
    inside = np.ones((HEIGHT, WIDTH), bool)
    for x0, y0, x1, y1 in np.array(bars).round().astype(int):
        inside[y0:y1, x0:x1] = False
    expected = np.zeros((HEIGHT, WIDTH), bool)
    expected[top : HEIGHT - bottom, left : WIDTH - right] = True
    assert (inside == expected).mean() > 0.995
    size = (WIDTH - left - right, HEIGHT - top - bottom)
    assert content_size(bars, WIDTH, HEIGHT) == pytest.approx(size, abs=4)


@pytest.mark.parametrize(("kind", "upright"), [("blurred", False), ("white", True)])
def test_bars_of_other_kinds_are_found(kind: str, upright: bool) -> None:
    """A portrait clip in front of its own blurred copy, as broadcasters show it, or of a plain
    colour.
    """
    clip = cv2.resize(scene(30, 54), (300, 540), interpolation=cv2.INTER_CUBIC)
    picture = np.full((540, 960, 3), 235, np.uint8)
    if kind == "blurred":
        blurred = cv2.GaussianBlur(cv2.resize(clip, (96, 172)), (0, 0), 5)[60:114]
        picture = np.asarray(cv2.resize(blurred, (960, 540)), np.uint8)
    picture[:, 330:630] = clip
    if upright:
        picture = picture.transpose(1, 0, 2).copy()
    data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 80])[1]
    bars = find_bars(np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8))
    sizes = [bar[[3, 2]] if upright else bar[[2, 3]] for bar in bars]
    assert sizes[0][0] == pytest.approx(330, abs=2)
    content = (540, 300) if upright else (300, 540)
    assert content_size(bars, *picture.shape[1::-1]) == pytest.approx(content, abs=4)


def above_a_floor(step: float) -> np.ndarray:
    """A clip of somebody on a plain floor, in front of its own blurred copy, whose floor is darker
    by ``step`` of 255 where the clip ends.
    """
    clip = cv2.resize(scene(54, 30), (540, 300), interpolation=cv2.INTER_CUBIC)
    clip[250:] = np.linspace(150.0, 160.0, 540).astype(np.uint8)[None, :, None]
    picture = np.full((960, 540, 3), 60, np.uint8)
    picture[330:630] = clip
    picture[630:] = np.linspace(150.0 - step, 160.0 - step, 540).astype(np.uint8)[None, :, None]
    return picture


def test_a_bar_whose_floor_goes_on_from_the_picture_s_is_found() -> None:
    """By a step too faint to tell alone, opposite a clear one."""
    picture = above_a_floor(5.0)
    bars = find_bars(picture)
    assert content_size(bars, *picture.shape[1::-1]) == pytest.approx((540, 300), abs=4)
    assert find_bars(above_a_floor(0.0)) == []
    picture[:340] = picture[340]  # nor does a faint step tell anything alone
    assert find_bars(picture) == []


@pytest.mark.parametrize(
    "picture",
    [
        scene(WIDTH, HEIGHT),
        np.zeros((HEIGHT, WIDTH, 3), np.uint8),
        barred(top=200),  # a night sky
        barred(left=100, right=300),
        barred(left=10, right=10),
    ],
    ids=["none", "black", "one side", "of two widths", "thin"],
)
def test_other_pictures_have_no_bars(picture: np.ndarray) -> None:
    assert find_bars(picture) == []
    assert content_size([], WIDTH, HEIGHT) == (WIDTH, HEIGHT)


def test_edges_of_bars_are_neither_lines_nor_corners() -> None:
    """A picture that moves between fixed bars: a camera that rotates."""
    camera = choose_camera(WIDTH, HEIGHT)
    wide = np.kron(scene(80, 36), np.ones((15, 15, 1), np.uint8))
    person = [np.array([[470.0, 200.0], [490.0, 340.0]])]
    tracker = BackgroundTracker(camera, WIDTH, HEIGHT)
    for k in range(12):
        picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        picture[:, 328:632] = wide[:, 6 * k : 6 * k + 304]
        tracker.add(picture, float(k * Fraction(1, 10)), person)
    assert len(tracker.bars) == 2
    edges = find_segments(picture, person, bars=tracker.bars)
    assert not (np.abs(edges.ends_px[:, :, 0].mean(axis=1)[:, None] - [328, 632]) < 4).any()
    angle = np.degrees(np.arctan(6 * 11 / camera.intrinsics[0, 0]))
    motion = tracker.record().motion(camera, camera, (WIDTH, HEIGHT))
    assert motion.largest_turn_deg == pytest.approx(angle, rel=0.1)
