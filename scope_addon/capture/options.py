# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of a capture, and what can be refused before any footage is opened."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ...solver.body import Body
from ..errors import UsageError
from .camera.calibration import read_calibration
from .camera.intrinsics import choose_camera
from .fitting.ablation import ALL_PARTS, Parts
from .fitting.hand_measurements import require_fingers
from .fitting.stature import require_stature
from .media.video_range import VideoRange, Wanted
from .perception.adapters.detectors.box_detector import BoxDetector
from .perception.adapters.keypoints.keypoint_network import KeypointNetwork
from .perception.execution import AUTO, Execution
from .perception.sessions import landmark_network_name
from .tracking.tracker import MOST_PEOPLE

LARGEST = "largest"
ALL = "all"


@dataclass(frozen=True)
class CaptureOptions:
    """How to capture; the defaults suit a phone clip of one person."""

    quality: str = "best"  # fast, balanced, best
    people: int | str = LARGEST  # how many at most; "all"; "largest": the most prominent one over the clip
    heights_m: Sequence[float] = ()  # of the people, the most prominent one first; of further ones it is found
    focal_mm: float | None = None
    fov_deg: float | None = None
    calibration: Path | None = None
    wanted: Wanted = VideoRange()  # which frames
    smoothing: bool = True
    threads: int = 0  # 0: as many as there are cores
    hands: bool = False  # fingers too; the body needs finger joints
    provider: str = AUTO  # what the networks run on; see `execution`
    detector: Path | None = None  # the user's own networks, ONNX files; see `adapters`
    keypoints: Path | None = None
    parts: Parts = ALL_PARTS  # for experiments


def check_options(body: Body, options: CaptureOptions) -> None:
    """Refuse what no footage can be captured with, as far as it is known without opening a network.

    :raises UsageError: an option has an impossible value, contradicts another one or does not suit the body.
    :raises InputError: the calibration cannot be used.
    """
    most_people(options.people)
    landmark_network_name(options.quality)
    Execution(options.provider)
    if options.keypoints and not options.parts.lifter:
        raise UsageError("the lifter cannot be left out with a keypoint file: such a network tells nothing of depth")
    if options.hands:
        require_fingers(body)
    for height_m in options.heights_m:
        require_stature(body, height_m)
    if options.focal_mm is not None or options.fov_deg is not None:
        choose_camera(1, 1, focal_mm=options.focal_mm, fov_deg=options.fov_deg, calibration=options.calibration)
    elif options.calibration:
        read_calibration(options.calibration)


def check_networks(options: CaptureOptions) -> None:
    """Open the user's networks once, for a batch to refuse them before its first clip.

    :raises ModelFileError: one of them cannot be used.
    """
    if options.detector:
        BoxDetector(options.detector, threads=1)
    if options.keypoints:
        KeypointNetwork(options.keypoints, threads=1)


def most_people(people: int | str) -> int:
    """Return how many people are captured at most.

    :raises UsageError: no number from 1 to `MOST_PEOPLE`, nor one of the words.
    """
    if people == LARGEST:
        return 1
    if people == ALL:
        return MOST_PEOPLE
    if isinstance(people, str) or not 1 <= people <= MOST_PEOPLE:
        raise UsageError(f"people must be {LARGEST}, {ALL} or 1 to {MOST_PEOPLE}, but is {people!r}")
    return people
