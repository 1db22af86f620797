# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of the main job: some windows of a long clip, observed for a process that joins all of them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ....errors import UsageError
from ...media.opencv_threads import opencv_in_one_thread
from ...media.video import open_video
from ...options import CaptureOptions
from ..clock import Progress, StageClock
from .plan import plan_windows
from .windowed_clip import WindowedClip

_THREADS = 2  # in which backgrounds are followed


def count_windows(path: Path, options: CaptureOptions) -> int:
    """Return into how many windows a clip can be divided; 1 if it is short, or frames of it are to be left out.

    :raises VideoError: the footage cannot be used.
    """
    with open_video(path, options.wanted) as video:
        return 1 if video.wanted.fps is not None else len(plan_windows(video, options.window_s))


def observe_windows(
    path: Path, options: CaptureOptions, numbers: range, folder: Path, progress: Progress = lambda *_: None
) -> tuple[list[Path], int]:
    """Observe some successive windows of a clip, and write each to a file of a folder.

    :return: the files, and the number of frames in these windows.
    :raises VideoError: the footage cannot be used.
    :raises UsageError: there are no such windows.
    :raises OSError: a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with open_video(path, options.wanted) as video, opencv_in_one_thread(), ThreadPoolExecutor(_THREADS) as pool:
        windows = plan_windows(video, options.window_s)
        if not (numbers and 0 <= numbers.start < numbers.stop <= len(windows)):
            raise UsageError(f"{path} has {len(windows)} windows, and none of the numbers {numbers}")
        return WindowedClip(video, windows, options, StageClock(), pool).save(numbers, folder, progress)
