# SPDX-License-Identifier: GPL-3.0-or-later
"""What observation passes on to the later stages, and to whom it reports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...notices import Notice
from ..camera.background_record import CameraMotion
from ..camera.intrinsics import Camera, choose_camera
from ..camera.line_segments import Lines
from ..fitting.live_body import LiveBody
from ..media.frame import Frame
from ..media.video import Video
from ..options import CaptureOptions
from ..perception.observation import Observation
from .clock import Progress

# Called with each decoded frame, its largest person, and the object that fits the body to such an
# observation.
Watch = Callable[[Frame, Observation | None, LiveBody], None]


@dataclass(frozen=True)
class Listeners:
    """Callbacks that report the work in progress."""

    progress: Progress
    watch: Watch


@dataclass(frozen=True)
class Footage:
    """What is known of the footage once all frames were observed, apart from its people."""

    timestamps: NDArray[np.float64]  # (T,) seconds
    camera: Camera
    camera_motion: CameraMotion
    lines: Lines  # of the background, in the first frame's camera axes
    cuts_s: list[float]
    execution: str  # what the networks ran on, for the report
    warnings: list[Notice]


def given_camera(video: Video, options: CaptureOptions) -> Camera:
    """Return the camera as options and footage describe it."""
    return choose_camera(
        video.width,
        video.height,
        focal_mm=options.focal_mm,
        fov_deg=options.fov_deg,
        calibration=options.calibration,
        metadata_focal_mm=video.focal_35mm,
    )
