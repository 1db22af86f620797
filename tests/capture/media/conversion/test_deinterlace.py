# SPDX-License-Identifier: GPL-3.0-or-later
"""Deinterlacing: images of one moment, and exactly as many of them, at the same times, however they
are reached.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.media.deinterlace import deinterlaced
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange

from ..made_video import write_film
from .made_field_pictures import write_field_pictures
from .made_frames import av, marked, with_fields

HEIGHT = 48
WIDTH = 96


def moving_bar(k: int) -> np.ndarray:
    """A light bar that moves by 3 pixels per field over a soft background."""
    image = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    image[:] = np.linspace(40, 90, HEIGHT)[:, None, None]
    image[:, 3 * k % 72 : 3 * k % 72 + 12] = 220
    return image


def grey(frame) -> np.ndarray:
    return frame.to_ndarray(format="gray").astype(int)


def times(frames) -> list[tuple]:
    return [(frame.pts, frame.time_base) for frame in frames]


@pytest.mark.parametrize("order", ["tff", "bff"])
def test_images_are_those_of_the_first_field(order: str) -> None:
    pictures = [moving_bar(k) for k in range(16)]
    woven = with_fields(pictures, order)
    shown = list(deinterlaced(woven))
    assert times(shown) == times(woven)
    for k, (frame, comb) in enumerate(zip(shown, woven, strict=True)):
        whole = grey(
            av.VideoFrame.from_ndarray(pictures[2 * k], format="rgb24").reformat(format="yuv420p")
        )
        assert np.abs(grey(comb) - whole).max() > 100
        assert np.abs(grey(frame) - whole).max() < 12, k  # also of the first and the last frame
        first = slice(0 if order == "tff" else 1, None, 2)
        assert np.array_equal(grey(frame)[first], grey(comb)[first])
        assert not frame.interlaced_frame


def test_where_nothing_moves_every_line_is_kept() -> None:
    still = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 1), np.uint8).repeat(3, 2)
    woven = with_fields([still] * 12)
    for frame, whole in zip(list(deinterlaced(woven))[1:-1], woven[1:-1], strict=True):
        assert np.abs(grey(frame) - grey(whole)).max() <= 1


@pytest.mark.parametrize("count", [0, 1, 3])
def test_no_frame_is_added_or_lost(count: int) -> None:
    woven = with_fields([moving_bar(k) for k in range(2 * count)]) if count else []
    assert times(deinterlaced(woven)) == times(woven)


def test_progressive_frames_among_interlaced_ones_are_left_alone() -> None:
    woven = with_fields([moving_bar(k) for k in range(24)])
    mixed = [
        marked([frame], "prog")[0] if k in (0, 1, 4, 5, 6, 11) else frame
        for k, frame in enumerate(woven)
    ]
    for k, frame in enumerate(mixed):
        frame.pts = 10 * k + k % 3
    shown = list(deinterlaced(mixed))
    assert times(shown) == times(mixed)
    changed = [not np.array_equal(grey(a), grey(b)) for a, b in zip(shown, mixed, strict=True)]
    assert [k for k in range(12) if not changed[k]] == [0, 1, 4, 5, 6, 11]


def test_a_change_of_size_or_format_loses_no_frame() -> None:
    large = with_fields([moving_bar(k) for k in range(6)])
    small = with_fields([moving_bar(k)[:32] for k in range(6)])
    other = with_fields([moving_bar(k) for k in range(6)], pixels="yuv422p")
    frames = [*large, *small, *other]
    shown = list(deinterlaced(frames))
    assert [(f.height, f.format.name) for f in shown] == [(f.height, f.format.name) for f in frames]
    assert times(shown) == times(frames)
    assert not np.array_equal(grey(shown[4]), grey(frames[4]))


def test_images_of_few_lines_stay_as_they_are() -> None:
    frames = with_fields([moving_bar(k)[:2] for k in range(8)], pixels="yuv444p")
    assert all(a is b for a, b in zip(deinterlaced(frames), frames, strict=True))


@pytest.mark.parametrize(("broken", "after"), [("vpush", 0), ("vpull", 4), ("configure", 0)])
def test_a_filter_that_fails_loses_no_frame(monkeypatch, broken: str, after: int) -> None:
    class Failing:
        """The graph, one method of which fails from a certain call on."""

        def __init__(self) -> None:
            self.graph = graph()
            self.calls = 0

        def __getattr__(self, name: str):
            if name == broken:
                self.calls += 1
                if self.calls > after:
                    raise av.error.MemoryError(12, "no memory")
            return getattr(self.graph, name)

        def link_nodes(self, *nodes):
            self.graph.link_nodes(*nodes)
            return self

    woven = with_fields([moving_bar(k) for k in range(14)])
    graph = av.filter.Graph
    monkeypatch.setattr(av.filter, "Graph", Failing)
    shown = list(deinterlaced(woven))
    assert times(shown) == times(woven)
    assert shown[-1] is woven[-1]


def write(path: Path, count: int, rate: int, codec: str = "libx264", order: str = "tff") -> Path:
    """Encode ``count`` interlaced frames of a moving bar."""
    pixels = "yuv422p10le" if codec == "prores_ks" else "yuv420p"
    frames = with_fields([moving_bar(k) for k in range(2 * count)], order, pixels)
    flags = "+ildct+ilme" if codec == "mpeg2video" else "+ildct"
    return write_film(path, frames, codec, pixels, rate, options={"flags": flags})


def combs(image: np.ndarray) -> float:
    """Return how much lines differ from the mean of the lines above and below them."""
    lines = image[..., 1].astype(float)
    return float(np.abs(lines[1:-1] - (lines[:-2] + lines[2:]) / 2).max())


FILES = {  # codec, order of the fields
    "avchd.mts": ("libx264", "tff"),
    "tape.mpg": ("mpeg2video", "bff"),
    "editor.mov": ("prores_ks", "tff"),
    "archive.mkv": ("ffv1", "bff"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_are_read_without_combs(tmp_path: Path, name: str) -> None:
    codec, order = FILES[name]
    path = write(tmp_path / name, 12, 25, codec, order)
    with av.open(str(path)) as container:
        decoded = list(container.decode(video=0))
    assert all(frame.interlaced_frame for frame in decoded)
    with open_video(path) as video:
        frames = list(video)
    assert len(frames) == len(decoded) == 12
    start = decoded[0].pts
    assert [f.timestamp_s for f in frames] == pytest.approx(
        [float((f.pts - start) * f.time_base) for f in decoded]
    )
    assert min(combs(frame.to_ndarray(format="rgb24")) for frame in decoded) > 100
    assert max(combs(frame.image_rgb) for frame in frames) < 40


def test_fields_that_are_pictures_of_their_own_are_read_as_frames(tmp_path: Path) -> None:
    """As camcorders write them. The bar moves by 3 pixels per field, and is where the first field
    has it; a part begins in the same frame.
    """
    pictures = [moving_bar(k)[..., 0].repeat(2, 0)[:96] for k in range(100)]
    path = write_field_pictures(tmp_path / "a.mts", pictures)
    with av.open(str(path)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
    assert len(packets) == len(pictures)
    with open_video(path) as video:
        assert video.fps == video.average_fps == 25
        assert video.expected_frames == 50
        frames = list(video)
    assert [f.timestamp_s for f in frames] == pytest.approx([k / 25 for k in range(50)])
    for k, frame in enumerate(frames):
        assert combs(frame.image_rgb) < 40
        light = np.flatnonzero(frame.image_rgb[48, :, 1] > 150)
        assert light.tolist() == [6 * k % 72 + i for i in range(12)]
    with open_video(path, VideoRange(1.0, 1.2)) as video:
        assert [frame.index for frame in video] == [25, 26, 27, 28, 29, 30]


def images(path: Path, wanted: VideoRange | None = None) -> dict[int, tuple[float, np.ndarray]]:
    with open_video(path, wanted) as video:
        return {frame.index: (frame.timestamp_s, frame.image_rgb) for frame in video}


def test_ranges_show_the_frames_of_the_whole(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mp4", 30, 10)
    whole = images(path)
    for wanted, indices in (
        (VideoRange(0.5, 1.2), range(5, 13)),
        (VideoRange(2.9), [29]),
        (VideoRange(0, 0.05), [0]),
    ):
        part = images(path, wanted)
        assert list(part) == list(indices)
        for index, (time, image) in part.items():
            assert time == whole[index][0]
            assert np.array_equal(image, whole[index][1]), index
