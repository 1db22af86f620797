# SPDX-License-Identifier: GPL-3.0-or-later
"""The options that the capture reads: what is captured, and the networks."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from .record import Argument, Choice, Option, Place, Property, Section, declared, options_of

# people
LARGEST = "largest"
ALL = "all"
# hands
OFF = "off"
AUTO = "auto"
ON = "on"

_CAPTURE = Place.COMMAND_LINE | Place.WORKER
_EVERYWHERE = _CAPTURE | Place.PANEL
_LIVE = Place.LIVE | Place.LIVE_WORKER

QUALITIES = (
    Choice("fast", "Fast", "Smallest network: for a first look or a slow computer", 0),
    Choice("balanced", "Balanced", "Slightly less accurate than Best, and faster", 1),
    Choice("best", "Best", "Largest network, most accurate", 2),
)
PEOPLE = (
    Choice(LARGEST, "One", "The most prominent person", 0),
    Choice(ALL, "Everyone", "Everyone who is clearly visible", 1),
)
_COUNT = Choice("count", "At Most", "The most prominent people, up to a number", 2)
ROTATIONS = (
    Choice("0", "As in the File", "The footage is upright as its file says", 0),
    Choice("90", "90° Clockwise", "Turn the footage a quarter turn clockwise", 1),
    Choice("180", "Upside Down", "The footage is upside down", 2),
    Choice("270", "90° Counterclockwise", "Turn the footage a quarter turn counterclockwise", 3),
)
BODIES = (
    Choice("scope", "Body", "The built-in body with SMPL's 24 joints", 0),
    Choice(
        "scope_h",
        "Body with Hands",
        "The built-in body with SMPL+H's 52 joints, fingers included",
        1,
    ),
    Choice("file", "From File", "Your own SMPL, SMPL+H, SMPL-X or STAR file", 2),
)
HANDS = (  # the numbers of off and on are those that .blend files stored when hands were a checkbox
    Choice(OFF, "Off", "Leave the fingers at rest", 0),
    Choice(ON, "On", "Capture hands of all sizes", 1),
    Choice(AUTO, "Automatic", "Capture hands that are large enough in the image to be read", 2),
)
LENSES = (
    Choice("auto", "Automatic", "Read from the file's metadata if present, estimated otherwise", 0),
    Choice("focal", "Focal Length", "Enter the 35 mm equivalent focal length", 1),
    Choice("fov", "Field of View", "Enter the field of view along the longer side of the image", 2),
    Choice(
        "file",
        "Calibration",
        "Read focal lengths, principal point and distortion from a calibration file",
        3,
    ),
    Choice(
        "camera",
        "Scene Camera",
        "Use the lens and the motion of a camera in the scene, as Blender's tracker solves it",
        4,
    ),
)


MOST_VIEWS = 8  # videos of the same moment
_MAX_PEOPLE = 100  # whose heights can be given


def _parse_people(text: str) -> int | str:
    if text in (LARGEST, ALL):
        return text
    if not re.fullmatch("[0-9]{1,6}", text) or int(text) < 1:
        raise ValueError("must be all, largest or a number from 1")
    return int(text)


def _parse_heights(text: str) -> tuple[float, ...]:
    """Convert a list in centimetres, one number for each person, to metres."""
    numbers = text.split(",")
    if len(numbers) > _MAX_PEOPLE:
        raise ValueError(f"must give at most {_MAX_PEOPLE} heights, not {len(numbers)}")
    try:
        return tuple(float(number) / 100 for number in numbers)
    except ValueError as error:
        raise ValueError(
            "must be in centimetres, such as 175, or 175,162 for two people"
        ) from error


def _range_limit(settings: Any, name: str) -> str | None:
    return f"{getattr(settings, name):.6f}" if settings.use_range else None


def _forget_places(settings: Any, _context: Any) -> None:
    """Forget the chosen person and the part in which people are looked for, whose places are in the
    picture as it was turned before.
    """
    settings.forget_places()


_TURNS_PICTURE = {"update": _forget_places}
_TIME = {"step": 10, "precision": 2, "subtype": "TIME_ABSOLUTE", "unit": "TIME_ABSOLUTE"}


@dataclass(frozen=True)
class CaptureDeclaration:
    """The options that the pipeline reads are fields; those among them that only the panel or the
    command line has are class variables.
    """

    quality: str = declared(
        "best",
        _EVERYWHERE,
        "speed versus accuracy",
        choices=QUALITIES,
    )
    people: int | str = declared(
        LARGEST,
        _EVERYWHERE,
        "people to capture",
        minimum=1,
        maximum=12,
        choices=PEOPLE,
        argument=Argument(
            metavar="N|all|largest",
            help="people to capture: at most N, all, or largest, the most prominent person over "
            "the clip; candidates"
            " smaller than half the largest person are ignored",
            parse=_parse_people,
        ),
        blender=Property(
            choices=(*PEOPLE, _COUNT),
            value=lambda settings: (
                settings.people_count if settings.people == "COUNT" else settings.people.lower()
            ),
        ),
    )
    people_count: ClassVar[Option] = Option(
        "people_count",
        int,
        2,
        Place.PANEL,
        "maximum number of people",
        minimum=1,
        maximum=12,
        blender=Property(label="At Most"),
    )
    person: ClassVar[Option] = Option(
        "person",
        str,
        "",
        _EVERYWHERE,
        "capture this person first, or alone unless --people says how many: who is at x, y, in "
        "pixels, at a time",
        argument=Argument(
            metavar="X,Y[@TIME]",
            default_text="the most prominent",
        ),
        blender=Property(
            description="Who is at this place of the footage, in pixels, at a time in seconds, "
            "such as 640,360@2.5, is captured alone, or first of several. Empty: the most "
            "prominent person",
        ),
    )
    start: ClassVar[Option] = Option(
        "start",
        str,
        None,
        _EVERYWHERE,
        "start of the captured part, in seconds",
        argument=Argument(
            metavar="TIME", help="start time: seconds, MM:SS, HH:MM:SS.mmm or HH:MM:SS:FF"
        ),
        blender=Property(
            "range_start",
            "From",
            unit="s",
            default=0.0,
            minimum=0.0,
            value=lambda settings: _range_limit(settings, "range_start"),
            keywords=_TIME,
        ),
    )
    end: ClassVar[Option] = Option(
        "end",
        str,
        None,
        _EVERYWHERE,
        "end of the captured part, in seconds",
        argument=Argument(metavar="TIME", help="end time, inclusive"),
        blender=Property(
            "range_end",
            "To",
            unit="s",
            default=10.0,
            minimum=0.0,
            value=lambda settings: _range_limit(settings, "range_end"),
            keywords=_TIME,
        ),
    )
    use_range: ClassVar[Option] = Option(
        "use_range",
        bool,
        False,
        Place.PANEL,
        "capture only a part of the video",
        blender=Property(label="Part of the Video"),
    )
    rotate: ClassVar[Option] = Option(
        "rotate",
        str,
        "0",
        _EVERYWHERE,
        "turn the footage clockwise before the capture, for clips filmed sideways whose file does "
        "not say so",
        choices=ROTATIONS,
        argument=Argument(metavar="DEGREES"),
        blender=Property(label="Turn", section=Section.FOOTAGE, keywords=_TURNS_PICTURE),
    )
    mirror: ClassVar[Option] = Option(
        "mirror",
        bool,
        False,
        _EVERYWHERE,
        "exchange left and right in the footage, after turning it, as for a mirrored selfie video",
        blender=Property(section=Section.FOOTAGE, keywords=_TURNS_PICTURE),
    )
    crop: ClassVar[Option] = Option(
        "crop",
        str,
        "",
        _EVERYWHERE,
        "look for people only in this part of the turned picture: x, y, width and height in "
        "pixels, from its top left corner",
        argument=Argument(metavar="X,Y,WIDTH,HEIGHT", default_text="all of it"),
        blender=Property(label="Only in Part", section=Section.FOOTAGE),
    )
    fps: ClassVar[Option] = Option(
        "fps",
        str,
        None,
        _CAPTURE,
        "frame rate of the capture, such as 12 or 29.97",
        argument=Argument(metavar="N", default_text="the footage's"),
    )
    speed: float | None = declared(
        None,
        _EVERYWHERE,
        "how many times as fast as the footage plays everything happened: 8 for slow motion of 240 "
        "frames per second that plays at 30",
        minimum=0.05,
        maximum=100.0,
        argument=Argument(metavar="FACTOR", default_text="as the file says, or 1"),
        blender=Property(
            label="Slow Motion",
            description="How many times as fast as the footage plays everything happened: 8 for "
            "240 frames per second that play at 30. 0: as the file says",
            default=0.0,
            minimum=0.0,
            value=lambda settings: settings.speed or None,
            section=Section.FOOTAGE,
        ),
    )
    body: ClassVar[Option] = Option(
        "body",
        str,
        "scope",
        _EVERYWHERE | Place.IMPORT | _LIVE,
        "the body that is fitted to the person",
        argument=Argument(
            help="body model: scope, scope_h, scope_child, scope_child_h, or your "
            "own .npz or .pkl file"
        ),
        blender=Property(choices=BODIES),
    )
    body_file: ClassVar[Option] = Option(
        "body_file",
        Path,
        None,
        Place.PANEL,
        "SMPL, SMPL+H, SMPL-X or STAR model (.npz or .pkl); if empty, the one in the preferences",
    )
    hands: str = declared(
        OFF,
        _EVERYWHERE,
        "capture the fingers as well, on the body with hands; takes longer",
        choices=HANDS,
        argument=Argument(
            metavar=f"{OFF}|{AUTO}|{ON}",
            help="capture the fingers as well, on scope_h (or scope_child_h) unless --body names "
            "another body; auto:"
            " only of hands that are large enough in the image; --hands alone means on",
            bare=ON,
        ),
        blender=Property(section=Section.PERSON),
    )
    face: bool = declared(
        False,
        _EVERYWHERE,
        "capture the expressions of the face and the gaze as well; takes longer",
        blender=Property(section=Section.PERSON),
    )
    heights_m: Sequence[float] = declared(
        (),
        _EVERYWHERE | _LIVE,
        "heights of the people, most prominent first; sets the scale of the scene",
        unit="m",
        minimum=0.5,
        maximum=2.6,
        argument=Argument("--height", "CM[,CM...]", parse=_parse_heights, default_text="estimated"),
        # Not Blender's unit LENGTH, which would display the value in the scene's units.
        blender=Property(
            "height_cm",
            "Height (cm)",
            "Height of the most prominent person in centimetres; sets the scale of the scene. 0: "
            "estimated from the footage, for adults usually within 10 %; enter that of a child",
            unit="cm",
            default=0.0,
            minimum=0.0,
            maximum=260.0,
            value=lambda settings: (settings.height_cm / 100,) if settings.height_cm else (),
            keywords={"step": 100, "precision": 0},
        ),
    )
    lens: ClassVar[Option] = Option(
        "lens",
        str,
        "auto",
        Place.PANEL,
        "where the camera's focal length comes from",
        choices=LENSES,
    )
    focal_mm: float | None = declared(
        None,
        _EVERYWHERE | _LIVE,
        "35 mm equivalent focal length of the camera",
        unit="mm",
        minimum=1.0,
        maximum=2000.0,
        argument=Argument(metavar="MM"),
        blender=Property(
            label="Focal Length",
            description="35 mm equivalent focal length in millimetres; a phone's main camera has "
            "about 26",
            default=26.0,
            minimum=4.0,
            value=lambda settings: settings.focal_mm if settings.lens == "FOCAL" else None,
            keywords={"soft_max": 200.0},
        ),
    )
    fov_deg: float | None = declared(
        None,
        _EVERYWHERE | _LIVE,
        "field of view along the longer side of the image",
        unit="degrees",
        minimum=1.0,
        maximum=175.0,
        argument=Argument("--fov", "DEGREES"),
        blender=Property(
            "fov",
            "Field of View",
            unit="radians",
            default=math.radians(65.0),
            minimum=math.radians(2.0),
            maximum=math.radians(170.0),
            value=lambda settings: math.degrees(settings.fov) if settings.lens == "FOV" else None,
            keywords={"subtype": "ANGLE"},
        ),
    )
    calibration: Path | None = declared(
        None,
        _EVERYWHERE | _LIVE,
        "JSON file with OpenCV intrinsics (3x3), optionally dist (five values) and size (width, "
        "height)",
        argument=Argument(
            metavar="FILE",
            help="JSON file with intrinsics, dist and size, or a file of Pose2Sim, Caliscope, "
            "FreeMoCap, EasyMocap or OpenCap; one of several cameras is FILE.toml#CAMERA",
        ),
        blender=Property(
            "calibration_file",
            "Calibration",
            value=lambda settings: settings.calibration_file if settings.lens == "FILE" else None,
        ),
    )
    offset: ClassVar[Option] = Option(
        "offset",
        str,
        "",
        _CAPTURE,
        "of several cameras, the time in each further video less that in the first one, of the "
        "same moment, in seconds, or auto",
        argument=Argument(metavar="S[,S...]", default_text="found from the people"),
    )
    camera_path: Path | None = declared(
        None,
        _CAPTURE,
        "JSON file with the lens and the poses of a camera that another program has solved",
        argument=Argument(metavar="FILE"),
    )
    smoothing: bool = declared(
        True,
        _EVERYWHERE,
        "remove jitter and lock feet in contact with the floor; off keeps the per-frame solution",
        argument=Argument(help="keep the per-frame solution: no smoothing, no foot locking"),
        blender=Property(label="Smooth", section=Section.MOTION),
    )
    uneven_ground: bool = declared(
        False,
        _EVERYWHERE,
        "people walk on stairs, steps or slopes: feet rest at any height instead of on one "
        "horizontal floor",
        argument=Argument(help="feet rest at any height, as on stairs or slopes, not on one floor"),
        blender=Property(section=Section.MOTION),
    )
    treadmill: bool = declared(
        False,
        _EVERYWHERE,
        "people walk or run on a treadmill or on the spot: they stay there, and no foot is held in "
        "place",
        blender=Property(section=Section.MOTION),
    )
    belt_speed_m_s: float = declared(
        0.0,
        _EVERYWHERE,
        "speed of the treadmill's belt, with which people then walk over the floor; 0: they stay",
        unit="m/s",
        minimum=0.0,
        maximum=15.0,
        argument=Argument("--belt-speed", "M/S", default_text="0, people stay"),
        blender=Property(
            "belt_speed",
            "Belt Speed (m/s)",
            value=lambda settings: settings.belt_speed if settings.treadmill else 0.0,
            section=Section.MOTION,
        ),
    )


CAPTURE_OPTIONS = options_of(CaptureDeclaration)


_NETWORKS = _CAPTURE | Place.PREFERENCES

PROVIDERS = (
    Choice("auto", "Automatic", "A supported GPU if there is one, otherwise the CPU", 0),
    Choice("cpu", "CPU", "The processor", 1),
    Choice("cuda", "CUDA", "An NVIDIA GPU", 2),
    Choice(
        "tensorrt",
        "TensorRT",
        "An NVIDIA GPU with TensorRT, which takes minutes to compile each network on first use",
        3,
    ),
    Choice("directml", "DirectML", "Any GPU on Windows", 4),
    Choice("coreml", "Core ML", "Apple silicon", 5),
)


@dataclass(frozen=True)
class NetworkDeclaration:
    """What the networks are, and where they run."""

    detector: Path | None = declared(
        None,
        _NETWORKS,
        "custom person detector, an .onnx file",
        argument=Argument(metavar="FILE"),
        blender=Property(
            "detector_file",
            "Person Detector",
            "Custom detector (.onnx): YOLOX, YOLOv4, YOLOv8 and similar; built-in if empty",
        ),
    )
    keypoints: Path | None = declared(
        None,
        _NETWORKS,
        "custom keypoint network, an .onnx file",
        argument=Argument(metavar="FILE"),
        blender=Property(
            "keypoints_file",
            "Keypoint Network",
            "Custom keypoint network (.onnx): RTMPose, HRNet, ViTPose and similar; built-in if "
            "empty",
        ),
    )
    provider: str = declared(
        "auto",
        _NETWORKS | _LIVE,
        "execution provider for the networks",
        choices=PROVIDERS,
        argument=Argument(default_text="auto, the fastest available"),
        blender=Property(
            label="Execution Provider",
            description="Execution provider for the networks; if unavailable, the CPU is used and "
            "the result shows a"
            " warning",
        ),
    )
    threads: int = declared(
        0,
        _NETWORKS | _LIVE,
        "CPU threads for the networks; 0: all cores",
        minimum=0,
        decides_result=False,
        argument=Argument(
            metavar="N", help="CPU threads for the networks", default_text="all cores"
        ),
        blender=Property(maximum=256),
    )


NETWORK_OPTIONS = options_of(NetworkDeclaration)
