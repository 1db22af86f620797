# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length from the edges of buildings and rooms, and from fits of the body.

Most edges follow three orthogonal directions. How many of them the best Manhattan directions
explain (`manhattan`) depends on the focal length f:

    p(f) ∝ exp(κ score(f)) N(log f; log f_0, σ²)

with the assumed f_0 and σ. A wall seen frontally fits every f; p is then as wide as the assumption,
and the assumed focal length is kept.

The perspective of a body depends on its distance, and so on f. A few frames are fitted at several
focal lengths each, with a shape of their own, while the next frames are tracked. Keypoint errors
are in pixels, independent of f, so the weight of the normalized residuals grows with f². With the
mean cost c(f) of the frames,

    p(f) ∝ exp(−a c(f)) N(log f; log f_0, σ²),

where f_0 and σ are known without the fit: assumed, or estimated from edges. All frames together
count as a < 1 of them (`SHARE`), since the errors of keypoints and depths are correlated over all
frames of a person. This estimate is weak. People of known stature do not improve it: with preset
fast, the mean ratio to the true focal length over fourteen renders falls from 0.78 to 0.68 when
statures are given, because these also imply proportions.

Both are estimated in threads that run in parallel with tracking (`BackgroundEstimators`). First,
everything that the solver needs is loaded: its kernels (compiled on first use) and the lifting
network. Once a person has been seen, the edges of that frame are used, and the body is fitted in
some of those that follow. The result depends on the frames, not on the speed of the threads.

Source: Caprile and Torre 1990 (f from vanishing points).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from dataclasses import replace

import numpy as np

from ....solver import Body
from ...arrays import Float64Array
from ...machine_code.code_cache import compiled_kernels
from ..camera.background_record import BackgroundRecord
from ..camera.bars import longer_content_side
from ..camera.camera_rotation import BackgroundTracker
from ..camera.intrinsics import ASSUMED_DEVIATION, Camera, assumed_camera, estimated_camera, pinhole
from ..camera.line_segments import Segments
from ..camera.manhattan import Edges
from ..camera.zoom import Zoom
from ..perception.observation import Observation
from ..tracking.track import single_frame_track
from .live_body import LiveBody
from .prepared_track import prepare_track
from .stature import with_population
from .track_fit import fit_single_frame

KAPPA = 4.0
# The range and the steps of log(f / f_0).
LOG_RANGE = 0.7
COARSE_STEP = 0.05
FINE_STEP = 0.0125
FITTED_STEP = 0.0025  # finer, since evaluating the fits' likelihood costs nothing
MAX_DEVIATION = 0.1  # of log f; a less certain estimate is no better than the assumption
# Logarithms of the tried focal lengths, relative to the camera's.
LOG_RATIOS = np.array([-0.7, -0.35, 0.0, 0.35, 0.7])
SHARE = 0.2  # a; of 0 to 1.2, 0.2 to 0.3 is best for preset best, and 0.1 to 0.2 for fast
# The shape's weight: with less, a body imitates the perspective of another focal length.
SHAPE_WEIGHT = 10.0
# The first gap between fitted frames; each further one is twice as long, so an hour has some
# fifteen.
FIRST_GAP_S = 0.2


def camera_by_edges(segments: Segments, width: int, height: int, longer_px: float) -> Camera:
    """Return the camera with the focal length estimated from edges or, if that fails, the assumed
    one.

    :param longer_px: longer side of the image without letterbox bars, see `bars`.
    """
    camera = assumed_camera(width, height, longer_px)
    found = focal_from_edges(segments, width, height, camera.intrinsics[0, 0])
    return estimated_camera(width, height, *found, longer_px) if found else camera


def camera_by_fits(
    camera: Camera, assumed: Camera, costs: list[Float64Array], longer_px: float
) -> Camera:
    """Combine the camera's focal length with the likelihood from fits of the body.

    :param assumed: the camera of the fits.
    :param costs: (5,) of each fitted frame, see `FocalFits`.
    :param longer_px: longer side of the image without letterbox bars, see `bars`.
    """
    if not costs:
        return camera
    assumed_px = assumed.intrinsics[0, 0]
    log_ratio = np.arange(-LOG_RANGE, LOG_RANGE + 1e-9, FITTED_STEP)
    off = (log_ratio - np.log(camera.intrinsics[0, 0] / assumed_px)) / camera.focal_deviation
    mean, deviation = _moments(log_ratio, log_likelihood(costs, log_ratio) - 0.5 * np.square(off))
    width, height = 2 * camera.intrinsics[:2, 2]
    return estimated_camera(width, height, assumed_px * float(np.exp(mean)), deviation, longer_px)


def focal_from_edges(
    segments: Segments, width: int, height: int, assumed_px: float
) -> tuple[float, float] | None:
    """Estimate the focal length in pixels and its relative error from an image's edges; None if it
    is uncertain.
    """
    edges = Edges.of(segments, width, height)
    coarse = np.arange(-LOG_RANGE, LOG_RANGE + 1e-9, COARSE_STEP)
    scores = [edges.support(assumed_px * np.exp(x)) for x in coarse]
    best = float(coarse[_log_posterior(coarse, scores).argmax()])
    fine = np.arange(best - COARSE_STEP, best + COARSE_STEP + 1e-9, FINE_STEP)
    log_ratio = np.concatenate([coarse[np.abs(coarse - best) > COARSE_STEP + 1e-6], fine])
    known = dict(zip(coarse.tolist(), scores, strict=True))
    scores = [known.get(x) or edges.support(assumed_px * np.exp(x)) for x in log_ratio.tolist()]
    mean, deviation = _moments(log_ratio, _log_posterior(log_ratio, scores))
    return (assumed_px * float(np.exp(mean)), deviation) if deviation < MAX_DEVIATION else None


def _log_posterior(log_ratio: Float64Array, scores: list[float]) -> Float64Array:
    return KAPPA * np.array(scores) - 0.5 * np.square(log_ratio / ASSUMED_DEVIATION)


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


class FocalFits:
    """Fits single observations of a clip, in the calling thread."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._next_s = -np.inf
        self._gap_s = FIRST_GAP_S

    def is_due(self, timestamp_s: float) -> bool:
        """Whether a frame at this time is to be fitted; if so, schedule the next one."""
        if timestamp_s < self._next_s:
            return False
        self._next_s = timestamp_s + self._gap_s
        self._gap_s = 2 * self._gap_s
        return True

    def costs(self, observation: Observation, camera: Camera) -> Float64Array | None:
        """Return the (5,) costs of fits at the camera's focal length times e^`LOG_RATIOS`; None if
        a fit fails.

        Assumes square pixels and a central principal point, as for any camera that is not
        calibrated.
        """
        track = single_frame_track(observation)
        if not track.seen[0]:
            return None
        K = camera.intrinsics
        costs = []
        for ratio in np.exp(LOG_RATIOS):
            candidate = replace(
                camera, intrinsics=pinhole(2 * K[0, 2], 2 * K[1, 2], ratio * K[0, 0])
            )
            prepared = prepare_track(self._body, track, candidate)
            keypoints2d = prepared.weights.keypoints2d * ratio**2
            weights = replace(prepared.weights, keypoints2d=keypoints2d, shape=SHAPE_WEIGHT)
            priors = with_population(prepared.priors, self._body)
            found = fit_single_frame(replace(prepared, weights=weights, priors=priors))
            if found is None:
                return None
            costs.append(found.cost)
        return np.array(costs)


def costs_before_zoom(costs: Float64Array, zoom: float) -> Float64Array:
    """Return the (5,) costs at focal lengths of the first frame, of a frame with ``zoom`` times as
    long ones.
    """
    return np.interp(LOG_RATIOS + np.log(zoom), LOG_RATIOS, costs)


def log_likelihood(costs: list[Float64Array], log_ratio: Float64Array) -> Float64Array:
    """Return the (n,) log likelihood of focal lengths, up to a constant.

    :param costs: (5,) of each fitted frame, at least one, from `FocalFits.costs`.
    :param log_ratio: (n,) logarithms of the focal lengths, relative to the camera's.
    """
    return -SHARE * np.interp(log_ratio, LOG_RATIOS, np.mean(costs, axis=0))


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

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
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
        replaced by the estimate from edges and fits, and a given one is that of the picture between
        bars.

        :param zoom: what the lens does in the clip.
        """
        self.add(math.inf, None, record)
        if self._by_edges is None:
            longer_px = longer_content_side(record.bars, *self._size)
            return self._given_camera.between_bars(longer_px, *self._size)
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
