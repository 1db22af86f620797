# SPDX-License-Identifier: GPL-3.0-or-later
"""Successive windows, observed in one pass over their frames; in those that two share, both are observed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence

from ...media.frame import Frame
from ...perception.observation import Observation
from ..clock import StageClock
from .plan import Window
from .window_run import WindowRun

# Called when a window has ended, with its run and that of the next window; returns the run to go on with.
Seam = Callable[[WindowRun, WindowRun | None], WindowRun | None]


def frame_pairs(frames: Iterator[Frame], clock: StageClock) -> Iterator[tuple[Frame, Frame | None]]:
    """Yield every frame with the one after it; each is decoded while the networks run on the previous one."""
    with clock.stage("decode"):
        upcoming = next(frames, None)
    while upcoming is not None:
        frame = upcoming
        with clock.stage("decode"):
            upcoming = next(frames, None)
        yield frame, upcoming


def run_windows(
    windows: Sequence[Window],
    begin: Callable[[Window], WindowRun],
    pairs: Iterator[tuple[Frame, Frame | None]],
    seam: Seam,
    watch: Callable[[Frame, Observation | None], None],
) -> None:
    """Observe the windows until their frames end.

    :param windows: at least one, in order.
    :param begin: starts the run of a window.
    :param pairs: from the first window's anchor on; see `frame_pairs`.
    :param watch: called with each frame and its largest person.
    """
    left = deque(windows)
    current: WindowRun | None = begin(left.popleft())
    following: WindowRun | None = None
    for frame, upcoming in pairs:
        while current is not None and current.window.has_ended(frame.timestamp_s):
            if following is None and left:
                following = begin(left.popleft())
            current, following = seam(current, following), None
        if current is None:
            return
        if following is None and left and left[0].warms_up(frame.timestamp_s):
            following = begin(left.popleft())
        largest = current.add(frame, upcoming)
        if following is not None:
            following.add(frame, upcoming)
        watch(frame, largest)
    if current is not None:
        seam(current, None)
