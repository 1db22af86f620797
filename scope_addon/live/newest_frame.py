# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a source in its own thread and keeps the newest frame only: those that come while it is not
taken are dropped.

Where not every frame can be processed, some are dropped as well so that the others follow each
other evenly (`Pace`).

An interrupted stream is opened again after a pause, and frame numbers and times continue. Where a
server changes the resolution while it runs, pictures keep the first one, so that what was estimated
from them still holds.

Frames that the source leaves out because they were damaged on their way are counted, and a sentence
says so.

These are every n-th, rather than whichever comes when there is time. A processor that takes 20 ms
for a frame and gets one every 17 ms would process frames 17, 33 or 50 ms apart. Smoothing passes
that on as jitter: velocities are known from the frames before, and each of these tells of another
moment.

The first seconds, in which size and floor are estimated as well, begin with the largest n that
gives 28 frames/s. A larger one is chosen only where frames take too long for that anyway, and where
even ones are hardly fewer: a frame every 67 ms, rather than after 50, 67 or 83 ms because each
takes 60.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import replace
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from ...solver.errors import ScopeError
from ..arrays import Float64Array, Uint8Array
from ..errors import VideoError
from .source import Clock, Picture, Source
from .stream import DAMAGED_S, STALLED_S

_POLLING_INTERVAL_S = 0.2  # in which a waiting main thread reacts to Ctrl-C on every system
SAME_SHAPE = 0.01  # relative difference of two pictures' width over height
DAMAGE_SAID_S = 10.0  # between two sentences about damaged frames
_CLOSING_S = 0.5  # for which the end of the capture waits for the source to be closed
# between frames: n is not raised beyond it without need, so that no slow source becomes slower
SLOWEST_S = 1 / 28
# between even frames beyond that, over uneven ones: to begin with n, and to keep it
MORE_TIME = 1.25
MAX_TIME = 1.35
# over which it is seen that frames take too long, and the least number of them
RECENT_S = 1.0
FEWEST = 8
IN_TIME_S = 4.0  # the same, that they would be processed in time with a lower n
# of the frames in these times, that take too long
LATE_SHARE = 0.15
RARE_SHARE = 0.08
# distance of the source's frames, over that for which n was chosen, from which n is chosen anew
SLOWER = 1.5
# of the time between two frames, which all but a few have to leave some of for n to be lowered
MAX_BUSY_SHARE = 0.8
_INTERVALS = 31  # of the source, whose median counts


class NewestFrame:
    """A context in which `take` gives the newest frame.

    :param reconnect_s: pause before an interrupted source is opened again; 0: the capture ends
        there.
    :param say: called with a sentence at each interruption, from the reading thread.
    :param received: gets every frame, from the reading thread, which it must not delay.
    """

    def __init__(
        self,
        source: Source,
        clock: Clock,
        reconnect_s: float = 0.0,
        say: Callable[[str], None] = lambda _: None,
        received: Callable[[Picture], None] = lambda _: None,
    ) -> None:
        self._received = received
        self._source = source
        self._clock = clock
        self._reconnect_s = reconnect_s
        self._say = say
        self._changed = threading.Condition()
        self._newest: Picture | None = None
        self._error: BaseException | None = None
        self._is_over = False
        self._warned = 0  # of the source's warnings, how many were said
        self._said = ""  # what was said of the interruption that lasts
        self._next_index = 0
        self._last_s = 0.0
        self._began_s = 0.0
        self._size: tuple[int, int] | None = None  # of the pictures that are given
        self._last_image: NDArray[Any] | None = None  # as it came
        self._changed_s = 0.0  # when it last differed from the one before
        self._is_frozen = False
        self._arrived_s = 0.0  # when the last one arrived
        self._pace = Pace()
        self._taken_s = 0.0  # when the last one was taken
        self._damage_said_s = -np.inf
        self.received = self.damaged = 0
        self._thread = threading.Thread(target=self._run, name="scope-live-source", daemon=True)

    def __enter__(self) -> NewestFrame:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._clock.stopped.set()
        # a read that never returns must not keep the program from ending
        self._thread.join(_CLOSING_S)

    def now(self) -> float:
        """Return the time of the clock by which frames arrive, in seconds."""
        return self._clock.now()

    def take(self) -> Picture | None:
        """Wait for the next frame and return the newest one; None after the last, or when the clock
        is stopped.

        The frame before counts as processed.

        :raises VideoError: the source cannot be read.
        """
        with self._changed:
            self._pace.add_duration(self.now() - self._taken_s)
            while self._newest is None and not self._is_over:
                # the source may be stalled, and its thread with it
                if self._clock.stopped.is_set():
                    return None
                self._changed.wait(_POLLING_INTERVAL_S)
            if self._newest is None and self._error is not None:
                raise self._error
            taken = self._newest
            self._newest = None
            if taken is not None:
                self._pace.take(taken.timestamp_s)
                self._taken_s = self.now()
            return taken

    def _run(self) -> None:
        try:
            while not self._read() and not self._clock.stopped.is_set():
                self._clock.sleep(self._reconnect_s)
        except BaseException as error:  # of a broken file or library: raised where frames are taken
            self._error = error
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    def _read(self) -> bool:
        """Read the source until it ends or is interrupted; return whether the capture is over.

        :raises ScopeError: the source failed, and is not to be opened again.
        """
        before = self.received
        try:
            # Closing it closes the camera or the connection, on every way out.
            with closing(
                cast("Generator[Picture | None, None, None]", self._source.pictures(self._clock))
            ) as pictures:
                for picture in pictures:
                    if self._clock.stopped.is_set():
                        return True
                    if picture is None:
                        self._note_damage()
                        continue
                    self._give(picture, is_first=self.received == before)
                    self._say_warnings()
            self._say_warnings()
            problem = f"{self._source.name} has ended"
        except ScopeError as error:
            if self._source.ends or self._reconnect_s <= 0 or not self.received:
                raise
            problem = str(error)
        if self._source.ends or self._reconnect_s <= 0:
            if not self.received:
                raise VideoError(
                    f"{self._source.name} delivered no frames; check that it shows an image"
                )
            return True
        if problem != self._said:  # once, not at every attempt
            self._said = problem
            self._say(f"{problem}; connecting again in {self._reconnect_s:g} s")
        return False

    def _give(self, picture: Picture, is_first: bool) -> None:
        """Replace the newest frame, with its number and time in the whole capture."""
        if is_first:
            self._said = ""
            self._first_index = self._next_index
            if not self.received:
                self._began_s = 0.0 if self._source.ends else picture.timestamp_s
        index = self._first_index + picture.index
        if self.received:  # of another connection or programme, times may go back, and go on here
            latest_s = picture.timestamp_s - self._last_s - 1e-3
            self._began_s = min(self._began_s, latest_s)
        time_s = max(picture.timestamp_s - self._began_s, 0.0)
        if self.received and not is_first:
            self._report_pause(picture.arrived_s - self._arrived_s)
        self._arrived_s = picture.arrived_s
        self._watch(picture)
        picture = replace(
            picture,
            index=index,
            timestamp_s=time_s,
            image_rgb=self._in_first_size(picture.image_rgb),
        )
        self._received(picture)
        with self._changed:
            is_due = self._pace.is_due(time_s)
            self.received += 1
            self._newest = picture if is_due else self._newest
            self._next_index = index + 1
            self._last_s = time_s
            self._changed.notify_all()

    def _say_warnings(self) -> None:
        """Say what the source has found to warn of since the last call."""
        new = self._source.warnings[self._warned :]
        self._warned += len(new)
        for warning in new:
            self._say(str(warning))

    def _note_damage(self) -> None:
        """Count a damaged frame, and say it, though not again and again."""
        self.damaged += 1
        if self.now() - self._damage_said_s > DAMAGE_SAID_S:
            self._damage_said_s = self.now()
            self._say(
                f"data of {self._source.name} was lost or damaged in transmission; damaged images "
                f"are left out, for at most {DAMAGED_S:g} s each time"
            )

    def _report_pause(self, seconds: float) -> None:
        """Say that nothing came for a while, if the source itself has not noticed: maybe the
        computer slept.
        """
        if seconds > STALLED_S:
            self._changed_s += seconds
            self._say(
                f"nothing came from {self._source.name} for {seconds:.0f} s, as when a computer "
                "sleeps; it goes on"
            )

    def _watch(self, picture: Picture) -> None:
        """Say that a source shows the same picture again and again, as servers do that have lost
        their camera.
        """
        last = self._last_image
        image = picture.image_rgb
        self._last_image = image
        # Some pixels first, which mostly differ.
        if last is None or not (
            np.array_equal(last[::16, ::16], image[::16, ::16]) and np.array_equal(last, image)
        ):
            self._changed_s = picture.arrived_s
            self._is_frozen = False
        elif (
            picture.arrived_s - self._changed_s > STALLED_S
            and not self._is_frozen
            and not self._source.ends
        ):
            self._is_frozen = True
            self._say(
                f"{self._source.name} has shown the same image for {STALLED_S:g} s; check "
                "whether it is frozen"
            )

    def _in_first_size(self, image: Uint8Array) -> Uint8Array:
        """Return a picture in the size of the first one, unless its shape is another one."""
        size = (image.shape[1], image.shape[0])
        wanted = self._size
        if wanted is None or abs(size[0] * wanted[1] / (size[1] * wanted[0]) - 1) > SAME_SHAPE:
            self._size = size
        if wanted is None or self._size == size:
            return image
        interpolation = cv2.INTER_AREA if size > wanted else cv2.INTER_LINEAR
        return cast(Uint8Array, cv2.resize(image, wanted, interpolation=interpolation))


class Pace:
    """Decides by the times that frames take, and by those of all frames, processed or not."""

    def __init__(self) -> None:
        self.every: int | None = None  # n; None before the frames' distance in time is known
        self._intervals: deque[float] = deque(maxlen=_INTERVALS)
        self._came_s: float | None = None
        self._taken_s: float | None = None
        self._chosen_for_s = 0.0  # between the source's frames when n was chosen
        # frame times and seconds, since n was changed
        self._took: deque[tuple[float, float]] = deque()

    def is_due(self, time_s: float) -> bool:
        """Note that a frame came, and return whether it may be processed.

        :param time_s: of the frame, later than the one before.
        """
        if self._came_s is not None:
            self._intervals.append(time_s - self._came_s)
        self._came_s = time_s
        if self.every is None and len(self._intervals) >= FEWEST:
            self._change(self._most)
        if self._taken_s is None or self.every is None or self.every == 1:
            return True
        return time_s - self._taken_s > (self.every - 0.5) * self._interval_s

    def take(self, time_s: float) -> None:
        """Note that the frame of this time is processed now."""
        self._taken_s = time_s

    def add_duration(self, seconds: float) -> None:
        """Note how long the frame took that was taken last, and choose n."""
        if self._taken_s is None or self.every is None:
            return
        self._took.append((self._taken_s, seconds))
        while self._took[0][0] < self._taken_s - IN_TIME_S:
            self._took.popleft()
        if self.every > self._most and not self._is_worth_it():
            self._change(self._most)
        elif self._share_above(self.every * self._interval_s, RECENT_S) > LATE_SHARE:
            self._raise()
        elif self._took[-1][0] - self._took[0][0] > IN_TIME_S - 2 * SLOWEST_S:
            for every in range(1, self.every):
                if (
                    self._share_above(MAX_BUSY_SHARE * every * self._interval_s, IN_TIME_S)
                    < RARE_SHARE
                ):
                    self._change(every)
                    return

    def _raise(self) -> None:
        """Choose a larger n, if there is one for which enough frames are processed in time, and
        still many.
        """
        assert self.every is not None
        if self.every < self._most:
            self._change(self.every + 1)
            return
        every = self.every + 1
        while self._costs_little(every, MORE_TIME, RECENT_S):
            if self._share_above(every * self._interval_s, RECENT_S) <= LATE_SHARE:
                self._change(every)
                return
            every += 1

    def _is_worth_it(self) -> bool:
        """Return whether an n beyond what is needed for 28 frames/s still serves its purpose, as
        far as is known.
        """
        assert self.every is not None
        if self._interval_s > SLOWER * self._chosen_for_s:
            return False
        return len(self._recent(IN_TIME_S)) < FEWEST or self._costs_little(
            self.every, MAX_TIME, IN_TIME_S
        )

    def _costs_little(self, every: int, more_time: float, recent_s: float) -> bool:
        """Return whether every n-th frame takes hardly more time than whichever frames could be
        processed.
        """
        uneven_s = float(np.maximum(self._recent(recent_s), self._most * self._interval_s).mean())
        return every * self._interval_s <= more_time * uneven_s

    def _change(self, every: int) -> None:
        self.every = every
        self._chosen_for_s = self._interval_s
        self._took.clear()

    @property
    def _most(self) -> int:
        """The largest n without need."""
        return max(int(SLOWEST_S / self._interval_s), 1)

    @property
    def _interval_s(self) -> float:
        return float(np.median(self._intervals))

    def _share_above(self, seconds: float, recent_s: float) -> float:
        """Return the share of the last frames that took longer; 0 where there are too few to
        tell.
        """
        took = self._recent(recent_s)
        return float(np.mean(took > seconds)) if len(took) >= FEWEST else 0.0

    def _recent(self, recent_s: float) -> Float64Array:
        """Return how long the last frames took."""
        return np.array(
            [each for time_s, each in self._took if time_s >= self._took[-1][0] - recent_s]
        )
