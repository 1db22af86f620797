# SPDX-License-Identifier: GPL-3.0-or-later
"""The main job: footage in, motions and a report out. Knows the order of the stages and nothing of their insides."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...solver.body import Body
from ...solver.errors import NoPersonError
from ..motion import Motion
from .assemble import assemble_motion, root_on_floor
from .camera import choose_camera
from .fitting import fit_track, refit_track
from .track import Track, TrackBuilder
from .tracker import Observation, PersonTracker
from .video import Frame, Video, open_video

# Called with the stage's name, what is done and the total (0: unknown). May raise CancelledError.
Progress = Callable[[str, int, int], None]
# Called with each decoded frame and who was seen in it.
Watch = Callable[[Frame, Observation | None], None]

SHORTEST_SHARE = 0.02  # seen in fewer frames than this, a "person" is a mistake of the detector


@dataclass(frozen=True)
class CaptureOptions:
    """How to capture; the defaults suit a phone clip of one person."""

    quality: str = "best"  # fast, balanced, best
    focal_mm: float | None = None
    fov_deg: float | None = None
    calibration: Path | None = None
    smoothing: bool = True
    threads: int = 0  # 0: as many as there are cores


@dataclass
class Capture:
    """One motion per person and the machine-readable report."""

    motions: list[Motion]
    report: dict


def capture(
    path: str | Path,
    body: Body,
    options: CaptureOptions,
    progress: Progress = lambda *_: None,
    watch: Watch = lambda *_: None,
) -> Capture:
    """Capture the strongest person of a video or picture.

    :raises VideoError: the footage cannot be used.
    :raises NoPersonError: nobody was found.
    :raises CancelledError: raised by ``progress`` itself, passed on.
    """
    path = Path(path)
    clock = _Clock()
    with open_video(path) as video:
        camera = choose_camera(
            video.width,
            video.height,
            focal_mm=options.focal_mm,
            fov_deg=options.fov_deg,
            calibration=options.calibration,
            metadata_focal_mm=video.focal_35mm,
        )
        tracker = PersonTracker(options.quality, options.threads or os.cpu_count() or 1)
        track = _observe(video, tracker, clock, progress, watch)
        warnings = list(video.warnings)
    _require_person(track, path)
    smoothing = options.smoothing and len(track) > 1

    with clock.stage("solver"):
        fitted = fit_track(body, track, camera, progress)
        if smoothing:
            fitted = refit_track(body, track, camera, fitted, root_on_floor(body, track, fitted), progress)
        motion = assemble_motion(
            body,
            track,
            fitted,
            camera,
            fps=video.fps,
            image_size=(video.width, video.height),
            source=path.name,
            smoothing=smoothing,
        )
    missing = int((~motion.valid).sum())
    if missing:
        warnings.append(f"{path.name}: nobody was seen in {missing} of {len(motion)} frames; these are filled in")
    report = {
        "source": str(path),
        "frames": len(motion),
        "people": 1,
        "valid_frames": int(motion.valid.sum()),
        "quality": options.quality,
        "body": body.name,
        "camera": camera.source,
        "focal_px": float(camera.intrinsics[0, 0]),
        "frame_rate": [video.fps.numerator, video.fps.denominator],
        "fps": clock.rates(len(motion)),
        "reprojection_px": float(motion.residual_px[motion.valid].mean()),
        "iterations": fitted.iterations,
        "warnings": warnings,
    }
    return Capture([motion], report)


def _observe(video: Video, tracker: PersonTracker, clock: _Clock, progress: Progress, watch: Watch) -> Track:
    builder = TrackBuilder()
    frames = iter(video)
    while True:
        with clock.stage("decode"):
            frame = next(frames, None)
        if frame is None:
            return builder.build()
        with clock.stage("networks"):
            observation = tracker.step(frame.image_rgb)
            builder.add(frame.index, frame.timestamp_s, observation)
        watch(frame, observation)
        progress("finding the person", frame.index + 1, video.frame_count)


def _require_person(track: Track, path: Path) -> None:
    seen, total = int(track.seen.sum()), len(track)
    if seen == 0 or seen < SHORTEST_SHARE * total:
        looked = f"in the {total} frames of {path.name}" if total > 1 else f"in {path.name}"
        raise NoPersonError(
            f"no person was found {looked}: the footage needs one person of whom most of the body is in the picture"
        )


class _Clock:
    """Seconds spent by stage; stages that overlap in threads count what the main thread waited for."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._entered: list[tuple[str, float]] = []

    def stage(self, name: str) -> _Clock:
        self._entered.append((name, 0.0))
        return self

    def __enter__(self) -> None:
        self._entered[-1] = (self._entered[-1][0], time.perf_counter())

    def __exit__(self, *_: object) -> None:
        name, since = self._entered.pop()
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - since

    def rates(self, frames: int) -> dict[str, float]:
        """Frames per second of each stage and of all together."""
        seconds = dict(self.seconds, total=sum(self.seconds.values()))
        return {name: round(frames / max(s, 1e-9), 2) for name, s in seconds.items()}
