# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments by which the processes of a cluster share a long clip; they are not for users."""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..capture_report import warnings_as_json
from ..errors import UsageError
from ..job.clip_task import COUNT, WINDOWS, WINDOWS_FOLDER
from .arguments import path_argument

if TYPE_CHECKING:
    from ..capture.options import CaptureOptions
    from ..capture.stages.clock import Progress

WINDOW_SECONDS = "--window-seconds"
_MIN_S = 0.1


def add_window_arguments(capture: argparse.ArgumentParser) -> None:
    """Add the arguments of a process that captures a clip, or a part of it."""
    capture.add_argument(WINDOWS, default="", help=argparse.SUPPRESS)
    capture.add_argument(WINDOWS_FOLDER, type=path_argument, help=argparse.SUPPRESS)
    add_window_seconds(capture)


def add_window_seconds(parser: argparse.ArgumentParser) -> None:
    """Add the length of windows, which tests make shorter."""
    parser.add_argument(WINDOW_SECONDS, type=float, help=argparse.SUPPRESS)


def with_window_seconds(options: CaptureOptions, args: argparse.Namespace) -> CaptureOptions:
    """Return the options with the length of windows that an argument gives.

    :raises UsageError: it is too short.
    """
    if args.window_seconds is None:
        return options
    if not _MIN_S <= args.window_seconds < math.inf:
        raise UsageError(
            f"{WINDOW_SECONDS} must be at least {_MIN_S:g}, but is {args.window_seconds:g}"
        )
    return replace(options, window_s=args.window_seconds)


def window_report(
    args: argparse.Namespace, video: Path, options: CaptureOptions, progress: Progress
) -> dict[str, Any] | None:
    """Do what `WINDOWS` asks for, and return the report; None where the whole clip is to be
    captured.

    :raises UsageError: the argument is neither `COUNT` nor a range FIRST:END, or there is no
        folder.
    :raises ScopeError: the footage cannot be used.
    """
    if not args.windows:
        return None
    from ..capture.long_clips.windowed_clip import count_windows, observe_windows

    if args.windows == COUNT:
        count = count_windows(video, options)
        return {"windows": count} if count > 1 else None
    numbers = re.fullmatch(r"(\d{1,9}):(\d{1,9})", args.windows, re.ASCII)
    if numbers is None or args.windows_folder is None:
        raise UsageError(
            f"{WINDOWS} must be {COUNT} or FIRST:END with {WINDOWS_FOLDER}, but is {args.windows!r}"
        )
    first, end = map(int, numbers.groups())
    files, frames = observe_windows(
        video, options, range(first, end), args.windows_folder, progress
    )
    return {"frames": frames, "outputs": [str(file) for file in files], **warnings_as_json([])}
