# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of a live capture as a video that other readers understand."""

from fractions import Fraction

import av
import numpy as np
import pytest
from scope.scope_addon.errors import OutputError
from scope.scope_addon.live.outputs.footage import Footage
from scope.scope_addon.live.sources import Picture

TIMES = [7.0, 7.033, 7.2, 7.233, 7.3]  # frames were dropped on the way


def picture(k, shape=(49, 64, 3)):
    return Picture(20 + k, TIMES[k], 0.0, np.full(shape, 40 * k, np.uint8))


def test_pictures_keep_their_times_and_order(tmp_path):
    path = tmp_path / "take.mp4"
    with Footage(path, Fraction(30)) as footage:
        for k in range(len(TIMES)):
            footage.add(picture(k))
        assert footage.save() == path
    assert (footage.origin, footage.lost) == ((20, 7.0), 0)
    with av.open(str(path)) as video:
        frames = list(video.decode(video=0))
    assert [frame.time for frame in frames] == pytest.approx([t - 7.0 for t in TIMES], abs=1e-3)
    brightness = [frame.to_ndarray(format="gray").mean() for frame in frames]
    assert brightness == sorted(brightness)
    assert (frames[0].width, frames[0].height) == (64, 48)
    assert [entry.name for entry in tmp_path.iterdir()] == ["take.mp4"]


def test_a_capture_that_fails_leaves_no_file(tmp_path):
    with Footage(tmp_path / "take.mp4", Fraction(30)) as footage:
        footage.add(picture(0))
    assert list(tmp_path.iterdir()) == []


def test_without_pictures_nothing_is_written(tmp_path):
    with Footage(tmp_path / "take.mp4", Fraction(30)) as footage:
        assert footage.save() is None
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_is_said(tmp_path):
    with Footage(tmp_path / "none" / "take.mp4", Fraction(30)) as footage:
        for k in range(len(TIMES)):
            footage.add(picture(k))
        with pytest.raises(OutputError, match="its folder does not exist"):
            footage.save()


def test_pictures_of_another_size_are_left_out_and_counted(tmp_path):
    with Footage(tmp_path / "take.mp4", Fraction(30)) as footage:
        footage.add(picture(0))
        footage.add(picture(1, (60, 80, 3)))
        footage.save()
    assert footage.lost == 1
