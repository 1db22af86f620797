# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done in threads of its own while the networks are loaded and look at the frames.

From the start, everything is loaded that the solver needs: its kernels (on a new machine they are compiled) and the
lifting network. Then each frame's background is looked at; as soon as somebody has been seen, also the background's
edges, for the focal length, and the body is solved for in some frames, for the same. What comes out of it depends on
the frames, not on how fast the threads are.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType

import numpy as np

from ..camera.bars import longer_content_side
from ..camera.camera_rotation import BackgroundTracker
from ..camera.intrinsics import Camera, assumed_camera
from ..media.video import Frame
from ..perception.observation import Observation
from .focal_fits import FocalFits
from .focal_length import camera_by_edges, camera_by_fits
from .live_body import LiveBody

_THREADS = 2  # the background and its edges; the solver has another one: while it is compiled, it holds up neither


class BesideTracking:
    """Takes frames in order. Leaving it on an error, such as a cancel, drops what has not begun; no thread stays."""

    def __init__(self, camera: Camera, width: int, height: int, live: LiveBody, fits: FocalFits) -> None:
        self.background = BackgroundTracker(camera, width, height)
        self._given_camera, self._size, self._fits = camera, (width, height), fits
        self._pool = ThreadPoolExecutor(_THREADS, "scope-beside")
        self._solver = ThreadPoolExecutor(1, "scope-solver")
        self._looking: Future[None] | None = None
        self._largest: tuple[float, Observation] | None = None  # when, and who, in the frame that is looked at
        self._longer_px = float(max(width, height))
        self._by_edges: Future[Camera] | None = None
        self._costs: list[Future[np.ndarray | None]] = []
        self._solver.submit(live.load)

    def __enter__(self) -> BesideTracking:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        # Not waited for: on a new machine the solver compiles for a while, and whoever needs it then waits by himself.
        for pool in (self._pool, self._solver):
            pool.shutdown(wait=False, cancel_futures=kind is not None)

    def add(
        self, frame: Frame, people: list[Observation], largest: Observation | None, is_cut: bool = False
    ) -> None:
        """Begin with this frame, the first of a scene if ``is_cut``; ``largest``: of the people.

        Waits for the background of the one before, and raises what went wrong there.
        """
        self.wait()
        points = [o.keypoints_px for o in people]
        self._looking = self._pool.submit(self.background.add, frame.image_rgb, frame.timestamp_s, points, is_cut)
        if largest is not None:
            self._largest = frame.timestamp_s, largest

    def wait(self) -> None:
        """Until the backgrounds of the frames so far have been looked at."""
        if self._looking is not None:
            self._looking.result()
        if self._given_camera.focal_deviation == 0.0 or not self.background.has_searched_edges:
            return
        if self._by_edges is None:
            self._longer_px = longer_content_side(self.background.bars, *self._size)
            self._by_edges = self._pool.submit(
                camera_by_edges, self.background.segments, *self._size, self._longer_px
            )
        if self._largest is not None and self._fits.is_due(self._largest[0]):
            self._costs.append(self._solver.submit(self._fits.costs, self._largest[1], self._assumed()))
        self._largest = None

    def camera(self) -> Camera:
        """The camera, with the focal length that edges and fits tell if it was only assumed."""
        if self._by_edges is None:
            return self._given_camera
        costs = [costs for each in self._costs if (costs := each.result()) is not None]
        return camera_by_fits(self._by_edges.result(), self._assumed(), costs, self._longer_px)

    def _assumed(self) -> Camera:
        return assumed_camera(*self._size, self._longer_px)
