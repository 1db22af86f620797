# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage that goes on: a clip played there and back, so that nothing jumps where a round ends."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.capture.media.video import open_video
from ...scope_addon.cli import SAMPLE
from ...scope_addon.live.source import Clock, Picture, Playback
from ...scope_addon.notices import Notice
from ..frames import CACHE
from .observed import there_and_back

FPS = 30
OPTIONS = {"crf": "18", "preset": "veryfast"}  # of the encoder


def there_and_back_clip(
    seconds: float, size: tuple[int, int] | None = None, source: Path = SAMPLE
) -> Path:
    """Return a clip, there and back again for some seconds, as a video; cached in build/bench.

    :param size: to which the pictures are enlarged; None: their own.
    """
    name = source.stem if size is None else f"{source.stem}_{size[0]}x{size[1]}"
    target = CACHE / f"{name}_{seconds:g}s.mp4"
    if target.exists():
        return target
    with open_video(source) as video:
        pictures = [frame.image_rgb for frame in video]
        fps = video.fps
    if size is not None:
        pictures = [
            cv2.resize(picture, size, interpolation=cv2.INTER_CUBIC).astype(np.uint8)
            for picture in pictures
        ]
    order = there_and_back(len(pictures))
    CACHE.mkdir(parents=True, exist_ok=True)
    with atomic_path(target) as temporary:
        write_video(
            temporary,
            [pictures[order[k % len(order)]] for k in range(round(seconds * fps))],
            fps,
            OPTIONS,
        )
    return target


def there_and_back_truth(truth: Path, count: int, frames: int, target: Path) -> None:
    """Write the ground truth of a clip of ``count`` frames for the ``frames`` of
    `there_and_back_clip`.

    :param truth: with a row for each of its ``frame_index`` in every array of that length.
    """
    with np.load(truth) as file:
        values = {key: file[key] for key in file.files}
    row_of = {int(frame): row for row, frame in enumerate(values["frame_index"])}
    order = there_and_back(count)
    rows = {
        k: row_of[order[k % len(order)]] for k in range(frames) if order[k % len(order)] in row_of
    }
    looped = {
        key: value[list(rows.values())] if value.ndim and len(value) == len(row_of) else value
        for key, value in values.items()
    }
    np.savez(target, **(looped | {"frame_index": np.array(list(rows))}))


def write_video(
    path: Path, pictures: list[NDArray[np.uint8]], fps: Fraction, options: dict[str, str]
) -> None:
    """Write RGB pictures as H.264 in an .mp4 file.

    :param options: of the encoder.
    """
    with av.open(str(path), "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=fps, options=options)
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())


class RepeatedFile:
    """A source that plays a video again and again, in real time, for some seconds."""

    ends = True
    focal_35mm: float | None = None

    def __init__(self, path: Path, seconds: float) -> None:
        self._path = path
        self._seconds = seconds
        self.name = path.name
        self.fps = Fraction(FPS)
        self.speed = 1.0
        self.warnings: list[Notice] = []

    def pictures(self, clock: Clock) -> Iterator[Picture]:
        """See `Source`."""
        playback = Playback(clock)
        index = 0
        while True:
            with open_video(self._path) as video:
                for frame in video:
                    time_s = index / FPS
                    if time_s >= self._seconds:
                        return
                    yield Picture(index, time_s, playback.wait(time_s), frame.image_rgb)
                    index += 1
