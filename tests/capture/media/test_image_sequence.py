# SPDX-License-Identifier: GPL-3.0-or-later
"""Image sequences: order, rate, missing and damaged pictures."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.errors import VideoError
from scope.scope_addon.job.batch import Batch

NUMBERS = [*range(7, 12), 100]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write frames 7 to 11 and 100, not zero-padded, with their number as brightness, and unrelated
    files.
    """
    for number in NUMBERS:
        cv2.imwrite(str(tmp_path / f"walk_{number}.png"), np.full((20, 30, 3), number, np.uint8))
    (tmp_path / "notes.txt").write_text("no picture")
    return tmp_path


def brightness(path: Path, wanted: VideoRange | None = None) -> list[int]:
    with open_video(path, wanted) as video:
        return [int(frame.image_rgb[0, 0, 0]) for frame in video]


@pytest.mark.parametrize("name", ["", "walk_####.png", "walk_%d.png", "walk_7.png"])
def test_pictures_are_in_numerical_order(folder: Path, name: str) -> None:
    wanted = VideoRange(fps=Fraction(12))
    assert brightness(folder / name, wanted) == NUMBERS
    with open_video(folder / name, wanted) as video:
        frames = list(video)
        assert video.fps == 12
        assert (video.frame_count, video.width, video.height) == (6, 30, 20)
        assert [f.timestamp_s for f in frames] == pytest.approx([k / 12 for k in range(6)])
        (warning,) = map(str, video.warnings)
        assert "88 numbers between 7 and 100 have no image" in warning


def test_a_range_of_the_sequence(folder: Path) -> None:
    assert brightness(folder, VideoRange(0.1, 0.3, Fraction(10))) == [8, 9, 10]
    assert brightness(folder / "walk_9.png", VideoRange(fps=Fraction(10))) == [9, 10, 11, 100]


def test_without_a_rate_30_is_assumed(folder: Path) -> None:
    with open_video(folder / "walk_9.png") as video:
        assert video.frame_count == 1
    with open_video(folder) as video:
        assert video.fps == 30
        assert any("--fps on the command line" in warning for warning in map(str, video.warnings))


@pytest.mark.parametrize(
    ("numbers", "times", "says"),
    [
        ([3, 4, 5, 6], [0, 1, 2, 3], None),
        ([0, 10, 20, 30], [0, 1, 2, 3], "27 numbers between 0 and 30 have no image, so the"),
        ([0, 1, 4, 5, 6], [0, 1, 4, 5, 6], "2 numbers between 0 and 6"),
        ([0, 10, 30, 40], [0, 1, 3, 4], "1 numbers between 0 and 40"),
        ([0, 1, 9], [0, 1, 2], "consecutive frames"),
        ([1690000000033, 1690000000067, 1690000000100], [0, 1, 2], "consecutive frames"),
    ],
)
def test_missing_pictures_leave_gaps_and_give_a_warning(
    tmp_path: Path, numbers: list[int], times: list[int], says: str | None
) -> None:
    for number in numbers:
        cv2.imwrite(str(tmp_path / f"a_{number:04}.png"), np.zeros((20, 30, 3), np.uint8))
    with open_video(tmp_path, VideoRange(fps=Fraction(10))) as video:
        assert video.expected_frames == len(numbers)
        assert [f.timestamp_s for f in video] == pytest.approx([t / 10 for t in times])
        assert [f.index for f in video] == list(range(len(numbers)))
        assert (
            [says in warning for warning in map(str, video.warnings)] == [True]
            if says
            else not video.warnings
        )
    with open_video(tmp_path, VideoRange(0.1, 0.45, Fraction(10))) as video:
        wanted = [t / 10 for t in times if 1 <= t <= 4]
        assert [f.timestamp_s for f in video] == pytest.approx(wanted)
        assert video.expected_frames == len(wanted)


def test_the_number_of_a_pattern_is_where_its_sign_stands(tmp_path: Path) -> None:
    for number in (98, 99, 101, 102):
        image = np.full((20, 30, 3), number, np.uint8)
        cv2.imwrite(str(tmp_path / f"walk_{number}_v2.png"), image)
    pattern = tmp_path / "walk_%04d_v2.png"
    with open_video(pattern, VideoRange(fps=Fraction(10))) as video:
        assert [f.timestamp_s for f in video] == pytest.approx([0.0, 0.1, 0.3, 0.4])
        (warning,) = map(str, video.warnings)
        assert "1 numbers between 98 and 102 have no image" in warning
        assert video.expected_frames == 4
        assert video.length_s == pytest.approx(0.5)
    assert brightness(pattern, VideoRange(0.1, 0.35, Fraction(10))) == [99, 101]
    with open_video(pattern, VideoRange(0.1, 0.35, Fraction(10))) as video:
        assert video.length_s == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("numbers", "damaged", "decoded"), [(range(0, 60, 2), 58, 29), ([*range(40), 60, 61], 60, 40)]
)
def test_a_damaged_picture_near_the_end_is_told(
    tmp_path: Path, numbers: list[int], damaged: int, decoded: int
) -> None:
    """One picture of many is missing, or those after a gap; not where the range ends before."""
    for number in numbers:
        cv2.imwrite(str(tmp_path / f"a_{number:02}.png"), np.zeros((20, 30, 3), np.uint8))
    (tmp_path / f"a_{damaged}.png").write_bytes(b"no picture any more")
    with open_video(tmp_path, VideoRange(fps=Fraction(10))) as video:
        assert len(list(video)) == decoded
        says = f"stopped after {decoded} of about {len(numbers)}"
        assert any(says in warning for warning in map(str, video.warnings))
    with open_video(tmp_path, VideoRange(end_s=2.5, fps=Fraction(10))) as video:
        assert len(list(video)) == 26
        assert not any("stopped" in warning for warning in map(str, video.warnings))


def test_missing_pictures_are_errors(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for path, words in (
        (tmp_path / "empty", "folder that contains no images"),
        (tmp_path / "x_##.png", "does not exist"),
    ):
        with pytest.raises(VideoError, match=words):
            open_video(path)


def test_a_folder_of_unrelated_pictures_is_refused(folder: Path) -> None:
    (folder / "holiday.png").write_bytes((folder / "walk_9.png").read_bytes())
    with pytest.raises(VideoError, match=r"holiday\.png.*pattern"):
        open_video(folder)
    assert brightness(folder / "walk_####.png", VideoRange(fps=Fraction(10))) == NUMBERS


@pytest.mark.parametrize(
    ("names", "numbered"),
    [
        (["a_1.png", "a_10.png", "a_2.PNG"], True),
        (["take1_0001.jpg", "take2_0001.jpg"], False),
        (["a_1.png", "a_2.jpg"], False),
        (["a_1.png"], False),
        (["one.png", "two.png"], False),
    ],
)
def test_capture_and_batch_agree_on_what_a_sequence_is(
    tmp_path: Path, names: list[str], numbered: bool
) -> None:
    clips = tmp_path / "clips"
    (clips / "folder").mkdir(parents=True)
    for name in names:
        ok, data = cv2.imencode(".png", np.zeros((20, 30, 3), np.uint8))
        (clips / "folder" / name).write_bytes(data.tobytes())
    found = Batch(clips, tmp_path / "out", [], {}, [".npz"]).clips(recursive=False)
    assert list(found) == (["folder"] if numbered else [])
    if numbered or len(names) == 1:
        with open_video(clips / "folder", VideoRange(fps=Fraction(10))) as video:
            assert len(list(video)) == len(names)
    else:
        with pytest.raises(VideoError, match="do not form one numbered sequence"):
            open_video(clips / "folder")
