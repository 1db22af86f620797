# SPDX-License-Identifier: GPL-3.0-or-later
"""Edges that people hide at first: drawn rooms with a known camera, through which somebody
walks.
"""

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scope.scope_addon.capture.camera.camera_rotation import BackgroundTracker
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.capture.camera.line_segments import Lines
from scope.scope_addon.capture.camera.verticals import estimate_up_from_lines
from scope.solver.rotations import exp

WIDTH = 720
HEIGHT = 720
FPS = 12.0
K = pinhole(WIDTH, HEIGHT, 750.0)
CAMERA = Camera(K, np.zeros(5), "given")
R_CAMERA_LEVEL = exp([np.radians(8.0), 0.0, 0.0])
UP = R_CAMERA_LEVEL @ [0.0, -1.0, 0.0]
LEAN_DEG = 16.0  # of the books, towards the wall
HEIGHT_PX = np.array([40.0, 680.0])  # of the person, from head to feet


@cache
def office() -> NDArray[np.uint8]:
    """A cupboard on the left, whose shelves determine one horizontal direction, books leaning in
    it, and a door.

    The cupboard's posts are seen from one side, so that lines along them agree with any direction
    in a plane: with that of the books as well as with up.
    """
    noise = np.random.default_rng(5).integers(110, 130, (90, 90), np.uint8)
    picture = cv2.resize(
        np.repeat(noise[..., None], 3, axis=2), (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC
    )

    def line(through: NDArray[np.float64], along: NDArray[np.float64], half_m: float) -> None:
        ends = (
            np.array([through - half_m * along, through + half_m * along]) @ R_CAMERA_LEVEL.T @ K.T
        )
        (x0, y0), (x1, y1) = np.round(ends[:, :2] / ends[:, 2:] * 16).astype(int).tolist()
        cv2.line(picture, (x0, y0), (x1, y1), (30, 30, 30), 3, cv2.LINE_AA, shift=4)

    up = np.array([0.0, -1.0, 0.0])
    post = np.array([-1.2, 0.0, 4.0])
    shelf = np.cross(up, post) / np.linalg.norm(post)
    book = exp(np.radians(LEAN_DEG) * shelf) @ up
    for x in (-0.06, 0.0, 0.06):
        line(post + x * shelf, up, 1.2)
    for y in (-0.9, -0.5, -0.1, 0.3, 0.7):
        line(post + y * up, shelf, 0.5)
        for x in (-0.4, -0.3, 0.25, 0.35):
            line(post + (y + 0.2) * up + x * shelf, book, 0.13)
    for x in (0.9, 1.05, 1.6, 1.8):
        line(np.array([x, 0.0, 4.0]), up, 1.2)
    return picture.astype(np.uint8)


def person_at(x: float) -> NDArray[np.float64]:
    return np.array([[x - 90.0, HEIGHT_PX[0]], [x + 90.0, HEIGHT_PX[1]]])


def lines_after(
    positions: list[float], picture: Callable[[int], NDArray[np.uint8]] | None = None, cut: int = -1
) -> Lines:
    """The lines after a walk; somebody is drawn as a striped box, so that it has edges of its
    own.
    """
    tracker = BackgroundTracker(CAMERA, WIDTH, HEIGHT)
    background = office()
    for k, x in enumerate(positions):
        image = (picture(k) if picture else background).copy()
        low, high = person_at(x).round().astype(int)
        left = max(low[0], 0)
        image[low[1] : high[1], left : high[0]] = 60
        for stripe in range(left + 10, high[0], 20):
            cv2.line(image, (stripe, int(low[1])), (stripe + 60, int(high[1])), (200, 200, 200), 3)
        tracker.add(image, k / FPS, [person_at(x)], is_cut=k == cut)
    record = tracker.record()
    return record.lines(record.motion(CAMERA, CAMERA, (WIDTH, HEIGHT)), CAMERA)


def angle_deg(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


def off_deg(lines: Lines, lean_deg: float = 0.0) -> float:
    """How far up is off, for bodies that lean away from the camera."""
    found = estimate_up_from_lines(lines, exp([np.radians(lean_deg), 0.0, 0.0]) @ UP).up
    assert found is not None
    return angle_deg(found, UP)


def test_a_door_that_somebody_hid_at_first_decides_which_way_is_up() -> None:
    there = [560.0] * 4
    away = list(np.linspace(560.0, 300.0, 12))
    assert off_deg(lines_after(there), 4.0) > 8.0  # the cupboard alone has near-equal solutions
    assert off_deg(lines_after(there + away), 4.0) < 1.0


def test_another_scene_adds_no_edges() -> None:
    first = office()
    other = office()[:, ::-1]
    positions = [560.0, *np.linspace(560.0, 300.0, 12)]
    lines = lines_after(positions, lambda k: other if k >= 1 else first, cut=1)
    assert len(lines.lengths) == len(lines_after(positions[:1]).lengths)
