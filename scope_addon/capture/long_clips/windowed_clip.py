# SPDX-License-Identifier: GPL-3.0-or-later
"""Observation of a long clip, window by window.

In one piece, all windows are observed in one pass; a capture that was killed goes on after its last
finished window. Some or all of them may also have been observed before, by other processes, which
each began to decode at their own window. The result is the same, because

- what is observed in a window depends on its frames alone;
- a window whose first frames are not those of the window before, image by image, is observed again
  with the clip decoded from its beginning;
- a window whose trackers have lost somebody at the seam is observed again with trackers that are
  given the regions of the window before. Whether that is so depends on the shared frames alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path

import numpy as np

from ...clock import FINDING, Progress, StageClock
from ...errors import UsageError
from ..frame_observer import FrameObserver, Observed, Trackers, Window
from ..media.frame import Frame
from ..media.video import Video, no_frames_error, open_video, opencv_in_one_thread
from ..observe import (
    ObservationJob,
    ObserveFrames,
    frame_pairs,
    given_camera,
    network_threads,
    observe_in_one_pass,
    open_trackers,
)
from ..options import CaptureOptions
from ..perception.observation import Observation
from ..perception.region import Region
from ..perception.sessions import Execution
from .kept_estimates import KeptEstimates
from .window_file import KeptWindows, load_window, save_window
from .windows import JoinedWindows, plan_windows

# Called when a window has ended, with its run and that of the next window; returns the run to go on
# with.
Seam = Callable[[FrameObserver, FrameObserver | None], FrameObserver | None]
FramePairs = Iterator[tuple[Frame, Frame | None]]  # see `frame_pairs`
_THREADS = 2  # in which backgrounds are followed by `observe_windows`


def lasting(unfinished: Path | None = None, folder: Path | None = None) -> ObserveFrames:
    """Return a way to observe the frames of a clip that divides a long one into windows, and goes
    on where an earlier capture was killed.

    :param unfinished: folder in which estimates and finished windows are kept while the capture
        lasts, and found if an earlier one was killed; the caller removes it. None: nothing is kept.
    :param folder: with windows of a long clip that `observe_windows` has written; those that are
        missing are observed now.
    """

    def observe_frames(job: ObservationJob) -> Observed:
        windows = plan_windows(job.video, job.options.window_s)
        if len(windows) == 1:
            return observe_in_one_pass(job, _memory(unfinished))
        clip = WindowedClip(
            job.video, windows, job.options, job.clock, job.background.pool, unfinished
        )
        return clip.observe(job, folder)

    return observe_frames


def _memory(unfinished: Path | None) -> KeptEstimates | None:
    return None if unfinished is None else KeptEstimates(unfinished)


class WindowedClip:
    """A clip and its windows.

    :param pool: in which the background is followed.
    :param unfinished: folder with what an earlier capture that was killed has found, and in which
        to keep what this one finds; None: nothing is kept.
    """

    def __init__(
        self,
        video: Video,
        windows: Sequence[Window],
        options: CaptureOptions,
        clock: StageClock,
        pool: ThreadPoolExecutor,
        unfinished: Path | None = None,
    ) -> None:
        self._video = video
        self._windows = windows
        self._options = options
        self._clock = clock
        self._memory = _memory(unfinished)
        self._kept_windows = KeptWindows(unfinished, options)
        self._camera = given_camera(video, options)
        self._pool = pool
        self._execution = Execution(options.provider)
        self._threads = network_threads(options.threads, self._execution)
        self._trackers: Trackers | None = None
        self._joined = JoinedWindows()

    def observe(self, job: ObservationJob, folder: Path | None = None) -> Observed:
        """Observe all windows, and join them.

        :param folder: with the files of windows that were observed before.
        :raises VideoError: there is no frame.
        """
        if folder is None:
            self._observe_all(job)
        else:
            self._gather(folder, job.progress)
        if not len(self._joined):
            raise no_frames_error(self._video)
        execution = self._execution.describe(self._threads) if self._trackers else ""
        warnings = self._execution.warnings + self._video.warnings
        return self._joined.observed(execution, warnings)

    def save(self, numbers: range, folder: Path, progress: Progress) -> tuple[list[Path], int]:
        """Observe some successive windows, and write each to a file of a folder.

        :return: the files, and the number of frames in the windows.
        """
        windows = [self._windows[k] for k in numbers]
        files: list[Path] = []
        frames = 0

        def seam(ended: FrameObserver, following: FrameObserver | None) -> FrameObserver | None:
            nonlocal frames
            record = self._record(ended)
            frames += len(record) - record.first
            files.append(save_window(folder, record))
            progress(FINDING, frames, 0)
            return following

        run_windows(
            windows,
            self._begin,
            frame_pairs(self._frames(windows[0]), self._clock),
            seam,
            lambda frame, people: progress(FINDING, frames, 0),
        )
        return files, frames

    def _observe_all(self, job: ObservationJob) -> None:
        """Observe all windows in one pass, from the first on that an earlier capture has not
        finished.
        """
        known = self._join_kept()
        done = len(self._joined)
        expected = self._video.expected_frames
        job.progress(FINDING, done, max(expected, done))
        if known == len(self._windows):
            return

        def seam(ended: FrameObserver, following: FrameObserver | None) -> FrameObserver | None:
            record = self._record(ended)
            self._joined.add(record)
            is_last = ended.window.number + 1 == len(self._windows)
            # A window that ended early with the footage may be whole when it is read again.
            if following is not None or is_last:
                self._kept_windows.save(record)
            if following is None:
                return None
            regions = self._joined.missed(following.observed())
            return self._warmed_up(following, regions) if regions else following

        def watch(frame: Frame, people: Sequence[Observation]) -> None:
            nonlocal done
            done += 1
            job.watch(frame, people, job.live)
            job.progress(FINDING, done, max(expected, done))

        run, pairs = self._first_run(self._windows[known])
        run_windows(
            self._windows[known:],
            lambda window: run if window.number == run.window.number else self._begin(window),
            pairs,
            seam,
            watch,
        )

    def _join_kept(self) -> int:
        """Join the first windows as far as an earlier capture has finished them, and return their
        number.
        """
        for window in self._windows:
            record = self._kept_windows.load(window)
            if record is None or not self._joined.accepts(record):
                return window.number
            self._joined.add(record)
        return len(self._windows)

    def _first_run(self, window: Window) -> tuple[FrameObserver, FramePairs]:
        """Return the run of the first window that is observed, and the frames from its own first
        one on.

        After windows that are known, it begins in the middle of the footage, unless its images are
        others then.
        """
        for exact in (False, True):
            run = self._begin(window)
            pairs = frame_pairs(self._frames(window, exact), self._clock)
            if not window.number:
                break
            pairs = _up_to_begin(run, pairs)
            if self._joined.accepts(run.observed()):
                break
        regions = self._joined.missed(run.observed()) if window.number else []
        return (self._warmed_up(run, regions) if regions else run), pairs

    def _warmed_up(self, run: FrameObserver, regions: list[Region]) -> FrameObserver:
        """Return another run of a window, with people in given regions, up to the frame that the
        first one reached.
        """
        for exact in (False, True):
            other = self._begin(run.window, regions)
            _up_to_begin(other, frame_pairs(self._frames(run.window, exact), self._clock))
            if np.array_equal(other.observed().checksums, run.observed().checksums):
                break
        return other

    def _gather(self, folder: Path, progress: Progress) -> None:
        """Join windows from their files; those that are missing, or do not fit, are observed
        here.
        """
        for window in self._windows:
            record = load_window(folder, window) or self._single(window)
            if not self._joined.accepts(record):
                record = self._single(window, exact=True)
            if len(record) > record.first and (regions := self._joined.missed(record)):
                record = self._single(window, regions)
                if not self._joined.accepts(record):
                    record = self._single(window, regions, exact=True)
            self._joined.add(record)
            progress(
                FINDING, len(self._joined), max(self._video.expected_frames, len(self._joined))
            )

    def _single(
        self, window: Window, regions: Sequence[Region] = (), exact: bool = False
    ) -> Observed:
        """Observe one window alone.

        :param regions: in which people are in its first frame.
        :param exact: whether to decode from the beginning of the clip.
        """
        run = self._begin(window, regions)
        for frame, upcoming in frame_pairs(self._frames(window, exact), self._clock):
            if window.has_ended(frame.timestamp_s):
                break
            run.add(frame, upcoming)
        return self._record(run)

    def _frames(self, window: Window, exact: bool = False) -> Iterator[Frame]:
        """Yield the frames from a window's anchor on.

        :param exact: whether to decode from the beginning of the clip, as is always done where
            frames are left out.
        """
        video = self._video
        if window.number == 0:
            yield from video
        elif exact or video.wanted.fps is not None:
            yield from (frame for frame in video if window.warms_up(frame.timestamp_s))
        else:
            yield from video.frames_from(window.anchor_s)

    def _begin(self, window: Window, regions: Sequence[Region] = ()) -> FrameObserver:
        """Return a run of a window with trackers that have seen nothing."""
        if self._trackers is None:
            self._trackers = open_trackers(
                self._options, self._threads, self._execution, self._memory
            )
        people, hands, faces = self._trackers
        afresh = Trackers(
            people.restarted(regions), hands and hands.restarted(), faces and faces.restarted()
        )
        number = window.number + 1
        following = self._windows[number] if number < len(self._windows) else None
        return FrameObserver(
            self._video, afresh, self._camera, self._pool, self._clock, window, following
        )

    def _record(self, run: FrameObserver) -> Observed:
        warnings = self._execution.warnings + self._video.warnings
        return run.observed(self._execution.describe(self._threads), warnings)


def _up_to_begin(run: FrameObserver, pairs: FramePairs) -> FramePairs:
    """Observe the frames before a window's own first one, and return the pairs from that one on."""
    for pair in pairs:
        if run.window.has_begun(pair[0].timestamp_s):
            return chain([pair], pairs)
        run.add(*pair)
    return pairs


def run_windows(
    windows: Sequence[Window],
    begin: Callable[[Window], FrameObserver],
    pairs: FramePairs,
    seam: Seam,
    watch: Callable[[Frame, Sequence[Observation]], None],
) -> None:
    """Observe the windows until their frames end.

    :param windows: at least one, in order.
    :param pairs: from the first window's anchor on; see `frame_pairs`.
    :param watch: called with each frame and its people, the largest first.
    """
    left = deque(windows)
    current: FrameObserver | None = begin(left.popleft())
    following: FrameObserver | None = None
    for frame, upcoming in pairs:
        while current is not None and current.window.has_ended(frame.timestamp_s):
            if following is None and left:
                following = begin(left.popleft())
            current = seam(current, following)
            following = None
        if current is None:
            return
        if following is None and left and left[0].warms_up(frame.timestamp_s):
            following = begin(left.popleft())
        people = current.add(frame, upcoming)
        if following is not None:
            following.add(frame, upcoming)
        watch(frame, people)
    if current is not None:
        seam(current, None)


def count_windows(path: Path, options: CaptureOptions) -> int:
    """Return into how many windows a clip can be divided; 1 if it is short, or frames of it are to
    be left out.

    :raises VideoError: the footage cannot be used.
    """
    with open_video(path, options.wanted) as video:
        return 1 if video.wanted.fps is not None else len(plan_windows(video, options.window_s))


def observe_windows(
    path: Path,
    options: CaptureOptions,
    numbers: range,
    folder: Path,
    progress: Progress = lambda *_: None,
) -> tuple[list[Path], int]:
    """Observe some successive windows of a clip, and write each to a file of a folder.

    :return: the files, and the number of frames in these windows.
    :raises VideoError: the footage cannot be used.
    :raises UsageError: there are no such windows.
    :raises OSError: a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (
        open_video(path, options.wanted) as video,
        opencv_in_one_thread(),
        ThreadPoolExecutor(_THREADS) as pool,
    ):
        windows = plan_windows(video, options.window_s)
        if not (numbers and 0 <= numbers.start < numbers.stop <= len(windows)):
            raise UsageError(
                f"{path} has {len(windows)} windows, and none of the numbers {numbers}"
            )
        return WindowedClip(video, windows, options, StageClock(), pool).save(
            numbers, folder, progress
        )
