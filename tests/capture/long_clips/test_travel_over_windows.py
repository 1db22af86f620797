# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera that slowly travels past walls behind each other, observed in two windows."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.background_record import joined_backgrounds
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.capture.clock import StageClock
from scope.scope_addon.capture.frame_observer import FrameObserver, Observed, Trackers, Window
from scope.scope_addon.capture.long_clips.windowed_clip import run_windows
from scope.scope_addon.capture.media.frame import Frame

WIDTH, HEIGHT = 480, 270
FOCAL_PX = 400.0
FPS = 12.0
FRAMES = 72
# The trackers of the second window begin 1.5 s before it.
WINDOWS = (Window(0, 0.0, 0.0, 3.0), Window(1, 1.5, 3.0, np.inf))
SPEED_M_S = 0.15
# Distances of walls, from the top of the picture to its bottom.
WALLS_M = (12.0, 3.0, 6.0)


def texture(rng: np.random.Generator) -> np.ndarray:
    coarse = cv2.resize(rng.uniform(0, 255, (128, 128)), (1024, 1024))
    return (0.5 * coarse + 0.5 * cv2.resize(rng.uniform(0, 255, (400, 400)), (1024, 1024))).astype(
        np.uint8
    )


def frames() -> Iterator[Frame]:
    """The clip: the camera travels to the right."""
    plane = texture(np.random.default_rng(0))
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    depth = np.repeat(WALLS_M, HEIGHT // len(WALLS_M))[:, None]
    for k in range(FRAMES):
        right = x + FOCAL_PX * SPEED_M_S * k / FPS / depth
        grey = cv2.remap(plane, right.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
        yield Frame(k, k / FPS, np.repeat(grey[..., None], 3, axis=2).astype(np.uint8))


def no_people() -> Trackers:
    people = SimpleNamespace(step=lambda *_: [], forget=lambda: None, mask_network=None)
    return Trackers(people, None, None)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_camera_has_one_path_over_both_windows():
    camera = Camera(pinhole(WIDTH, HEIGHT, FOCAL_PX), np.zeros(5), "given")
    video = SimpleNamespace(width=WIDTH, height=HEIGHT, expected_frames=FRAMES)
    records: list[Observed] = []

    with ThreadPoolExecutor(1) as pool:

        def begin(window: Window) -> FrameObserver:
            following = WINDOWS[1] if window.number == 0 else None
            return FrameObserver(video, no_people(), camera, pool, StageClock(), window, following)

        def seam(ended: FrameObserver, following: FrameObserver | None) -> FrameObserver | None:
            records.append(ended.observed())
            return following

        whole = list(frames())
        pairs = zip(whole, [*whole[1:], None], strict=True)
        run_windows(WINDOWS, begin, pairs, seam, lambda *_: None)

    joined = joined_backgrounds(
        [record.background for record in records], [record.first for record in records]
    )
    found = joined.motion(camera, camera, (WIDTH, HEIGHT)).travel
    assert found is not None
    assert (found.part[:-2] == 0).all()  # the picture has hardly moved in the last frames
    true = SPEED_M_S / FPS * np.arange(FRAMES)[:, None] * [1.0, 0.0, 0.0]
    scale = (found.center * true).sum() / (found.center**2).sum()
    off = np.linalg.norm(scale * found.center - true, axis=1)
    assert off.max() < 0.03 * true[-1, 0]
