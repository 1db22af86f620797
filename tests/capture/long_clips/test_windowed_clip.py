# SPDX-License-Identifier: GPL-3.0-or-later
"""A long clip in one piece and in windows, with synthetic people of known places."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.long_clips import windows
from scope.scope_addon.capture.long_clips.windowed_clip import count_windows, observe_windows
from scope.scope_addon.capture.media.frame import Frame
from scope.scope_addon.capture.tracking.track import Track

from .conftest import FRAMES, SMALL, assert_same, frames_from, options


def places(track: Track) -> np.ndarray:
    return track.keypoints_px[:, [23, 24]].mean(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("people", ["largest", 2])
def test_windows_of_several_processes_are_the_clip_in_one_piece(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    folder: Path,
    tmp_path: Path,
    people: int | str,
) -> None:
    given = options(people)
    assert count_windows(folder, given) == 3
    frames = [
        observe_windows(folder, given, numbers, tmp_path)[1] for numbers in (range(2, 3), range(2))
    ]
    assert frames == [30, 60]
    assert_same(windows_of(given, tmp_path), undisturbed(people))


def test_the_same_person_is_followed_across_a_seam_where_somebody_larger_stands(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (track,) = undisturbed()
    truth = np.array([SMALL.center_px(t) for t in range(FRAMES)])
    assert track.seen.all()
    assert track.acquired.sum() == 1
    assert np.abs(places(track) - truth).max() < 5
    monkeypatch.setattr(windows, "missed_people", lambda before, after: False)
    (track,) = windows_of(options())
    assert not track.seen[31:37].any()  # what the rule prevents


def test_windows_that_are_missing_or_damaged_are_observed_by_the_process_that_joins(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    folder: Path,
    tmp_path: Path,
) -> None:
    given = options()
    files, _ = observe_windows(folder, given, range(3), tmp_path)
    files[0].unlink()
    files[2].write_bytes(files[2].read_bytes()[:-100])
    assert_same(windows_of(given, tmp_path), undisturbed())


@pytest.mark.slow
def test_a_window_that_was_decoded_to_other_images_is_observed_again(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    folder: Path,
    tmp_path: Path,
) -> None:
    """As of a file that does not mark its keyframes well: a decoder that begins in its middle gives
    a grey image.
    """

    def damaged(k: int, frame: Frame) -> Frame:
        lost = np.full_like(frame.image_rgb, 90)
        lost[0, 0] = frame.image_rgb[0, 0]
        return Frame(frame.index + 5, frame.timestamp_s, lost) if k < 4 else frame

    whole = undisturbed()
    with frames_from(damaged):
        observe_windows(folder, options(), range(1, 2), tmp_path)
        assert_same(windows_of(options(), tmp_path), whole)


def test_indices_that_a_decoder_counts_from_elsewhere_are_those_of_the_clip(
    windows_of: Callable[..., list[Track]],
    undisturbed: Callable[..., list[Track]],
    folder: Path,
    tmp_path: Path,
) -> None:
    """As where the frame rate varies, and the index of a frame can only be estimated from its
    time.
    """
    whole = undisturbed()
    with frames_from(lambda _, frame: Frame(frame.index + 5, frame.timestamp_s, frame.image_rgb)):
        observe_windows(folder, options(), range(1, 3), tmp_path)
        assert_same(windows_of(options(), tmp_path), whole)
