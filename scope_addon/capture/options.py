# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of a capture as the pipeline reads them, and their validation before any footage is
opened.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...solver.body import Body
from ..errors import UsageError
from ..footage_view import AS_IN_FILE, FootageView
from ..options import Place, option, options_at
from ..options.capture import ALL, AUTO, LARGEST, OFF, CaptureDeclaration, NetworkDeclaration
from .camera.calibration import Calibration, read_calibration
from .camera.given_path import read_camera_path
from .camera.intrinsics import check_lens
from .fitting.hand_measurements import require_fingers
from .fitting.stature import require_stature
from .media.video_range import FootageRange, Timecode, VideoRange, parse_range, parse_time
from .perception.adapters.box_detector import BoxDetector
from .perception.adapters.keypoint_network import KeypointNetwork
from .perception.region import Crop, parse_crop
from .perception.sessions import Execution, landmark_network_name
from .tracking.chosen_person import ChosenPerson
from .tracking.tracker import MAX_PEOPLE

WINDOW_S = 120.0


@dataclass(frozen=True)
class CaptureOptions(NetworkDeclaration, CaptureDeclaration):
    """How to capture; the defaults suit a phone clip of one person.

    Its fields are the declared options, of which ``start``, ``end``, ``fps``, ``rotate`` and
    ``mirror`` together are ``wanted``.
    """

    wanted: FootageRange = VideoRange()  # range of frames
    part: Crop | None = None  # of the picture in which people are looked for
    chosen: ChosenPerson | None = None  # who is captured first; None: the most prominent one
    # The calibration, if it was read before; None: as ``calibration`` says.
    known_calibration: Calibration | None = None
    # Of the clocks of further cameras, seconds; None: unknown. Empty: all are unknown.
    offsets_s: Sequence[float | None] = ()
    # The length of the windows in which clips at least twice as long are observed.
    window_s: float = WINDOW_S


def capture_options(values: Mapping[str, Any]) -> CaptureOptions:
    """Convert the values of a command line or a request to the pipeline's options.

    :param values: by option name; other names are ignored.
    :raises UsageError: a time, the frame rate, the part of the picture or the chosen person cannot
        be parsed, or the end does not come after the start.
    """
    fields: dict[str, Any] = {}
    for each in options_at(Place.CAPTURE):
        value = values[each.name]
        fields[each.name] = Path(value) if each.value_type is Path and value is not None else value
    view = FootageView(int(values["rotate"]), values["mirror"])
    return CaptureOptions(
        wanted=parse_range(values["start"], values["end"], values["fps"], view=view),
        part=parse_crop(values["crop"]) if values["crop"] else None,
        chosen=parse_person(values["person"]) if values["person"] else None,
        offsets_s=parse_offsets(values["offset"]) if values["offset"] else (),
        **fields,
    )


def parse_offsets(text: str) -> tuple[float | None, ...]:
    """Parse the offsets of further cameras' clocks, seconds, such as "1.25,auto".

    :raises UsageError: one is neither a number nor auto.
    """
    offsets: list[float | None] = []
    for each in text.split(","):
        if each.strip() == AUTO:
            offsets.append(None)
            continue
        if not re.fullmatch(r"\s*[+-]?\d{1,5}(\.\d{1,9})?\s*", each, re.A):
            raise UsageError(
                f"--offset {text[:60]!r} is not a list of offsets: give seconds, or {AUTO}, for "
                "each further video, such as 1.25,auto"
            )
        offsets.append(float(each))
    return tuple(offsets)


def parse_person(text: str) -> ChosenPerson:
    """Parse "x,y@time" or "x,y", which is at the beginning.

    :raises UsageError: it is neither.
    """
    place, _, time = text.partition("@")
    numbers = re.fullmatch(r"\s*(\d{1,6}(?:\.\d+)?)\s*,\s*(\d{1,6}(?:\.\d+)?)\s*", place, re.A)
    time_s = parse_time(time) if time else 0.0
    if numbers is None or isinstance(time_s, Timecode):
        raise UsageError(
            f"--person {text[:60]!r} is not a place: give x and y in pixels and a time in seconds "
            "or MM:SS, such as 640,360@2.5"
        )
    return ChosenPerson(float(numbers[1]), float(numbers[2]), time_s if time else None)


def check_options(body: Body, options: CaptureOptions, has_views: bool = False) -> None:
    """Check the options as far as possible without opening footage or networks.

    :param has_views: whether several cameras are captured.
    :raises UsageError: an option has an impossible value, contradicts another one or does not suit
        the body, or is for several cameras.
    :raises InputError: the calibration or the camera's path cannot be used.
    """
    most_people(options.people)
    landmark_network_name(options.quality)
    Execution(options.provider)
    if problem := option("hands").type_error(options.hands):
        raise UsageError(f"hands {problem}")
    if options.hands != OFF:
        require_fingers(body)
    for height_m in options.heights_m:
        require_stature(body, height_m)
    check_lens(options.focal_mm, options.fov_deg, options.calibration, options.camera_path)
    if options.calibration and not has_views:
        read_calibration(options.calibration)
    if options.offsets_s and not has_views:
        raise UsageError("--offset is for several cameras, but one video was given")
    if has_views and options.camera_path is not None:
        raise UsageError(
            "the path of a camera cannot be given with several videos, whose cameras stand still"
        )
    if has_views and options.chosen is not None:
        raise UsageError(
            "--person is a place in one video, but several were given: leave it out; the most "
            "prominent person of the first video is captured"
        )
    if options.belt_speed_m_s and not options.treadmill:
        raise UsageError("--belt-speed is for people on a treadmill: add --treadmill")
    if options.belt_speed_m_s and (options.camera_path or has_views):
        raise UsageError(
            "--belt-speed moves the camera along with the people, which contradicts a given path "
            "of the camera, and several cameras: leave out one of them"
        )
    if options.camera_path:
        read_camera_path(options.camera_path)
        if options.wanted.view != AS_IN_FILE:
            raise UsageError(
                "the path of a camera is for the footage as its file shows it: leave out --rotate "
                "and --mirror, in the panel Turn and Mirror"
            )
    for each in options_at(Place.CAPTURE):  # ranges not checked above
        if problem := each.range_error(getattr(options, each.name)):
            raise UsageError(f"{each.flag} {problem}")


def check_networks(options: CaptureOptions) -> None:
    """Open the user's networks once, so that a batch fails before its first clip.

    :raises ModelFileError: one of them cannot be used.
    """
    if options.detector:
        BoxDetector(options.detector, threads=1)
    if options.keypoints:
        KeypointNetwork(options.keypoints, threads=1)


def most_people(people: int | str) -> int:
    """Return the maximum number of people to capture.

    :raises UsageError: neither a number from 1 to `MAX_PEOPLE` nor one of the words.
    """
    if people == LARGEST:
        return 1
    if people == ALL:
        return MAX_PEOPLE
    if isinstance(people, str) or not 1 <= people <= MAX_PEOPLE:
        raise UsageError(f"people must be {LARGEST}, {ALL} or 1 to {MAX_PEOPLE}, but is {people!r}")
    return people
