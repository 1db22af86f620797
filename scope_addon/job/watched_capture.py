# SPDX-License-Identifier: GPL-3.0-or-later
"""A capture of footage that must stay as it is meanwhile, and that goes on after a kill: what the
worker of the panel and the command line run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from ...solver.body import Body
from ..capture.long_clips.windowed_clip import lasting
from ..capture.observe import Watch
from ..capture.options import CaptureOptions
from ..capture.pipeline import Capture, capture
from ..capture.several_views.capture_views import capture_views
from ..clock import Progress
from .unfinished import UnfinishedCapture, unfinished_capture
from .watched_footage import WatchedFiles, WatchedFootage


@dataclass(frozen=True)
class WatchedCapture:
    """A capture in progress; ``footage``: its first video, by which an overlay is drawn later."""

    footage: WatchedFootage
    _path: Path
    _views: Sequence[Path]
    _view_footage: Sequence[WatchedFootage]
    _options_files: WatchedFiles
    _unfinished: UnfinishedCapture

    def run(
        self,
        body: Body,
        options: CaptureOptions,
        progress: Progress,
        watch: Watch = lambda *_: None,
        windows_folder: Path | None = None,
    ) -> Capture:
        """Capture, see `capture` and `capture_views`; the report also warns of earlier captures.

        :param windows_folder: see `lasting`.
        :raises ChangedFootageError: a file was changed meanwhile.
        """
        for each in (self.footage, *self._view_footage):
            progress = each.watched(progress)
        if self._views:
            found = capture_views([self._path, *self._views], body, options, progress, watch)
        else:
            observe_frames = lasting(self._unfinished.folder, windows_folder)
            found = capture(self._path, body, options, progress, watch, observe_frames)
        self.check()
        for each in self._view_footage:
            each.check()
        warnings = [*found.report.warnings, *self._unfinished.warnings]
        return replace(found, report=replace(found.report, warnings=warnings))

    def check(self) -> None:
        """Compare the first video, and the files that options name, with what they were.

        :raises ChangedFootageError: one was changed.
        """
        self._options_files.check()
        self.footage.check()


@contextmanager
def watched_capture(
    cache: Path | None,
    path: Path,
    views: Sequence[Path],
    options_files: WatchedFiles,
    rate_given: bool = False,
) -> Iterator[WatchedCapture]:
    """Give a capture to be run; what it has found is kept if the block is left by an exception.

    :param cache: folder in which to keep it; None: nowhere. What several cameras show is not kept.
    :param path: of the footage. :param views: further videos of the same moment.
    :param options_files: that the options name.
    :param rate_given: see `WatchedFootage`.
    """
    with unfinished_capture(None if views else cache, path, rate_given) as unfinished:
        further = [WatchedFootage(view, rate_given) for view in views]
        yield WatchedCapture(unfinished.footage, path, views, further, options_files, unfinished)
