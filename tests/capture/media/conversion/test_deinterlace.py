# SPDX-License-Identifier: GPL-3.0-or-later
"""Deinterlacing: images of one moment, and exactly as many of them, at the same times, however they
are reached.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.media.deinterlace import deinterlaced
from scope.scope_addon.capture.media.frame_readers import PyavReader
from scope.scope_addon.capture.media.hdr import hdr_rgb
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange

from ....required import need_encoder
from .made_frames import BT2020, HLG, av, coded_frame, marked, with_fields

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


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7])
def test_no_frame_is_added_or_lost(count: int) -> None:
    woven = with_fields([moving_bar(k) for k in range(2 * count)]) if count else []
    assert times(deinterlaced(woven)) == times(woven)


def test_progressive_frames_are_the_very_same() -> None:
    frames = marked(
        [av.VideoFrame.from_ndarray(moving_bar(k), format="rgb24") for k in range(5)], "prog"
    )
    assert all(a is b for a, b in zip(deinterlaced(frames), frames, strict=True))


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


def test_the_frame_before_makes_a_late_begin_the_same() -> None:
    woven = with_fields([moving_bar(k) for k in range(20)])
    whole = [grey(frame) for frame in deinterlaced(woven)]
    late = [grey(frame) for frame in deinterlaced(woven[4:], woven[3])]
    assert np.array_equal(whole[4:], late)
    assert not np.array_equal(whole[4], grey(next(iter(deinterlaced(woven[4:])))))


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


@pytest.mark.parametrize("broken", ["vpush", "vpull", "configure"])
@pytest.mark.parametrize("after", [0, 1, 4])
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
    assert shown[-1] is woven[-1] or (broken == "configure" and after > 0)  # which is called once


def test_hdr_is_still_known_afterwards() -> None:
    frames = [coded_frame(moving_bar(k) / 255, HLG) for k in range(4)]
    shown = list(deinterlaced(marked(frames, "tff")))
    assert {
        (f.color_trc, f.color_primaries, int(f.colorspace), int(f.color_range)) for f in shown
    } == {(HLG, BT2020, BT2020, 1)}
    assert hdr_rgb(shown[0]) is not None


def write(
    path: Path, count: int, rate: int, codec: str = "libx264", order: str = "tff", **options: str
) -> Path:
    """Encode ``count`` interlaced frames of a moving bar."""
    pixels = "yuv422p10le" if codec == "prores_ks" else "yuv420p"
    frames = with_fields([moving_bar(k) for k in range(2 * count)], order, pixels)
    flags = "+ildct+ilme" if codec == "mpeg2video" else "+ildct"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(
            codec, rate=rate, options={"flags": flags, "threads": "1", **options}
        )
        stream.width = WIDTH
        stream.height = HEIGHT
        stream.pix_fmt = pixels
        for k, frame in enumerate(frames):
            frame.pts = k
            frame.time_base = 1 / stream.codec_context.framerate
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


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


@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_after_seeking_the_frames_are_those_of_the_whole(tmp_path: Path, suffix: str) -> None:
    path = write(tmp_path / f"a.{suffix}", 4 * 40, 4, g="24", bf="2")
    whole = images(path)
    for start_s in (21.0, 32.75, 39.75):
        with open_video(path) as video:
            late = list(video.frames_from(start_s))
        assert [frame.index for frame in late] == list(range(int(4 * start_s), 160))
        for frame in late:
            assert frame.timestamp_s == whole[frame.index][0]
            assert np.array_equal(frame.image_rgb, whole[frame.index][1]), frame.index


def test_a_truncated_file_gives_what_can_be_decoded(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mts", 60, 25, g="12", bf="0")
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    with av.open(str(path)) as container:
        decoded = sum(1 for _ in container.decode(video=0))
    frames = images(path)
    assert list(frames) == list(range(decoded))
    assert 20 < decoded < 60
    assert max(combs(image) for _, image in list(frames.values())[:-1]) < 40


def test_fields_that_are_frames_of_their_own_stay_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "fields.mp4"
    need_encoder("libx265")
    with av.open(str(path), "w") as container:
        options = {"x265-params": "log-level=none:interlace=tff"}
        stream = container.add_stream("libx265", rate=50, options=options)
        stream.width = WIDTH
        stream.height = HEIGHT
        stream.pix_fmt = "yuv420p"
        for k in range(6):
            frame = av.VideoFrame.from_ndarray(moving_bar(k), format="rgb24").reformat(
                format="yuv420p"
            )
            frame.pts = k
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    with av.open(str(path)) as container:
        decoded = list(container.decode(video=0))
    assert all(frame.interlaced_frame for frame in decoded)
    with closing(PyavReader(path)) as reader:
        for frame in decoded:
            raw = frame.to_ndarray(format="rgb24", src_colorspace="ITU601", dst_colorspace="ITU601")
            shown = reader.read()
            assert shown is not None
            assert np.array_equal(shown[1], raw)
        assert reader.read() is None
