# SPDX-License-Identifier: GPL-3.0-or-later
"""The machine-readable report of a capture, and its warnings to the user, such as of feet that are
not on the floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ...solver.body import Body
from ...solver.names import BODY_JOINTS
from ..arrays import BoolArray, Float64Array
from ..capture_report import Report
from ..kinematics.foot_skin import UNDER_FLOOR_M, foot_heights, lower_floors, steps, upper_floors
from ..kinematics.sequences import runs
from ..motion import Motion
from ..notices import Notice, Value, notice
from ..options import option
from ..options.capture import ON
from ..review_spans import has_bent_knees, implausible
from .camera.corner_tracks import STEP_S
from .media.video import Video
from .media.video_range import VideoRange
from .observe import Footage
from .options import CaptureOptions
from .solve import Solved
from .tracking.expression_motion import CLOSED
from .world.travel_scale import FEET, NOTHING
from .world.world_frame import GIVEN, LINES, UP_DEVIATIONS_DEG

GIVEN_FLOOR_M = 0.03  # of the floor above or below z = 0 in the world of a given path
# With this relative deviation of the focal length or more, as of an estimate from few edges of the
# background or none, the path of a travelling camera is unsure, and so is how far one turns.
UNSURE_LENS = 0.15
UNSURE_TURN_DEG = 20.0  # from which on that is seen
# Frames that repeat the one before change by less than this share of the largest changes that are
# so near before and after them. Of 32 clips without such frames, at most 4 % of the frames do; of
# five that were converted from lower rates, 18 % and more.
REPEATED_CHANGE = 0.2
REPEATED_WITHIN_S = 0.15
REPEATED_SHARE = 0.1  # of the frames in which something moves
# Of 255. While a person stands still, the changes that compression makes are mostly smaller.
MOVING_CHANGE = 15.0
FEWEST_STEPS = 20
# A picture is frozen that stays the same for this long or longer, amid motion. In 27 clips without
# frozen pictures, the changes before and after so long a standstill are at most 9.
FROZEN_S = 0.2
SLOWEST_STEP_S = 0.05  # between frames; with longer ones, people can stop from one to the next
REPEATS_OFF = 0.15  # error of the mean number of frames that show one moment
MIN_LEG_CONFIDENCE = 0.05  # of the shanks; below it, legs count as not seen


def make_report(
    video: Video,
    body: Body,
    options: CaptureOptions,
    footage: Footage,
    solved: Solved,
    rates: dict[str, float],
) -> Report:
    """Assemble the report.

    :param rates: frames per second by stage.
    """
    motions = solved.motions
    name = Path(video.path).name
    camera = footage.camera
    motion = footage.camera_motion
    is_still = len(footage.timestamps) == 1
    rate = Fraction(motions[0].mocap_framerate).limit_denominator(1_000_000)
    return Report(
        source=str(video.path),
        frames=len(footage.timestamps),
        people=len(motions),
        valid_frames=int(motions[0].valid.sum()),
        per_person=[_about_person(body, motion) for motion in motions],
        quality=options.quality,
        detector=str(options.detector or "built-in"),
        keypoints=str(options.keypoints or "built-in"),
        execution=footage.execution,
        body=body.name,
        camera=camera.source,
        camera_turns_deg=0.0 if motion.is_static else round(motion.largest_turn_deg, 2),
        camera_travels_m=round(
            float(np.linalg.norm(np.diff(solved.path.center, axis=0), axis=1).sum()), 2
        ),
        up=solved.up_source,
        up_deviation_deg=UP_DEVIATIONS_DEG[solved.up_source][is_still],
        focal_px=float(camera.intrinsics[0, 0]),
        focal_deviation=round(camera.focal_deviation, 3),
        frame_rate=list(rate.as_integer_ratio()),
        fps=rates,
        reprojection_px=motions[0].mean_residual_px,
        iterations=solved.iterations,
        cuts_s=[round(t, 3) for t in footage.cuts_s],
        warnings=footage.warnings
        + standstill_warnings(name, float(video.fps), footage)
        + unused_option_warnings(video, options)
        + speed_warnings(video, options)
        + up_warnings(name, solved.up_source, is_still)
        + capture_warnings(name, body, options, footage, motions)
        + camera_warnings(name, footage, solved)
        + floor_warnings(name, body, motions, footage.timestamps, len(options.heights_m)),
    )


def capture_warnings(
    name: str,
    body: Body,
    options: CaptureOptions,
    footage: Footage,
    motions: list[Motion],
) -> list[Notice]:
    """List what a user should know about the result; ``name`` is the footage's."""
    warnings = []
    if footage.cuts_s:
        warnings.append(notice("cuts", footage=name, times=footage.cuts_s))
    heights = len(options.heights_m)
    people = len(motions)
    if heights > people == 1:
        warnings.append(notice("heights_for_one", footage=name, heights=heights))
    elif heights > people:
        warnings.append(notice("heights_for_several", footage=name, heights=heights, people=people))
    for person, motion in numbered(motions):
        unseen = int((~motion.valid).sum())
        if unseen:
            warnings.append(
                notice(
                    "unseen_frames", footage=name, person=person, unseen=unseen, total=len(motion)
                )
            )
        if _legs_confidence(motion) < MIN_LEG_CONFIDENCE:
            warnings.append(notice("unseen_legs", footage=name, person=person))
        warnings += _plausibility_warnings(name, person, motion, footage.timestamps)
        if options.hands == ON and not any(hand_frames(body, motion).values()):
            warnings.append(notice("no_hands", footage=name, person=person))
        if options.face and not face_frames(motion).get("face_frames"):
            warnings.append(notice("no_face", footage=name, person=person))
    return warnings


def _plausibility_warnings(
    name: str, person: int, motion: Motion, times_s: Float64Array
) -> list[Notice]:
    """List when a person does what nobody can do; see `review_spans`.

    :param times_s: see `floor_warnings`.
    """
    warnings = []
    for reason, frames in implausible(motion).items():
        begins = [first for first, _ in runs(frames)]
        if begins:
            times = times_s[begins].tolist()
            warnings.append(
                notice("implausible", footage=name, person=person, reason=reason, times=times)
            )
    if has_bent_knees(motion):
        warnings.append(notice("bent_knees", footage=name, person=person))
    return warnings


def camera_warnings(name: str, footage: Footage, solved: Solved) -> list[Notice]:
    """Say where the camera's zoom or travel is not known, where strides contradict it, and where
    the floor is in the world of a given path.
    """
    times = footage.timestamps
    warnings = []
    if footage.zoom is not None and not footage.zoom.is_certain:
        warnings.append(notice("zoom", footage=name))
    if solved.travel_source == NOTHING:
        warnings.append(notice("unknown_travel", footage=name))
    elif solved.travel_source == FEET:
        warnings.append(notice("travel_by_feet", footage=name))
    elif solved.travel_source is not None and footage.camera.focal_deviation >= UNSURE_LENS:
        percent = 100.0 * footage.camera.focal_deviation
        warnings.append(notice("travel_by_lens", footage=name, percent=percent))
    elif solved.travel_source is None:
        warnings += turn_warnings(name, footage)
    if footage.world_from_camera is not None:
        lowered_m = (
            footage.world_from_camera[0, 2, 3] - solved.motions[0].world_from_camera[0, 2, 3]
        )
        if abs(lowered_m) > GIVEN_FLOOR_M:
            warnings.append(notice("given_floor", footage=name, height_m=float(lowered_m)))
    people = numbered(solved.motions)
    for (person, _), contradicts in zip(people, solved.contradictions, strict=True):
        if contradicts is not None:
            starts = [float(times[first]) for first, _ in runs(contradicts)]
            warnings.append(notice("strides", footage=name, person=person, times=starts))
    return warnings


def turn_warnings(name: str, footage: Footage) -> list[Notice]:
    """Say where the rotation of a camera that turns and does not travel is not known."""
    motion = footage.camera_motion
    if motion.is_static or footage.world_from_camera is not None:
        return []
    warnings = []
    turn_deg = motion.largest_turn_deg
    if footage.camera.focal_deviation >= UNSURE_LENS and turn_deg >= UNSURE_TURN_DEG:
        warnings.append(notice("turn_by_lens", footage=name, degrees=turn_deg))
    begins = lost_turns_s(motion.known, footage.timestamps, footage.cuts_s)
    if begins:
        warnings.append(notice("lost_turn", footage=name, times=begins))
    return warnings


def lost_turns_s(known: BoolArray, times: Float64Array, cuts_s: Sequence[float]) -> list[float]:
    """Return the times (n,) of the last frames before the camera's rotation is lost: where it is
    still unknown when the next frame was followed.

    :param known: (T,) whether the rotation of a frame is known; that of many is not needed.
    :param times: (T,) seconds.
    """
    rows = np.flatnonzero(known)
    last = np.append(rows[1:], len(times)) - 1  # before the next known one, or of the clip
    cuts_until = np.searchsorted(cuts_s, times, "right")
    is_lost = (times[last] - times[rows] >= STEP_S) & (cuts_until[last] == cuts_until[rows])
    begins: list[float] = times[rows[is_lost]].tolist()
    return begins


def numbered(motions: list[Motion]) -> list[tuple[int, Motion]]:
    """Return the motions with the people's numbers in notices: 0 is the only person."""
    return [(0, motions[0])] if len(motions) == 1 else list(enumerate(motions, 1))


def up_warnings(name: str, up_source: str, is_still: bool) -> list[Notice]:
    """Say where the up direction is a guess: in a still image without edges of walls, doors or
    floors.
    """
    if up_source in (LINES, GIVEN) or not is_still:
        return []
    return [notice("guessed_up", footage=name, degrees=UP_DEVIATIONS_DEG[up_source][is_still])]


def standstill_warnings(name: str, fps: float, footage: Footage) -> list[Notice]:
    """Say where the picture stands still though what it shows does not."""
    changes = footage.picture_changes
    return repetition_warnings(name, fps, changes) or freeze_warnings(
        name, changes, footage.timestamps, footage.cuts_s
    )


def repetition_warnings(name: str, fps: float, changes: Float64Array) -> list[Notice]:
    """Say that frames repeat the one before, as after a conversion to a higher frame rate: the
    picture stands still in these, apart from what compression changes, and leaps in the others.

    :param fps: of the captured frames.
    :param changes: (T,) of the picture from the frame before, see `SceneCuts`.
    """
    changes = changes[1:]
    count = len(changes)
    reach = max(2, round(REPEATED_WITHIN_S * fps))
    largest = sliding_window_view(np.pad(changes, reach), reach).max(axis=1)
    around = np.minimum(largest[:count], largest[reach + 1 :])
    # Where nothing moves, a repeated frame looks like any other.
    repeats = (changes < REPEATED_CHANGE * around) & (around > MOVING_CHANGE)
    for first, end in runs(repeats):  # What slows down and speeds up again repeats nothing.
        beside = min(changes[first - 1], changes[end])
        repeats[first:end] = changes[first:end].max() < REPEATED_CHANGE * beside
    if not repeats.any():
        return []
    least = max(MOVING_CHANGE, np.median(changes[repeats]) / REPEATED_CHANGE)
    moves = np.maximum(around, changes) > least
    share = (repeats & moves).sum() / moves.sum()
    if moves.sum() < FEWEST_STEPS or share < REPEATED_SHARE:
        return []
    # Every k-th frame shows another moment than the one before; a rate between would repeat some.
    every = max(2, int(np.ceil(1.0 / (1.0 - share) - REPEATS_OFF)))
    return [notice("repeated_frames", footage=name, percent=100.0 * share, rate=fps / every)]


def freeze_warnings(
    name: str, changes: Float64Array, times_s: Float64Array, cuts_s: Sequence[float]
) -> list[Notice]:
    """Say where the picture stops at once and goes on at once, as where a recording stalls. What
    moves by itself slows down first.

    :param changes: (T,) of the picture from the frame before, see `SceneCuts`.
    :param times_s: (T,) of the frames.
    :param cuts_s: when scenes begin, such as a title or a photograph, which may stand still.
    """
    is_still = changes < REPEATED_CHANGE * MOVING_CHANGE
    is_still[:1] = False  # has no frame before
    begins_s = []
    longest_s = 0.0
    for first, end in runs(is_still):
        if end == len(changes) or min(changes[first - 1], changes[end]) <= MOVING_CHANGE:
            continue
        begin_s = float(times_s[first - 1])
        length_s = float(times_s[end - 1]) - begin_s
        if length_s >= FROZEN_S and begin_s not in cuts_s:
            begins_s.append(begin_s)
            longest_s = max(longest_s, length_s)
    if not begins_s or np.median(np.diff(times_s)) > SLOWEST_STEP_S:
        return []
    return [notice("frozen_frames", footage=name, times=begins_s, longest_s=longest_s)]


def unused_option_warnings(video: Video, options: CaptureOptions) -> list[Notice]:
    """Say which options were given that have no effect on this footage or with these networks.

    They are no errors: a batch has pictures among its videos, and a user's network is set for all
    captures.
    """
    warnings = []
    whole = VideoRange(view=options.wanted.view)
    asks_for_time = options.wanted != whole or options.speed is not None or options.treadmill
    if video.is_still and asks_for_time:
        warnings.append(notice("range_of_image", footage=Path(video.path).name))
    preset = option("quality").default
    if options.keypoints is not None and options.quality != preset:
        warnings.append(notice("preset_of_own_network", network=options.keypoints.name))
    return warnings


def speed_warnings(video: Video, options: CaptureOptions) -> list[Notice]:
    """Say that the file, not the user, says that the footage is slow motion."""
    if options.speed is not None or video.recorded_speed == 1.0:
        return []
    name = Path(video.path).name
    return [notice("slow_motion", footage=name, speed=video.recorded_speed)]


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
        before_s = motion.timestamps[:1] - 1.0 / motion.mocap_framerate
        steps_s = np.diff(motion.timestamps, prepend=before_s)
        minutes = float(steps_s[seen].sum()) / 60.0
        counts["blinks_per_minute"] = round(blinks / minutes, 1)
        counts["jaw_open"] = round(
            float(np.percentile(expressions[seen, names.index("jawOpen")], 95)), 2
        )
    return counts


def hand_frames(body: Body, motion: Motion) -> dict[str, int]:
    """Count the frames in which each hand was seen, by another camera too; empty where hands were
    not looked for.
    """
    names = motion.keypoints2d_names.tolist()
    counts = {}
    for side in ("left", "right"):
        if f"hand/{side}_wrist" not in names:
            continue
        seen = motion.keypoints2d[:, names.index(f"hand/{side}_wrist"), 2] > 0
        finger = body.joint_names.index(f"{side}_index1")
        seen = seen | (motion.joint_confidence[:, finger] > 0)
        counts[f"{side}_hand_frames"] = int(seen.sum())
    return counts


def _about_person(body: Body, motion: Motion) -> dict[str, Any]:
    seen = motion.frames[motion.valid]
    return (
        hand_frames(body, motion)
        | face_frames(motion)
        | {
            "valid_frames": len(seen),
            "first_frame": int(seen[0]),
            "last_frame": int(seen[-1]),
            "reprojection_px": motion.mean_residual_px,
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
    name: str,
    body: Body,
    motions: list[Motion],
    times_s: Float64Array,
    heights_given: int = 0,
) -> list[Notice]:
    """List where people stand on other floors or on steps, and where feet are under the floor.

    There are none on uneven ground, which has no floor.

    :param times_s: (T,) of the frames in the footage; the motions' own are when it was filmed.
    :param heights_given: of how many people the height was known.
    """
    warnings = []
    for person, motion in numbered(motions):
        if motion.uneven_ground:
            continue
        heights = foot_heights(motion, body)
        wrong_scale = ""
        if len(motions) > 1:
            all_given = heights_given >= len(motions)
            wrong_scale = "given_heights" if all_given else "estimated_heights"
        of_person: dict[str, Value] = {"footage": name, "person": person}
        warnings += [
            *_other_floors(of_person, heights, motion, times_s, wrong_scale),
            *_steps(of_person, body, motion, times_s),
            *_under_floor(of_person, heights, motion),
        ]
    return warnings


def _other_floors(
    of_person: dict[str, Value],
    heights: Float64Array,
    motion: Motion,
    times_s: Float64Array,
    wrong_scale: str,
) -> list[Notice]:
    """List the other floors of a person.

    :param of_person: values of the notices: the footage, and who it is.
    :param wrong_scale: what else puts a person off the floor of another from the first frame on;
        empty for one person. With a size that is wrong by a quarter, a person is a quarter too near
        or too far, and so above or below the others.
    """
    warnings = []
    for side, find in (("below", lower_floors), ("above", upper_floors)):
        spans = find(heights, motion.foot_contact, motion.timestamps)
        if spans:
            height = max(float(np.abs(heights[slice(*span)].min(axis=1)).max()) for span in spans)
            from_the_start = spans[0][0] <= motion.valid.argmax()
            warnings.append(
                notice(
                    "other_floor",
                    **of_person,
                    height_m=height,
                    side=side,
                    times=[float(times_s[first]) for first, _ in spans],
                    cause=wrong_scale if wrong_scale and from_the_start else "several_floors",
                )
            )
    return warnings


def _steps(
    of_person: dict[str, Value], body: Body, motion: Motion, times_s: Float64Array
) -> list[Notice]:
    if np.array_equal(motion.poses, motion.poses_raw):
        return []
    rests = steps(foot_heights(motion, body, raw=True), motion.foot_contact, motion.timestamps)
    if not rests:
        return []
    first, height = max(rests, key=lambda rest: abs(rest[1]))
    return [
        notice(
            "step",
            **of_person,
            height_cm=100 * abs(float(height)),
            side="above" if height > 0 else "below",
            times=[float(times_s[first])],
        )
    ]


def _under_floor(
    of_person: dict[str, Value], heights: Float64Array, motion: Motion
) -> list[Notice]:
    lowest = heights.min(axis=1)
    for span in lower_floors(heights, motion.foot_contact, motion.timestamps):
        lowest[slice(*span)] = 0.0
    under = int((lowest < -UNDER_FLOOR_M).sum())
    if not under:
        return []
    depth_cm = -100 * float(lowest.min())
    return [notice("under_floor", **of_person, depth_cm=depth_cm, under=under, total=len(motion))]
