# SPDX-License-Identifier: GPL-3.0-or-later
"""A clock and a source that tests drive by hand."""

from fractions import Fraction

import numpy as np
from scope.scope_addon.errors import VideoError
from scope.scope_addon.live.source import Clock, Picture


class FakeClock(Clock):
    """Time that passes only by sleeping."""

    def __init__(self):
        super().__init__()
        self.time_s = 100.0
        self.slept = []
        self.stop_after = None  # sleeps

    def now(self):
        return self.time_s

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.time_s += max(seconds, 0.0)
        if len(self.slept) == self.stop_after:
            self.stopped.set()


class FakeSource:
    """Plays each of several lists of timestamps; between two of them, it is interrupted.

    :param before: called before each picture with its place in the list; may wait.
    :param images: of each list's pictures; False for one that is damaged.
    """

    name = "fake"
    fps = Fraction(30)
    focal_35mm = None
    speed = 1.0

    def __init__(self, *runs, ends=False, before=lambda _: None, error=None, images=None):
        self.runs = list(runs)
        self.ends = ends
        self.before = before
        self.error = error
        self.images = images
        self.warnings = []
        self.opened = self.closed = 0

    def pictures(self, clock):
        self.opened += 1
        try:
            if not self.runs:
                raise VideoError("fake is gone")
            for index, time_s in enumerate(self.runs.pop(0)):
                self.before(index)
                image = self.images[index] if self.images else np.zeros((4, 4, 3), np.uint8)
                yield None if image is False else Picture(index, time_s, clock.now(), image)
            if self.error:
                raise self.error
        finally:
            self.closed += 1
