# SPDX-License-Identifier: GPL-3.0-or-later
"""Cold and warm fits of real frames: iterations, time, and how many converge.

The measurements are those that the capture passes to the solver: its networks process the clips
next to the checkout once, and the measurements are kept in build/bench. Weights, stages and robust
scales are the capture's; the shape is unknown in every frame. Cold: without an earlier estimate,
from `initial_states` through all stages. Warm: from the previous frame. Converged: cost within
0.1 % and joints within 1 mm of the result of the same start at a relative decrease of 1e-12.
"""

from __future__ import annotations

import os
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scope_addon.atomic_write import atomic_path
from ..scope_addon.capture.camera.intrinsics import choose_camera
from ..scope_addon.capture.fitting import weights as fit_weights
from ..scope_addon.capture.fitting.prepared_track import PreparedTrack, prepare_track
from ..scope_addon.capture.media.video import open_video
from ..scope_addon.capture.media.video_range import VideoRange
from ..scope_addon.capture.tracking.left_right import repair_left_right
from ..scope_addon.capture.tracking.people import people_of
from ..scope_addon.capture.tracking.track import Tracklet, make_track
from ..scope_addon.capture.tracking.tracker import PeopleTracker
from ..scope_addon.errors import NoPersonError
from ..solver import Body, Fit, FrameSolver, Options, Priors, Stage, State, fit_batch, load_body
from ..solver.measurements import Keypoints2D, Keypoints3D, Measurements, OrientationField

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data"
CACHE = ROOT / "build" / "bench"
CLIPS = (
    *(f"pose2sim/cam{k}.mp4" for k in (1, 2, 3, 4)),
    *(
        f"clips/{name}.mp4"
        for name in ("gesture_square", "squats_5fps", "run_moving_camera", "walk_side_static")
    ),
)
QUICK_CLIPS = CLIPS[:1]
TOLERANCES = (1e-4, 1e-5, 1e-6)  # relative decrease at which the last stage stops
REPORTED = 1e-6  # the solver's own
COST_SHARE = 1e-3
JOINTS_M = 1e-3
KEYS = ("pixels", "confidence2d", "points", "confidence3d", "directions", "confidence_directions")
FIXED = ("intrinsics", "indices", "starts", "ends", "joint_weights")


@dataclass
class Clip:
    """The measurements of one clip's frames in order, and the joint prior's weights."""

    frames: list[Measurements]
    joint_weights: NDArray[np.float64]  # (K,)


def load_clips(names: Sequence[str]) -> list[Clip]:
    """Read the clips' measurements, running the capture's networks where that has not been done
    yet.
    """
    body = load_body("scope")
    clips = []
    for name in names:
        path = CACHE / (Path(name).stem + ".npz")
        if not path.exists():
            print(f"finding keypoints in {name}, once", file=sys.stderr)
            _record(DATA / name, body, path)
        clips.append(_read(path))
    return clips


def prepare(video: Path, body: Body, end_s: float = float("inf")) -> PreparedTrack:
    """Find the person in a clip: what the first pass over it hands to the solver.

    :raises NoPersonError: nobody was found.
    """
    tracker = PeopleTracker("best", os.cpu_count() or 1, None)
    times = list[float]()
    tracklets: defaultdict[int, Tracklet] = defaultdict(Tracklet)
    with open_video(video, VideoRange(end_s=end_s)) as footage:
        camera = choose_camera(footage.width, footage.height, metadata_focal_mm=footage.focal_35mm)
        for frame in footage:
            for number, observation in tracker.step(frame.image_rgb, time_s=frame.timestamp_s):
                tracklets[number].add(len(times), observation)
            times.append(frame.timestamp_s)
    people, _ = people_of(times, list(tracklets.values()))
    if not people:
        raise NoPersonError(
            f"no person was found in {video}: the benchmark needs the clips of ../shared"
        )
    track = make_track(range(len(times)), times, people[0])
    return prepare_track(body, repair_left_right(track, camera), camera)


def _record(video: Path, body: Body, path: Path) -> None:
    """Keep what the first pass over a clip hands to the solver."""
    prepared = prepare(video, body)
    calls = [
        (prepared.measure(int(k)), prepared.priors) for k in np.flatnonzero(prepared.track.seen)
    ]
    write(path, calls)


def write(path: Path, calls: Sequence[tuple[Measurements, Priors]]) -> None:
    """Keep measurements, all of the same points, in a file."""
    rows = [_values(m) for m, _ in calls]
    arrays = {key: np.array([row[k] for row in rows]) for k, key in enumerate(KEYS)}
    m, priors = calls[0]
    a, _, c = _kinds(m)
    fixed = (m.intrinsics, a.indices, c.starts, c.ends, priors.joint_weights)
    arrays |= {key: np.asarray(value) for key, value in zip(FIXED, fixed, strict=True)}
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        np.savez(temporary, **arrays)


def _kinds(m: Measurements) -> tuple[Keypoints2D, Keypoints3D, OrientationField]:
    assert m.keypoints2d is not None
    assert m.keypoints3d is not None
    assert m.orientation_field is not None
    return m.keypoints2d, m.keypoints3d, m.orientation_field


def _values(m: Measurements) -> tuple[ArrayLike, ...]:
    a, b, c = _kinds(m)
    return a.pixels, a.confidence, b.points, b.confidence, c.directions, c.confidence


def _read(path: Path) -> Clip:
    with np.load(path) as data:
        arrays = {key: data[key] for key in (*KEYS, *FIXED)}
    frames = []
    for row in zip(*(arrays[key] for key in KEYS), strict=True):
        pixels, c2, points, c3, directions, cd = row
        frames.append(
            Measurements(
                arrays["intrinsics"],
                Keypoints2D(arrays["indices"], pixels, c2),
                Keypoints3D(arrays["indices"], points, c3),
                OrientationField(arrays["starts"], arrays["ends"], directions, cd),
            )
        )
    return Clip(frames, arrays["joint_weights"])


def capture_options(cold: bool, tolerance: float, limit: int = 50) -> Options:
    """Return the capture's options with another end of the last stage."""
    stages = (fit_weights.cold_stages if cold else fit_weights.warm_stages)(fit_weights.WEIGHTS)
    last: Stage = replace(stages[-1], tolerance=tolerance, max_iterations=limit)
    return replace(fit_weights.ROBUST, stages=(*stages[:-1], last))


def capture_priors(body: Body, clip: Clip) -> Priors:
    """Return the capture's priors with the shape unknown."""
    from ..solver import default_priors

    return replace(default_priors(body), joint_weights=clip.joint_weights)


@dataclass
class Outcome:
    """Results of the fits of one kind, cold or warm, at one tolerance; one entry per frame."""

    milliseconds: NDArray[np.float64]
    iterations: NDArray[np.int64]
    converged: NDArray[np.bool_]  # bool
    cost: NDArray[np.float64]

    def summary(self) -> dict[str, float]:
        """Return medians and shares."""
        return {
            "frames": len(self.cost),
            "milliseconds": float(np.median(self.milliseconds)),
            "iterations": float(np.median(self.iterations)),
            "converged": float(np.mean(self.converged)),
            "cost": float(np.median(self.cost)),
        }


def measure(clips: Sequence[Clip], tolerance: float, every: int = 1) -> dict[str, Outcome]:
    """Fit every frame cold and warm; return the outcomes by kind. `every` k-th frame is judged, all
    are followed.
    """
    body = load_body("scope")
    rows: dict[str, list[tuple[Any, ...]]] = {"cold": [], "warm": []}
    options = {kind: capture_options(kind == "cold", tolerance) for kind in rows}
    tight = {kind: capture_options(kind == "cold", 1e-12, 1000) for kind in rows}
    for clip in clips:
        solver = FrameSolver(body, capture_priors(body, clip))
        last: State | None = None
        for number, m in enumerate(clip.frames):
            for kind, init in (("cold", None), ("warm", last)):
                if kind == "warm" and init is None:
                    continue
                start = time.perf_counter()
                found = solver.fit(m, init, None, options[kind])
                elapsed = time.perf_counter() - start
                if kind == "warm" or last is None:
                    last = found.state
                if number % every == 0 and number > 0:
                    best = solver.fit(m, init, None, tight[kind])
                    rows[kind].append(
                        (elapsed * 1e3, found.iterations, same(found, best), found.cost)
                    )
    return {
        kind: Outcome(*(np.array(column) for column in zip(*r, strict=True)))
        for kind, r in rows.items()
    }


def same(found: Fit, best: Fit) -> bool:
    """Return whether a fit has converged to `best`."""
    apart = np.linalg.norm(found.t_camera_part - best.t_camera_part, axis=1).max()
    return bool(abs(found.cost - best.cost) <= COST_SHARE * best.cost and apart <= JOINTS_M)


def throughput(clips: Sequence[Clip], repeats: int = 5) -> dict[str, float]:
    """Return the cold frames fitted per second by one thread and by all cores, and their ratio."""
    body = load_body("scope")
    priors = capture_priors(body, clips[0])
    frames = [m for clip in clips for m in clip.frames]
    options = capture_options(True, REPORTED)
    rates: dict[int, list[float]] = {1: [], 0: []}
    for _ in range(repeats):
        for threads, found in rates.items():
            start = time.perf_counter()
            fit_batch(body, frames, priors=priors, options=options, threads=threads)
            found.append(len(frames) / (time.perf_counter() - start))
    one = float(np.median(rates[1]))
    all_cores = float(np.median(rates[0]))
    return {
        "one_thread": one,
        "all_cores": all_cores,
        "cores": os.cpu_count() or 1,
        "ratio": all_cores / one,
    }
