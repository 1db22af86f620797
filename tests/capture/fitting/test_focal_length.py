# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length from edges: drawn boxes seen by a known camera, and real images with known
calibration.
"""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera, pinhole
from scope.scope_addon.capture.camera.line_segments import Segments, find_segments
from scope.scope_addon.capture.camera.manhattan import Edges
from scope.scope_addon.capture.fitting.focal_length import camera_by_edges, focal_from_edges
from scope.solver.rotations import exp

from ..exact_tracks import pixels_of

WIDTH = 1280
HEIGHT = 720
ASSUMED_CAMERA = choose_camera(WIDTH, HEIGHT)
ASSUMED = ASSUMED_CAMERA.intrinsics[0, 0]


def room(focal_px, R_camera_room, clutter=20, seed=0, size=(WIDTH, HEIGHT)):
    """An image of edges along three orthogonal directions, with clutter in any direction."""
    rng = np.random.default_rng(seed)
    K = pinhole(*size, focal_px)
    picture = np.full((size[1], size[0], 3), 120, np.uint8)

    def line(a, b, colour):
        ends = np.array([a, b]) @ R_camera_room.T + [0, 0, 7.0]
        if (ends[:, 2] > 0.5).all():
            first, last = np.round(pixels_of(ends, K)).astype(int).tolist()
            cv2.line(picture, first, last, colour, 3, cv2.LINE_AA)

    for axis in range(3):
        for _ in range(14):
            a = rng.uniform([-3, -1.5, -3], [3, 1.5, 3])
            b = a.copy()
            b[axis] += rng.uniform(1.0, 3.0)
            line(a, b, (30, 30, 30))
    for _ in range(clutter):
        a = rng.uniform([-3, -1.5, -3], [3, 1.5, 3])
        line(a, a + rng.uniform(-0.7, 0.7, 3), (60, 60, 200))
    return picture


def found(picture):
    return focal_from_edges(find_segments(picture, []), WIDTH, HEIGHT, ASSUMED_CAMERA)


@pytest.mark.parametrize(
    ("ratio", "turn"), [(0.7, [0.1, 0.6, 0.0]), (1.0, [-0.15, -0.5, 0.1]), (1.4, [0.1, 0.6, 0.0])]
)
def test_a_room_seen_across_its_corner_determines_the_focal_length(ratio, turn):
    R = exp([turn[0], 0, 0]) @ exp([0, 0, turn[2]]) @ exp([0, turn[1], 0])
    estimate = found(room(ratio * ASSUMED, R))
    focal_px, deviation = estimate
    assert focal_px == pytest.approx(ratio * ASSUMED, rel=0.05)
    assert abs(np.log(focal_px / (ratio * ASSUMED))) < 3 * deviation + 0.01


def test_a_wall_seen_frontally_gives_no_estimate():
    wall = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    for k in range(12):
        cv2.line(wall, (60 + 100 * k, 80), (60 + 100 * k, 640), (30, 30, 30), 3)
        cv2.line(wall, (60, 80 + 50 * k), (1200, 80 + 50 * k), (220, 220, 220), 3)
    assert found(wall) is None


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_horizontal_edges_count_at_every_focal_length_without_vertical_ones(ratio):
    """Otherwise, a focal length at which two edges happen to meet vertically above would have no
    competitor.
    """
    floor = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    for y in (380, 400, 470, 690):
        cv2.line(floor, (40, y), (1240, y), (30, 30, 30), 3)
    for side in (-1, 1):  # a mat's, which meet at the horizon
        cv2.line(
            floor, (640 + side * 260, 470), (640 + side * 640, 690), (220, 220, 220), 3, cv2.LINE_AA
        )
    edges = Edges.of(find_segments(floor, []), WIDTH, HEIGHT)
    level = np.abs(edges.along[:, 1]) < 0.01
    assert level.sum() >= 4
    assert edges.support(ratio * ASSUMED) > 0.95 * edges.weight[level].sum()


def test_no_edges_give_no_estimate():
    assert focal_from_edges(Segments.none(), WIDTH, HEIGHT, ASSUMED_CAMERA) is None
    assert found(np.full((HEIGHT, WIDTH, 3), 90, np.uint8)) is None


@pytest.mark.parametrize("seed", range(2))
def test_random_edges_give_no_estimate(seed):
    rng = np.random.default_rng(seed)
    scribble = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    for _ in range(80):
        a = rng.uniform([50, 50], [1200, 650])
        b = a + rng.uniform(-150, 150, 2)
        cv2.line(scribble, tuple(map(int, a)), tuple(map(int, b)), (30, 30, 30), 3, cv2.LINE_AA)
    assert found(scribble) is None


def test_edges_of_a_phones_upright_picture_are_weighed_against_a_phones_lens():
    """Its edges tell the focal length; without any, that of phones is kept."""
    size = (HEIGHT, WIDTH)
    R = exp([0.1, 0, 0]) @ exp([0, 0.6, 0])
    focal_px = 0.9 * ASSUMED
    picture = room(focal_px, R, size=size)
    camera = camera_by_edges(find_segments(picture, []), *size, size)
    assert camera.intrinsics[0, 0] == pytest.approx(focal_px, rel=0.05)
    assert camera.source.startswith("estimated")
    assert camera_by_edges(Segments.none(), *size, size).source == "assumed, 65 degrees"


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_real_cameras(shared, number):
    """Four images of a laboratory; one of them has too few edges in depth and must not give an
    estimate.
    """
    folder = shared / "data" / "pose2sim"
    ok, picture = cv2.VideoCapture(str(folder / f"cam{number}.mp4")).read()
    assert ok
    height, width = picture.shape[:2]
    truth = json.loads((folder / f"calibration_cam{number}.json").read_text("utf-8"))["intrinsics"][
        0
    ][0]
    # so that what was assumed is no help
    assumed = replace(choose_camera(width, height), intrinsics=pinhole(width, height, 1.2 * truth))
    estimate = focal_from_edges(
        find_segments(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), []), width, height, assumed
    )
    if number == 4:
        assert estimate is None
    else:
        assert estimate[0] == pytest.approx(truth, rel=0.04)
