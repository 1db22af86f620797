# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length, from the background's edges and the largest people, in threads that run in
parallel with tracking.

First, everything that the solver needs is loaded: its kernels (compiled on first use) and the
lifting network. Once a person has been seen, the focal length is estimated from the edges of that
frame, and by fitting the body in some of those that follow. The result depends on the frames, not
on the speed of the threads.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from types import TracebackType

import numpy as np

from ...arrays import Float64Array
from ...machine_code.code_cache import compiled_kernels
from ..camera.background_record import BackgroundRecord
from ..camera.bars import longer_content_side
from ..camera.camera_rotation import BackgroundTracker
from ..camera.intrinsics import Camera, assumed_camera
from ..camera.zoom import Zoom
from ..perception.observation import Observation
from .focal_length import FocalFits, camera_by_edges, camera_by_fits, costs_before_zoom
from .live_body import LiveBody

_POLLING_INTERVAL_S = 0.2
# For the background and the edges; the solver has a thread of its own, as compiling must not delay
# them.
_THREADS = 2


class BackgroundEstimators:
    """A context that estimates the focal length from the largest people, which are added in order.

    Leaving it with an error, such as a cancel, drops work not yet begun. Others may follow the
    background in its ``pool``.
    """

    def __init__(
        self, camera: Camera, width: int, height: int, live: LiveBody, fits: FocalFits
    ) -> None:
        self._given_camera = camera
        self._size = (width, height)
        self._fits = fits
        self.pool = ThreadPoolExecutor(_THREADS, "scope-background")
        self._solver = ThreadPoolExecutor(1, "scope-solver")
        # Time and largest person of the last frame.
        self._largest: tuple[float, Observation] | None = None
        self._longer_px = float(max(width, height))
        self._assumed = assumed_camera(width, height, self._longer_px)
        self._by_edges: Future[Camera] | None = None
        # Of fits, each with its time.
        self._costs: list[tuple[float, Future[Float64Array | None]]] = []
        self._loading = self._solver.submit(live.load)

    def __enter__(self) -> BackgroundEstimators:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        # Do not wait: the solver may be compiling, and only those who need it then should wait for
        # it.
        for pool in (self.pool, self._solver):
            pool.shutdown(wait=False, cancel_futures=kind is not None)

    def add(
        self,
        time_s: float,
        largest: Observation | None,
        followed: BackgroundTracker | BackgroundRecord,
    ) -> None:
        """Use the frame before this one for the focal length, once a background was searched for
        edges.

        :param followed: the background, at least of all frames before.
        """
        # The background of this very frame may be followed meanwhile. If it finds the first edges,
        # it has set the bars before, and nobody was seen in the frame before, so they are merely
        # used one frame earlier or later.
        before = self._largest
        self._largest = None if largest is None else (time_s, largest)
        if self._given_camera.focal_deviation == 0.0 or not followed.edge_frames:
            return
        if self._by_edges is None:
            self._longer_px = longer_content_side(followed.bars, *self._size)
            self._assumed = assumed_camera(*self._size, self._longer_px)
            segments = followed.edge_frames[0].segments
            self._by_edges = self.pool.submit(
                camera_by_edges, segments, *self._size, self._longer_px
            )
        if before is not None and self._fits.is_due(before[0]):
            fit = self._solver.submit(self._fits.costs, before[1], self._assumed)
            self._costs.append((before[0], fit))

    def camera(self, record: BackgroundRecord, zoom: Zoom | None = None) -> Camera:
        """Return the camera of the first frame, once all were added; an assumed focal length is
        replaced by the estimate from edges and fits.

        :param zoom: what the lens does in the clip.
        """
        self.add(math.inf, None, record)
        if self._by_edges is None:
            return self._given_camera
        by_edges = self._by_edges.result()
        if zoom is not None:
            by_edges = by_edges.zoomed(1.0 / zoom.factors[record.edge_frames[0].row])
        costs = []
        for time_s, fit in self._costs:
            found = fit.result()
            if found is not None and zoom is not None:
                factor = np.interp(time_s, record.times, zoom.factors)
                found = costs_before_zoom(found, float(factor))
            if found is not None:
                costs.append(found)
        return camera_by_fits(by_edges, self._assumed, costs, self._longer_px)

    def wait_for_solver(self, progress: Callable[[int], None]) -> None:
        """Wait until the solver is loaded.

        :param progress: called several times a second with the number of kernels compiled so far,
            unless there is none.
        """
        while wait_for([self._loading], timeout=_POLLING_INTERVAL_S).not_done:
            if compiled := compiled_kernels():
                progress(compiled)
