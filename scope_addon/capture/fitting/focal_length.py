# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length from the edges of buildings and rooms, or from the camera's own turns.

Most edges follow three orthogonal directions. How many of them the best Manhattan directions
explain (`manhattan`) depends on the focal length f:

    p(f) ∝ exp(κ score(f)) N(log f; log f_0, σ²)

with the assumed f_0 and σ. A wall seen frontally fits every f; p is then as wide as the assumption,
and the assumed focal length is kept.

The perspective of a person's body tells nothing: fits of the body at several focal lengths, in real
people before eight cameras, had errors of 16 % on average with eight frames each, where the
assumption alone has 11 %.

The estimate is made in a thread that runs in parallel with tracking (`BackgroundEstimators`), from
the edges of the first frame in which a person has been seen. Another thread loads everything that
the solver needs: its kernels (compiled on first use) and the lifting network. The result depends on
the frames, not on the speed of the threads.

Source: Caprile and Torre 1990 (f from vanishing points).
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from dataclasses import replace

import numpy as np

from ...arrays import Float64Array
from ...machine_code.code_cache import compiled_kernels
from ..camera.background_record import BackgroundRecord
from ..camera.bars import content_size
from ..camera.camera_rotation import BackgroundTracker
from ..camera.intrinsics import Camera, assumed_camera, estimated_camera
from ..camera.line_segments import Segments
from ..camera.manhattan import Edges
from ..camera.zoom import Zoom, focal_by_turns
from .live_body import LiveBody

KAPPA = 4.0
# The range and the steps of log(f / f_0).
LOG_RANGE = 0.7
COARSE_STEP = 0.05
FINE_STEP = 0.0125
# Of log f, against the assumption's; a less certain estimate is no better than the assumption.
MAX_DEVIATION = 0.8


def camera_by_edges(
    segments: Segments, width: int, height: int, content: tuple[float, float]
) -> Camera:
    """Return the camera with the focal length estimated from edges or, if that fails, the assumed
    one.

    :param content: width and height of the image without letterbox bars, see `bars`.
    """
    camera = assumed_camera(width, height, content)
    found = focal_from_edges(segments, width, height, camera)
    return estimated_camera(width, height, *found, content) if found else camera


def focal_from_edges(
    segments: Segments, width: int, height: int, assumed: Camera
) -> tuple[float, float] | None:
    """Estimate the focal length in pixels and its relative error from an image's edges; None if it
    is uncertain.

    :param assumed: the camera as it is without edges.
    """
    assumed_px = assumed.intrinsics[0, 0]
    assumed_deviation = assumed.focal_deviation
    edges = Edges.of(segments, width, height)
    coarse = np.arange(-LOG_RANGE, LOG_RANGE + 1e-9, COARSE_STEP)
    scores = [edges.support(assumed_px * np.exp(x)) for x in coarse]
    best = float(coarse[_log_posterior(coarse, scores, assumed_deviation).argmax()])
    fine = np.arange(best - COARSE_STEP, best + COARSE_STEP + 1e-9, FINE_STEP)
    log_ratio = np.concatenate([coarse[np.abs(coarse - best) > COARSE_STEP + 1e-6], fine])
    known = dict(zip(coarse.tolist(), scores, strict=True))
    scores = [known.get(x) or edges.support(assumed_px * np.exp(x)) for x in log_ratio.tolist()]
    mean, deviation = _moments(log_ratio, _log_posterior(log_ratio, scores, assumed_deviation))
    if deviation >= MAX_DEVIATION * assumed_deviation:
        return None
    return assumed_px * float(np.exp(mean)), deviation


def _log_posterior(
    log_ratio: Float64Array, scores: list[float], assumed_deviation: float
) -> Float64Array:
    return KAPPA * np.array(scores) - 0.5 * np.square(log_ratio / assumed_deviation)


def _moments(log_ratio: Float64Array, log_p: Float64Array) -> tuple[float, float]:
    """Return mean and standard deviation of log(f / f_0), integrated over unevenly spaced
    values.
    """
    order = np.argsort(log_ratio, kind="stable")
    x = log_ratio[order]
    log_p = log_p[order]
    p = np.exp(log_p - log_p.max()) * np.gradient(x)
    p /= p.sum()
    mean = float(p @ x)
    return mean, float(np.sqrt(p @ np.square(x - mean)))


_POLLING_INTERVAL_S = 0.2
# For the background and the edges; the solver has a thread of its own, as compiling must not delay
# them.
_THREADS = 2


class BackgroundEstimators:
    """A context that estimates the focal length from the background, and loads the solver.

    Leaving it with an error, such as a cancel, drops work not yet begun. Others may follow the
    background in its ``pool``.
    """

    def __init__(self, camera: Camera, width: int, height: int, live: LiveBody) -> None:
        self._given_camera = camera
        self._size = (width, height)
        self.pool = ThreadPoolExecutor(_THREADS, "scope-background")
        self._solver = ThreadPoolExecutor(1, "scope-solver")
        self._by_edges: Future[Camera] | None = None
        self._loading = self._solver.submit(live.load)

    def __enter__(self) -> BackgroundEstimators:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        # Do not wait: the solver may be compiling, and only those who need it then should wait for
        # it.
        for pool in (self.pool, self._solver):
            pool.shutdown(wait=False, cancel_futures=kind is not None)

    def use_edges(self, followed: BackgroundTracker | BackgroundRecord) -> None:
        """Estimate an unknown focal length from the first edges of a background, once it has
        some.
        """
        is_known = self._given_camera.focal_deviation == 0.0
        if is_known or self._by_edges is not None or not followed.edge_frames:
            return
        segments = followed.edge_frames[0].segments
        content = content_size(followed.bars, *self._size)
        self._by_edges = self.pool.submit(camera_by_edges, segments, *self._size, content)

    def camera(self, record: BackgroundRecord, zoom: Zoom | None = None) -> Camera:
        """Return the camera of the first frame, from the background of all frames; an assumed focal
        length is replaced by the estimate, and a given one is that of the picture between bars.

        :param zoom: what the lens does in the clip.
        """
        self.use_edges(record)
        if self._by_edges is None:
            content = content_size(record.bars, *self._size)
            return self._given_camera.between_bars(content, *self._size)
        camera = self._by_edges.result()
        if zoom is None:
            return camera
        return camera.zoomed(1.0 / zoom.factors[record.edge_frames[0].row])

    def by_turns(self, record: BackgroundRecord, camera: Camera) -> tuple[BackgroundRecord, Camera]:
        """Return the background and the camera whose focal length its own turns tell, if they tell
        more than what was known: those given otherwise.

        With a wrong focal length, the rotations of corners do not agree, and may have been lost.
        """
        found = None
        if camera.focal_deviation > 0.0:
            found = focal_by_turns(
                record.corners, record.times, self._given_camera, max(self._size)
            )
        if found is None or found.deviation >= camera.focal_deviation:
            return record, camera
        known = found.known.copy()
        # Corners are not kept while they rest: whether they were lost, the record alone tells.
        unseen = slice(int(record.corners.rows[-1]) + 1, None)
        known[unseen] = record.known[unseen]
        focal_px = found.ratio * float(self._given_camera.intrinsics[0, 0])
        content = content_size(record.bars, *self._size)
        turned = replace(
            record,
            R_first_camera=found.R_first_camera,
            known=known,
            inlier_shares=[],  # The wrong focal length has lowered them.
        )
        return turned, estimated_camera(*self._size, focal_px, found.deviation, content)

    def wait_for_solver(self, progress: Callable[[int], None]) -> None:
        """Wait until the solver is loaded.

        :param progress: called several times a second with the number of kernels compiled so far,
            unless there is none.
        """
        while wait_for([self._loading], timeout=_POLLING_INTERVAL_S).not_done:
            if compiled := compiled_kernels():
                progress(compiled)
