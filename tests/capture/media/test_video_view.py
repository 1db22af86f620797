# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos, pictures and sequences that are turned and mirrored on request; variable frame rates."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.footage_view import FootageView

from .corner_picture import corner_image, corners
from .made_video import write_film, write_video


def files(folder: Path) -> list[Path]:
    picture = corner_image()[..., ::-1]
    names = ["still.png", "film_1.png", "film_2.png"]
    for name in names:
        cv2.imwrite(str(folder / name), picture)
    film = write_video(folder / "a.mp4", [corner_image()] * 2)
    return [film, folder / "still.png", folder / "film_#.png"]


@pytest.mark.parametrize("asked", [(0, True), (90, False), (180, False)])
def test_footage_of_every_kind_is_turned_and_mirrored(
    tmp_path: Path, asked: tuple[int, bool]
) -> None:
    expected = None
    for path in files(tmp_path):
        wanted = VideoRange(view=FootageView(*asked))
        with open_video(path, wanted) as video:
            frame = next(iter(video)).image_rgb
            assert (video.width, video.height) == frame.shape[1::-1]
        turned = np.rot90(corner_image(), -asked[0] // 90)
        expected = corners(np.ascontiguousarray(turned[:, ::-1] if asked[1] else turned))
        assert corners(frame) == expected


@pytest.mark.parametrize(("stated", "speed"), [("240.000000", 8.0), ("30.0", 1.0), ("x", 1.0)])
def test_slow_motion_is_read_from_a_phones_file(tmp_path: Path, stated: str, speed: float) -> None:
    metadata = {"com.android.capture.fps": stated}
    path = write_film(
        tmp_path / "a.mp4", [corner_image()] * 10, "mpeg4", rate=30, metadata=metadata
    )
    with open_video(path) as video:
        assert video.recorded_speed == pytest.approx(speed)


@pytest.mark.parametrize("sizes", [[(96, 64), (192, 128)], [(192, 128), (96, 64)]])
def test_the_largest_of_several_films_is_read(tmp_path: Path, sizes: list[tuple[int, int]]) -> None:
    """The others are previews, also where they come first and are marked as the default."""
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as container:
        streams = []
        for width, height in sizes:
            stream = container.add_stream("mpeg4", rate=30)
            stream.width, stream.height = width, height
            streams.append(stream)
        for _ in range(5):
            for stream in streams:
                level = stream.width  # tells the films apart
                image = np.full((stream.height, stream.width, 3), level, np.uint8)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        for stream in streams:
            container.mux(stream.encode())
    with open_video(path) as video:
        frames = [frame.image_rgb for frame in video]
    assert len(frames) == 5
    assert frames[0].shape == (128, 192, 3)
    assert abs(float(frames[0].mean()) - 192) < 8
