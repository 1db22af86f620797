# SPDX-License-Identifier: GPL-3.0-or-later
"""What the solver knows of the footage as a whole, and of each person once the body is fitted."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from ....solver.body import Body
from ..camera.intrinsics import Camera
from ..camera.line_segments import Lines
from ..fitting.ablation import NO_ABLATION, Ablation
from ..fitting.frame_sequence import FittedTrack
from ..tracking.track import Track
from .camera_path import CameraPath


@dataclass(frozen=True)
class Shot:
    """One continuous recording. "The camera" of a motion in one frame's axes is the first frame's."""

    body: Body  # the one that the motion file names
    camera: Camera
    path: CameraPath  # where each frame's camera was
    lines: Lines  # of the background, in the first frame's axes
    fps: Fraction
    image_size: tuple[int, int]  # width and height, pixels
    source: str  # the footage's name
    smoothing: bool = True  # of the motion over time, with the feet locked
    ablation: Ablation = NO_ABLATION

    @property
    def is_picture(self) -> bool:
        """Whether there is one frame only."""
        return len(self.path) == 1


@dataclass(frozen=True)
class FittedPerson:
    """One person's track and the body fitted to it in each frame's camera."""

    track: Track
    fit: FittedTrack
    seen: Body  # the body with its keypoints where the network sees them, for the reprojection error
