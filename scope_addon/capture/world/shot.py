# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of the footage as a whole, and of each person whom the body was fitted to."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from ....solver.body import Body
from ..camera.intrinsics import Camera
from ..camera.line_segments import Lines
from ..fitting.ablation import NO_ABLATION, Ablation
from ..tracking.track import Track
from .camera_path import CameraPath
from .placement import RawMotion


@dataclass(frozen=True)
class Shot:
    """One continuous recording. Where a motion is in the axes of one camera, this is the first frame's camera."""

    body: Body  # the one that the motion file names
    camera: Camera
    path: CameraPath  # of the camera, over all frames
    lines: Lines  # of the background, in the first frame's axes
    fps: Fraction
    image_size: tuple[int, int]  # width and height, pixels
    source: str  # name of the footage
    smoothing: bool = True  # False: every frame is fitted alone
    ablation: Ablation = NO_ABLATION
    uneven_ground: bool = False  # True: feet rest at any height

    @property
    def is_still(self) -> bool:
        """Whether there is only one frame."""
        return len(self.path) == 1


@dataclass(frozen=True)
class FittedPerson:
    """One person's track and the body fitted to each of its frames."""

    track: Track
    raw: RawMotion
    body: Body  # with its keypoints where the network places them, for the reprojection error
