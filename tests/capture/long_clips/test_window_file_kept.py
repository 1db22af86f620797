# SPDX-License-Identifier: GPL-3.0-or-later
"""A long clip whose capture was stopped goes on after its finished windows, to the same result, bit
for bit.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.long_clips import kept_estimates
from scope.scope_addon.capture.media.frame import Frame
from scope.scope_addon.capture.media.video import Video
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.tracking.track import Track
from scope.scope_addon.errors import CancelledError

from .conftest import FPS, FRAMES, assert_same, frames_from, options


def stop(
    windows_of: Callable[..., list[Track]], given: CaptureOptions, unfinished: Path, frame: int
) -> None:
    with pytest.raises(CancelledError):
        windows_of(given, None, unfinished, frame)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for the windows of the whole clip, which the first test that asks for `all_kept`
    fills.
    """
    return tmp_path_factory.mktemp("finished")


@pytest.fixture
def all_kept(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    finished: Path,
    tmp_path: Path,
) -> Path:
    """A copy of a folder in which all windows of the clip are kept; computed once."""
    if not any(finished.iterdir()):
        assert_same(windows_of(options(), None, finished), undisturbed())
    return Path(shutil.copytree(finished, tmp_path / "kept"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("people", "frame", "goes_on_at_s"),
    [
        ("largest", 20, 0.0),
        (2, 38, 1.0),
        ("largest", FRAMES, 3.0),
    ],
)
def test_a_clip_that_was_stopped_goes_on_after_its_last_finished_window(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    observed_times: list[float],
    tmp_path: Path,
    people: int | str,
    frame: int,
    goes_on_at_s: float,
) -> None:
    """Also at the first seam, where the next window's trackers care about somebody else."""
    stop(windows_of, options(people), tmp_path, frame)
    observed_times.clear()
    tracks = windows_of(options(people), None, tmp_path)
    assert observed_times[0] == pytest.approx(goes_on_at_s)
    assert_same(tracks, undisturbed(people))


def test_a_clip_all_of_whose_windows_are_finished_is_not_observed_again(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    all_kept: Path,
    observed_times: list[float],
) -> None:
    whole = undisturbed()
    observed_times.clear()
    assert_same(windows_of(options(), None, all_kept), whole)
    assert observed_times == []


def flipped(whole: bytes) -> bytes:
    middle = len(whole) // 2
    return whole[:middle] + bytes([whole[middle] ^ 255]) + whole[middle + 1 :]


def test_from_a_damaged_window_on_a_stopped_clip_is_observed_again(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    observed_times: list[float],
    all_kept: Path,
) -> None:
    (third,) = all_kept.glob("windows-*/window00002.npz")
    third.unlink()  # as of a clip that was stopped in its last window
    (second,) = all_kept.glob("windows-*/window00001.npz")
    second.write_bytes(flipped(second.read_bytes()))
    whole = undisturbed()
    observed_times.clear()
    tracks = windows_of(options(), None, all_kept)
    assert observed_times[0] == pytest.approx(1.0)
    assert_same(tracks, whole)


def test_windows_found_with_other_options_are_not_taken(
    windows_of: Callable[..., list[Track]], observed_times: list[float], tmp_path: Path
) -> None:
    given = options(2)
    stop(windows_of, given, tmp_path, 35)
    for other, begins_at_s in ((replace(given, threads=2), 1.0), (replace(given, people=1), 0.0)):
        observed_times.clear()
        stop(windows_of, other, tmp_path, 33 if begins_at_s else 5)
        assert observed_times[0] == pytest.approx(begins_at_s)


def test_a_stopped_clip_whose_middle_is_decoded_to_other_images_goes_on_from_its_beginning(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    observed_times: list[float],
    tmp_path: Path,
) -> None:
    """The frames before are decoded, but not observed."""

    def damaged(k: int, frame: Frame) -> Frame:
        return (
            Frame(frame.index + 5, frame.timestamp_s, np.full_like(frame.image_rgb, 90))
            if k < 20
            else frame
        )

    stop(windows_of, options(), tmp_path, 38)
    whole = undisturbed()
    with frames_from(damaged):
        observed_times.clear()
        assert_same(windows_of(options(), None, tmp_path), whole)
    assert min(observed_times) == pytest.approx(1.0)
    assert max(observed_times) == pytest.approx((FRAMES - 1) / FPS)


def test_windows_are_kept_within_bounds(
    windows_of: Callable[..., list[Track]],
    all_kept: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sizes = [file.stat().st_size for file in sorted(all_kept.glob("windows-*/*"))]
    assert len(sizes) == 3
    monkeypatch.setattr(kept_estimates, "LARGEST", sizes[0] + sizes[1] // 2)
    windows_of(options(), None, tmp_path / "small")
    assert [file.stat().st_size for file in sorted(tmp_path.glob("small/windows-*/*"))] == sizes[:2]


def test_a_window_that_ended_early_with_the_footage_is_not_kept(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As where a disk fails for a moment."""
    frames = Video.__iter__
    with monkeypatch.context() as patch:
        patch.setattr(
            Video, "__iter__", lambda video: (f for f in frames(video) if f.timestamp_s < 3)
        )
        windows_of(options(), None, tmp_path)
    assert [file.name for file in tmp_path.glob("windows-*/*")] == ["window00000.npz"]
    assert_same(windows_of(options(), None, tmp_path), undisturbed())
