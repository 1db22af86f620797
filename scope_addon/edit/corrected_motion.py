# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion with corrections: which can be changed and removed again, and outlive another smoothing.

The motion keeps what was corrected, and of the frames that this changed how they were before.

What a fit could not meet is measured afterwards: how far pins and contacts put feet under the
floor, and how far from it parts stay that shall rest there. The fit keeps feet above it unless one
of these asks for more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...solver.body import Body
from ...solver.names import BODY_JOINTS
from ...solver.rotations import exp, log
from ..arrays import Float64Array, FloatArray
from ..errors import MotionFileError
from ..kinematics.axes import transform_points
from ..kinematics.foot_skin import UNDER_FLOOR_M, foot_heights
from ..kinematics.smoothing import smooth_rotations
from ..motion import Motion
from ..scene_gaps import SCENE_GAP_S
from ..untrusted.files import in_one_line
from .clip import Clip, clip_from_motion, differ
from .corrections import (
    Contact,
    Correction,
    DepthFlip,
    Exchange,
    Pin,
    from_arrays,
    to_arrays,
    world_of,
)
from .depth_flips import flipped
from .edits import edited, moved_clip, moved_motion
from .solve_pins import Shot, distance_to, lowest_skin, resolve, resting_joints
from .spans import joints_of_limbs, swap_sides

_KEPT = ("poses", "trans", "poses_raw", "trans_raw", "joints_cam")
# Smoothing has mixed left and right within this time of a span's end.
_MIXED_S = 0.12
_NOTICED_M = 0.002
_OTHER_FOOT = [2, 3, 0, 1]  # the columns of `Motion.foot_contact`, of the other foot


def corrections_of(motion: Motion) -> tuple[Correction, ...]:
    """Return what was corrected.

    :raises MotionFileError: the motion's arrays are damaged.
    """
    return from_arrays(motion.corrections)


def shot_of(motion: Motion, start: float = 0.0) -> Shot:
    """Return when and from where the motion's frames were taken.

    :param start: seconds of the clip's clock at the footage's time 0.
    """
    return Shot(
        motion.frames,
        motion.timestamps + start,
        motion.world_from_camera,
        motion.intrinsics_of_frames,
        motion.valid,
        motion.cuts_s + start,
    )


def distance_from_pin(motion: Motion, pin: Pin, place: Float64Array | None) -> float:
    """Return how far a joint is from its pin: pixels of a pin in the image, metres of one in space.

    :param place: (3,) metres, the joint in the world; if None, the motion's own.
    :return: the distance; 0 in frames that the motion does not have, and for fingers without
        ``place``, because they depend on the body.
    """
    rows = np.flatnonzero(motion.frames == pin.frame)
    if not len(rows) or (place is None and pin.joint not in BODY_JOINTS):
        return 0.0
    T = motion.world_from_camera[rows[0]]
    if place is None:
        joint = motion.joints_cam[rows[0], BODY_JOINTS.index(pin.joint)].astype(float)
        (place,) = transform_points(T, joint[None])
    camera = T, motion.intrinsics_of_frames[rows[0]]
    return distance_to(pin_in_world(motion, pin), place, camera)


def pin_in_world(motion: Motion, pin: Pin) -> Pin:
    """Return a pin in the world of the motion, which an upright line or a floor may have moved."""
    if pin.position is None:  # a pin in the image stays there
        return pin
    return _in_world(pin, world_of(corrections_of(motion)))


def uncorrected(motion: Motion) -> Motion:
    """Return the motion as it was before any correction.

    :raises MotionFileError: the motion's arrays are damaged.
    """
    if "uncorrected_rows" not in motion.corrections:
        return motion
    rows = motion.corrections["uncorrected_rows"]
    before: dict[str, Any] = {}
    try:
        for name in _KEPT:
            before[name] = getattr(motion, name).copy()
            before[name][rows] = motion.corrections[f"uncorrected_{name}"]
        if "uncorrected_world_from_camera" in motion.corrections:
            before["world_from_camera"] = motion.corrections["uncorrected_world_from_camera"]
        return replace(motion, **before, corrections={})
    except (LookupError, ValueError, TypeError, OverflowError, MotionFileError) as error:
        raise MotionFileError(
            f"the motion's corrections are damaged: {in_one_line(error)}; capture the footage again"
        ) from error


def with_corrections(motion: Motion, body: Body, corrections: tuple[Correction, ...]) -> Motion:
    """Return the motion with these corrections in place of those that it has.

    :raises MotionFileError: the motion's corrections are damaged.
    :raises UsageError: a pin names a joint that the body does not have.
    """
    base = uncorrected(motion)
    if not corrections:
        return base
    wanted = replace(base, corrections=to_arrays(corrections))
    captured = before_smoothing(wanted, body)
    values: dict[str, Any] = {}
    changed = np.zeros(len(base), bool)
    for raw in (False, True):
        before = clip_from_motion(body, base, raw)
        after = _pinned(clip_from_motion(body, captured, raw), wanted, body)
        new = differ(after, before)
        changed |= new
        poses, trans = ("poses_raw", "trans_raw") if raw else ("poses", "trans")
        values[poses] = _poses(after, getattr(base, poses))
        values[trans] = getattr(base, trans).copy()
        values[trans][new] = after.root[new] - body.rest_joints(base.betas)[0]
        if not raw:
            values["joints_cam"] = base.joints_cam.copy()
            T = base.world_from_camera[new]
            joints = after.rows(new).joints(body, base.betas)
            values["joints_cam"][new] = (joints - T[:, None, :3, 3]) @ T[:, :3, :3]
    out = replace(wanted, **values)
    transform = world_of(corrections)
    if transform is not None:
        out = moved_motion(out, body, transform)
        changed = np.ones(len(base), bool)
    rows = np.flatnonzero(changed)
    kept = {f"uncorrected_{name}": getattr(base, name)[rows] for name in _KEPT}
    if transform is not None:
        kept["uncorrected_world_from_camera"] = base.world_from_camera
    return replace(out, corrections={**wanted.corrections, "uncorrected_rows": rows, **kept})


def corrected(clip: Clip, motion: Motion, body: Body) -> Clip:
    """Apply the motion's flips in depth, edits, contacts, pins, upright line and floor to another
    smoothing of it.

    :param clip: the motion in the captured world, with its sides exchanged already.
    :raises MotionFileError: the motion's corrections are damaged.
    """
    clip = _pinned(clip, motion, body)
    transform = world_of(corrections_of(motion))
    return clip if transform is None else moved_clip(clip, transform)


def _pinned(clip: Clip, motion: Motion, body: Body) -> Clip:
    """Apply the flips in depth, the edits, then the contacts and pins, to a clip in the captured
    world. None of them reaches over a scene cut.
    """
    shot = shot_of(uncorrected(motion))
    changed = _changed(shot.apart(clip), motion, body, shot.with_gaps())
    return replace(changed, times=clip.times)


def _changed(clip: Clip, motion: Motion, body: Body, shot: Shot) -> Clip:
    """Apply to a clip in the captured world what `_pinned` does.

    :param shot: with the clip's times.
    """
    corrections = corrections_of(motion)
    world = world_of(corrections)
    flips = [c for c in corrections if isinstance(c, DepthFlip)]

    def mirror(clip: Clip, shot: Shot) -> Clip:
        return flipped(clip, body, motion.betas, flips, shot)

    # A body that is turned around stands upright, and the floor is level and at z = 0, only in the
    # world that the corrections have moved.
    clip = _changed_in_world(clip, shot, world, mirror) if flips else clip
    clip = edited(clip, body, motion.betas, corrections, shot)
    required = [c for c in corrections if isinstance(c, Pin | Contact)]
    if not required:
        return clip
    moved = [_in_world(c, world) if isinstance(c, Pin) else c for c in required]

    def solve(clip: Clip, shot: Shot) -> Clip:
        return resolve(clip, body, motion.betas, moved, shot, floor=floor_of(motion))

    return _changed_in_world(clip, shot, world, solve)


def _changed_in_world(
    clip: Clip,
    shot: Shot,
    world: Float64Array | None,
    change: Callable[[Clip, Shot], Clip],
) -> Clip:
    """Change a clip in a world that a transform (4, 4) has moved, and move what changes back; other
    keys stay the same to the bit.
    """
    if world is None:
        return change(clip, shot)
    before = moved_clip(clip, world)
    shot = replace(shot, world_from_camera=world @ shot.world_from_camera)
    after = change(before, shot)
    new = differ(after, before)
    back = moved_clip(after.rows(new), np.linalg.inv(world))
    out = clip.copy()
    out.rotations[new] = back.rotations
    out.root[new] = back.root
    return out


def _in_world(pin: Pin, transform: Float64Array | None) -> Pin:
    """Return a pin in a world that ``transform`` (4, 4) has moved; None: it was not moved."""
    if pin.position is None or transform is None:
        return pin
    ((x, y, z),) = transform_points(transform, np.array([pin.position]))
    return replace(pin, position=(float(x), float(y), float(z)))


def floor_of(motion: Motion) -> float:
    """Return the height z of the floor in the world that the motion's corrections have moved,
    metres; −∞ on uneven ground, which has no floor.
    """
    return -np.inf if motion.uneven_ground else 0.0


def before_smoothing(motion: Motion, body: Body) -> Motion:
    """Return the motion as it would have been captured with left and right as they are in the
    user's eyes.

    At the ends of an exchanged span, smoothing has mixed both sides: there, the raw motion is
    smoothed again.

    :raises MotionFileError: the motion's corrections are damaged.
    """
    base = uncorrected(motion)
    exchanges = [c for c in corrections_of(motion) if isinstance(c, Exchange)]
    if not exchanges:
        return base
    raw = clip_from_motion(body, base, raw=True)
    finished = clip_from_motion(body, base, raw=False)
    times = base.times_with_gaps
    mixed = np.zeros(finished.rotations.shape[:2], bool)
    contact = base.foot_contact.copy()
    for exchange in exchanges:
        span = np.flatnonzero((base.frames >= exchange.first) & (base.frames <= exchange.last))
        if len(span):
            first, last = base.timestamps[span[[0, -1]]]
            raw = swap_sides(raw, body, first, last, exchange.limbs)
            finished = swap_sides(finished, body, first, last, exchange.limbs)
            if exchange.limbs != "arms":
                contact[span] = contact[span][:, _OTHER_FOOT]
            joints = joints_of_limbs(body, exchange.limbs)
            for k, neighbour in ((span[0], span[0] - 1), (span[-1], span[-1] + 1)):
                if 0 <= neighbour < len(base) and abs(times[neighbour] - times[k]) < SCENE_GAP_S:
                    near = np.abs(times - times[k]) < _MIXED_S
                    mixed[np.ix_(near, joints)] = True
    smooth = smooth_rotations(raw.rotations, times)
    finished.rotations[mixed] = smooth[mixed]
    return replace(
        base,
        poses_raw=_poses(raw, base.poses_raw),
        poses=_poses(finished, base.poses),
        foot_contact=contact,
    )


def _poses(clip: Clip, before: FloatArray) -> FloatArray:
    """Return axis-angle vectors (T, 3(K+1)), unchanged in the frames that the clip has not
    changed.
    """
    rotations = exp(before.reshape(len(before), -1, 3).astype(float))
    new = (clip.rotations != rotations).any((1, 2, 3))
    poses = before.copy()
    poses[new] = log(clip.rotations[new]).reshape(poses[new].shape)
    return poses


class FeetUnderFloor(NamedTuple):
    """Feet that corrections have put under the floor.

    :param depth: of the lowest foot, metres.
    :param frames: number of frames with a foot under the floor.
    :param cause: the correction without which the lowest foot is higher; None if no single one is.
    """

    depth: float
    frames: int
    cause: Contact | Pin | None


def feet_under_floor(motion: Motion, body: Body) -> FeetUnderFloor | None:
    """Return which feet are under the floor because of what pins and contacts require.

    :param body: the motion's body.
    :return: feet that are more than `UNDER_FLOOR_M` under the floor and lower than without pins and
        contacts; None if there are none, and on uneven ground.
    :raises MotionFileError: the motion's corrections are damaged.
    """
    if motion.uneven_ground:
        return None
    corrections = corrections_of(motion)
    required = [c for c in corrections if isinstance(c, Contact | Pin)]
    lowest = foot_heights(motion, body).min(axis=1)
    free = _lowest_without(motion, body, required)
    under = (lowest < -UNDER_FLOOR_M) & (lowest < free - _NOTICED_M)
    if not under.any():
        return None
    deepest = int(np.where(under, lowest, np.inf).argmin())
    frame = int(motion.frames[deepest])

    def is_cause(correction: Contact | Pin) -> bool:
        height = _lowest_without(motion, body, [correction])[deepest]
        return bool(lowest[deepest] < height - _NOTICED_M)

    nearest_first = sorted(required, key=lambda each: _frames_between(each, frame))
    cause = next(filter(is_cause, nearest_first), None)
    return FeetUnderFloor(-float(lowest[deepest]), int(np.count_nonzero(under)), cause)


def _lowest_without(motion: Motion, body: Body, removed: Sequence[Correction]) -> Float64Array:
    """Return the height of the lower foot in each frame, (T,), without some of the corrections."""
    kept = tuple(c for c in corrections_of(motion) if c not in removed)
    reduced = with_corrections(motion, body, kept)
    return foot_heights(reduced, body).min(axis=1)


def _frames_between(correction: Contact | Pin, frame: int) -> int:
    """Return how many frames a correction is away from a frame; 0 within its span."""
    if isinstance(correction, Pin):
        return abs(correction.frame - frame)
    return max(correction.first - frame, frame - correction.last, 0)


def height_at_rest(motion: Motion, body: Body, contact: Contact) -> float:
    """Return where a part that rests on the floor is farthest from it, metres above it, negative
    below; 0 on uneven ground, whose height is unknown.

    :param body: the motion's body.
    :param contact: of a part other than a foot.
    """
    rows = np.flatnonzero((motion.frames >= contact.first) & (motion.frames <= contact.last))
    if motion.uneven_ground or not len(rows):
        return 0.0
    clip = clip_from_motion(body, motion, raw=False).rows(rows)
    heights = np.ravel(
        [lowest_skin(clip, body, motion.betas, joint) for joint in resting_joints(contact.part)]
    )
    return float(heights[np.abs(heights).argmax()])
