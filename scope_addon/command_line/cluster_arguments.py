# SPDX-License-Identifier: GPL-3.0-or-later
"""The arguments of a batch that runs on a cluster, and those by which its processes share a long
clip, which are not for users.
"""

from __future__ import annotations

import math
import os
import re
from argparse import SUPPRESS, ArgumentParser, Namespace
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..capture_report import warnings_as_json
from ..errors import UsageError
from ..footage import is_url
from ..installed import check_cluster
from ..job.clip_task import COUNT, WINDOWS, WINDOWS_FOLDER
from ..temporary import temporary_folder
from .arguments import path_argument
from .terminal import print_message

if TYPE_CHECKING:
    from ..capture.options import CaptureOptions
    from ..clock import Progress
    from ..cluster.runner import DaskRunner

WINDOW_SECONDS = "--window-seconds"
_MIN_S = 0.1


def dask_runner(args: Namespace, program: Sequence[str] | None) -> DaskRunner:
    """Connect to the cluster of ``--scheduler``.

    :param program: command that the workers run; None for their own installation.
    :raises ScopeError: the package is missing, or the scheduler cannot be reached.
    """
    check_cluster()
    from ..cluster.runner import DaskRunner
    from ..cluster.workers import connect

    # As given, not resolved: a link may lead elsewhere on other machines.
    folder, out = (
        path if is_url(path) else os.path.abspath(path) for path in (args.folder, args.out)
    )
    return DaskRunner(connect(args.scheduler), folder, out, args.jobs, program, print_message)


def folder_argument(text: str) -> Path | str:
    """Convert the argument to a path, or leave it as the URL that it is."""
    return text if is_url(text) else path_argument(text)


def local_folders(args: Namespace, stack: ExitStack) -> tuple[Path, Path]:
    """Return the folders of footage and results; for a URL, a folder with files of the same names.

    :param stack: removes that folder.
    :raises UsageError: there is a URL, but no cluster.
    :raises ScopeError: a store cannot be read.
    """
    folder = args.folder
    out = args.out
    if is_url(folder) or is_url(out):
        if args.scheduler is None:
            raise UsageError(
                "footage and results at a URL need a cluster: give its --scheduler, or download "
                "the footage"
            )
        check_cluster()
        from ..cluster.remote import mirror_footage, mirror_results

        scratch = stack.enter_context(temporary_folder("batch"))
        folder = mirror_footage(folder, str(out), scratch / "clips") if is_url(folder) else folder
        out = mirror_results(out, scratch / "results") if is_url(out) else out
    return folder, out


def add_window_arguments(capture: ArgumentParser) -> None:
    """Add the arguments of a process that captures a clip, or a part of it."""
    capture.add_argument(WINDOWS, default="", help=SUPPRESS)
    capture.add_argument(WINDOWS_FOLDER, type=path_argument, help=SUPPRESS)
    add_window_seconds(capture)


def add_window_seconds(parser: ArgumentParser) -> None:
    """Add the length of windows, which tests make shorter."""
    parser.add_argument(WINDOW_SECONDS, type=float, help=SUPPRESS)


def with_window_seconds(options: CaptureOptions, args: Namespace) -> CaptureOptions:
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
    args: Namespace, video: Path, options: CaptureOptions, progress: Progress
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
