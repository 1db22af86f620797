# SPDX-License-Identifier: GPL-3.0-or-later
"""The machine-readable report of a capture, and its warnings to the user, such as of feet that are
not on the floor.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ....solver.names import BODY_JOINTS
from ...counts import counted
from ...kinematics.foot_skin import UNDER_FLOOR_M, foot_heights, lower_floors, steps, upper_floors
from ...motion import Motion
from ...options.capture import ON
from ..media.video import Video
from ..options import CaptureOptions
from ..world.world_frame import LINES, UP_DEVIATIONS_DEG
from .clock import at_times
from .footage import Footage
from .solve import Solved

CLOSED = 0.5  # weight of a blink above which an eye is closed
MIN_LEG_CONFIDENCE = 0.05  # of the shanks; below it, legs count as not seen
_ESTIMATED = "somebody is taller or smaller than estimated: give everybody's height"
_GIVEN = "the heights are given in another order than the people, the most prominent first"


def make_report(
    video: Video,
    body: Body,
    options: CaptureOptions,
    footage: Footage,
    solved: Solved,
    rates: dict[str, float],
) -> dict[str, Any]:
    """Assemble the report that ``--json`` prints.

    :param rates: frames per second by stage.
    """
    motions = solved.motions
    camera = footage.camera
    motion = footage.camera_motion
    is_still = len(footage.timestamps) == 1
    return {
        "source": str(video.path),
        "frames": len(footage.timestamps),
        "people": len(motions),
        "valid_frames": int(motions[0].valid.sum()),
        "per_person": [_about_person(body, motion) for motion in motions],
        "quality": options.quality,
        "detector": str(options.detector or "built-in"),
        "keypoints": str(options.keypoints or "built-in"),
        "execution": footage.execution,
        "body": body.name,
        "camera": camera.source,
        "camera_turns_deg": 0.0 if motion.is_static else round(motion.largest_turn_deg, 2),
        "camera_travels_m": round(
            float(np.linalg.norm(np.diff(solved.path.center, axis=0), axis=1).sum()), 2
        ),
        "up": solved.up_source,
        "up_deviation_deg": UP_DEVIATIONS_DEG[solved.up_source][is_still],
        "focal_px": float(camera.intrinsics[0, 0]),
        "focal_deviation": round(camera.focal_deviation, 3),
        "frame_rate": [video.fps.numerator, video.fps.denominator],
        "fps": rates,
        "reprojection_px": float(motions[0].residual_px[motions[0].valid].mean()),
        "iterations": solved.iterations,
        "cuts_s": [round(t, 3) for t in footage.cuts_s],
        "warnings": footage.warnings
        + up_warnings(Path(video.path).name, solved.up_source, is_still)
        + capture_warnings(Path(video.path).name, options, footage.cuts_s, motions)
        + floor_warnings(Path(video.path).name, body, motions, len(options.heights_m)),
    }


def capture_warnings(
    name: str, options: CaptureOptions, cuts_s: list[float], motions: list[Motion]
) -> list[str]:
    """List what a user should know about the result, in sentences; ``name`` is the footage's."""
    warnings = []
    if cuts_s:
        times = at_times(cuts_s)
        warnings.append(
            f"{name} cuts to another scene {times}: capture each scene separately, with a start "
            "and end time"
        )
    if len(options.heights_m) > len(motions):
        found = f"{len(motions)} people were found" if len(motions) > 1 else "one person was found"
        warnings.append(f"{name}: {len(options.heights_m)} heights were given, but {found}")
    for number, motion in enumerate(motions, 1):
        who = "the person" if len(motions) == 1 else f"person {number}"
        missing = int((~motion.valid).sum())
        if missing:
            frames = counted(len(motion), "frame")
            warnings.append(
                f"{name}: {who} was not seen in {missing} of {frames}; these are filled in"
            )
        if _legs_confidence(motion) < MIN_LEG_CONFIDENCE:
            warnings.append(f"{name}: the legs of {who} were not seen, so their motion is a guess")
        if options.hands == ON and not any(hand_frames(motion).values()):
            warnings.append(
                f"{name}: no hands of {who} were found; come closer, or show the palms to the "
                "camera more often"
            )
        if options.face and not face_frames(motion).get("face_frames"):
            warnings.append(
                f"{name}: the face of {who} was not found; come closer, and look towards the camera"
            )
    return warnings


def up_warnings(name: str, up_source: str, is_still: bool) -> list[str]:
    """Say where the up direction is a guess: in a still image without edges of walls, doors or
    floors.
    """
    if up_source == LINES or not is_still:
        return []
    deviation = UP_DEVIATIONS_DEG[up_source][is_still]
    return [
        f"{name}: no edges in this picture show which way is up, so it follows from the people's "
        "posture alone, and "
        f"the result may lean by {deviation:.0f} degrees or more: check it from the side, and "
        "rotate it if it does"
    ]


def face_frames(motion: Motion) -> dict[str, Any]:
    """Count the frames in which the face was seen, and its blinks, and say how wide the jaw opened
    in them.

    ``blinks_per_minute`` is over the time in which the face was seen; ``jaw_open`` is the 95th
    percentile of ``jawOpen``, 0..1. Both are left out if it was never seen, and all where it was
    not looked for.
    """
    if not motion.face:
        return {}
    names = motion.face["expression_names"].tolist()
    expressions = motion.face["expressions"]
    seen = motion.face["expression_confidence"] > 0
    closed = seen & (
        expressions[:, [names.index(f"eyeBlink{side}") for side in ("Left", "Right")]].min(1)
        > CLOSED
    )
    blinks = int((closed[1:] & ~closed[:-1]).sum() + closed[:1].sum())
    counts: dict[str, Any] = {"face_frames": int(seen.sum()), "blinks": blinks}
    if seen.any():
        minutes = float(seen.sum()) / motion.mocap_framerate / 60.0
        counts["blinks_per_minute"] = round(blinks / minutes, 1)
        counts["jaw_open"] = round(
            float(np.percentile(expressions[seen, names.index("jawOpen")], 95)), 2
        )
    return counts


def hand_frames(motion: Motion) -> dict[str, int]:
    """Count the frames in which each hand was seen; empty where hands were not looked for."""
    names = motion.keypoints2d_names.tolist()
    wrists = {f"{side}_hand_frames": f"hand/{side}_wrist" for side in ("left", "right")}
    confidence = {
        key: motion.keypoints2d[:, names.index(name), 2]
        for key, name in wrists.items()
        if name in names
    }
    return {key: int((values > 0).sum()) for key, values in confidence.items()}


def _about_person(body: Body, motion: Motion) -> dict[str, Any]:
    seen = motion.frames[motion.valid]
    return (
        hand_frames(motion)
        | face_frames(motion)
        | {
            "valid_frames": len(seen),
            "first_frame": int(seen[0]),
            "last_frame": int(seen[-1]),
            "reprojection_px": float(motion.residual_px[motion.valid].mean()),
            "height_m": round(body.stature(motion.betas), 3),
            "height_sigma_m": round(motion.height_sigma_m, 3)
            if np.isfinite(motion.height_sigma_m)
            else None,
        }
    )


def _legs_confidence(motion: Motion) -> float:
    """Return the mean confidence of the more visible leg over the frames in which the person was
    seen.
    """
    shanks = [BODY_JOINTS.index(f"{side}_knee") for side in ("left", "right")]
    return float(motion.joint_confidence[motion.valid][:, shanks].mean(axis=0).max())


def floor_warnings(
    name: str, body: Body, motions: list[Motion], heights_given: int = 0
) -> list[str]:
    """List in sentences where people stand on other floors or on steps, and where feet are under
    the floor.

    There are none on uneven ground, which has no floor.

    :param heights_given: of how many people the height was known.
    """
    warnings = []
    for number, motion in enumerate(motions, 1):
        if motion.uneven_ground:
            continue
        who = "the person" if len(motions) == 1 else f"person {number}"
        heights = foot_heights(motion, body)
        scale = "" if len(motions) == 1 else _GIVEN if heights_given >= len(motions) else _ESTIMATED
        about = [
            *_other_floors(who, heights, motion, scale),
            *_steps(who, body, motion),
            *_under_floor(who, heights, motion),
        ]
        warnings += [f"{name}: {text}" for text in about]
    return warnings


def _other_floors(who: str, heights: NDArray[np.float64], motion: Motion, scale: str) -> list[str]:
    """List the other floors of a person.

    :param scale: what else puts a person off the floor of another from the first frame on; empty
        for one person. With a size that is wrong by a quarter, a person is a quarter too near or
        too far, and so above or below the others.
    """
    texts = []
    for side, find in (("below", lower_floors), ("above", upper_floors)):
        spans = find(heights, motion.foot_contact, motion.timestamps)
        if spans:
            most = max(float(np.abs(heights[slice(*span)].min(axis=1)).max()) for span in spans)
            when = at_times([float(motion.timestamps[first]) for first, _ in spans])
            whole = (
                "capture the part that matters, with a start and end time, or with uneven ground"
            )
            if scale and spans[0][0] <= motion.valid.argmax():
                cause = f", so either {scale}; or the clip has more than one floor: {whole}"
            else:
                cause = f", so the clip has more than one floor: {whole}"
            texts.append(f"{who} stands up to {most:.1f} m {side} the floor {when}{cause}")
    return texts


def _steps(who: str, body: Body, motion: Motion) -> list[str]:
    if np.array_equal(motion.poses, motion.poses_raw):
        return []
    rests = steps(foot_heights(motion, body, raw=True), motion.foot_contact, motion.timestamps)
    if not rests:
        return []
    first, height = max(rests, key=lambda rest: abs(rest[1]))
    side = "above" if height > 0 else "below"
    when = at_times([float(motion.timestamps[first])])
    return [
        f"the feet of {who} rest {100 * abs(height):.0f} cm {side} the floor {when}, as on a step; "
        "they were put on "
        "it. For stairs and slopes, capture with uneven ground"
    ]


def _under_floor(who: str, heights: NDArray[np.float64], motion: Motion) -> list[str]:
    lowest = heights.min(axis=1)
    for span in lower_floors(heights, motion.foot_contact, motion.timestamps):
        lowest[slice(*span)] = 0.0
    count = int((lowest < -UNDER_FLOOR_M).sum())
    if not count:
        return []
    deepest = -100 * float(lowest.min())
    return [
        f"a foot of {who} is up to {deepest:.0f} cm under the floor in {count} of "
        f"{counted(len(motion), 'frame')}"
    ]
