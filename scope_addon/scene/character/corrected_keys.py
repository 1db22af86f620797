# SPDX-License-Identifier: GPL-3.0-or-later
"""Changing a captured armature's keys by what was corrected in its motion.

The keys may have been edited since: smoothed, put on the floor, their root motion moved to an
object. So it is the change of the motion that is applied to them, in each joint's own axes and the
pelvis's: Ω' = Ω (Ω_beforeᵀ Ω_after), t' = t + R_0 R_0,beforeᵀ (t_after − t_before). Keys that the
correction does not reach are not written.

Who interpolates frames or puts feet on the floor means what is displayed. With such an edit, which
the motion keeps, the keys are edited themselves, and so is the clip that they are compared with;
then the change of the motion, as by pins, is applied to them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from bpy.types import Object

from ....solver.body import Body
from ...arrays import BoolArray, Float64Array, FloatArray, IndexArray
from ...edit.clip import Clip, differ, relative_to_trajectory, sample, with_trajectory
from ...edit.corrected_motion import corrections_of, floor_of, pin_in_world, shot_of, uncorrected
from ...edit.corrections import (
    Correction,
    FeetOnFloor,
    Floor,
    Interpolation,
    Pin,
    feet_on_floor,
    world_of,
)
from ...edit.edits import edited, floor_above, foot_height, interpolated, moved_clip, refloor
from ...edit.smooth import smoothed
from ...edit.solve_pins import Shot, missed, resolve
from ...errors import UsageError
from ...kinematics.axes import UP, rotated, transform_points, transposed
from ...motion import Motion
from ...scene_gaps import usual_step_s
from ..actions import fcurves, read_keys
from ..stored_values import smoothing_of, start_frame
from ..timing import cycle_span
from ..visibility import world_matrix
from .keys import ROTATION, channel_curves, read_clip, write_keys
from .root_object import clip_with_root_motion, removed_root_motion, root_object
from .uncorrected_keys import UncorrectedKeys, changed_rows, keyed_values, restore

_SAME_FRAME = 2e-3
_WHOLE = 1e-3  # frames; timestamps are rounded
_WHOLE_SHARE = 0.9  # of its keys that a motion has at least where it was captured
_ROUNDED = 0.99  # frames by which keys on whole frames begin later than the motion, or end earlier
_ROUNDED_LOOP = 2.0  # the same for a loop, whose ends were rounded, perhaps for another rate
_SHIFTED_TOGETHER = 2.0  # frames by which shifts of both ends may differ, which are rounded
_ADDED_POSES = 2  # that may be keyed before and after any motion
_ADDED_SHARE = 0.1  # of all keys that may be
_SAME_S = 1e-4  # keys' frames are single precision
_MISSED_PX = 1.0
_MISSED_M = 0.005
_SAME_M = 0.0005


def rewrite_changed_keys(
    armature: Object,
    body: Body,
    rate: float,
    before: Motion,
    after: Motion,
    stored: object,
    added: Correction | None,
    rise: float,
) -> UncorrectedKeys:
    """Change the keys from one motion to another, which differs from it in its corrections.

    Rows of keys that corrections have changed before, and nothing else since, begin again with the
    keys from before.

    :param rate: scene frames per second.
    :param stored: bytes of the ``UncorrectedKeys`` of the last change.
    :param added: a new correction; a pin or an edit holds even if edited keys differ from the
        motion.
    :param rise: metres by which all keys are raised, until the floor is no longer corrected.
    :return: the keys that are now different from those without corrections.
    :raises UsageError: when a bone or its keys are missing.
    """
    check_times_of_keys(armature, before, rate)
    start = start_frame(armature)
    known = UncorrectedKeys.from_bytes(stored, len(channel_curves(armature, body)))
    restored = restore(armature, body, start, rate, known)
    clip, frames = read_clip(armature, body, rate)
    strength = smoothing_of(armature)
    free, old, new = (
        _at(smoothed(body, m, strength), clip.times, _start(armature, rate))
        for m in (uncorrected(before), before, after)
    )
    was, now = (world_of(corrections_of(m)) for m in (before, after))
    _check_root_motion(armature, was, now)
    old, new = (
        c if T is None else moved_clip(c, np.linalg.inv(T)) for c, T in ((old, was), (new, now))
    )
    again = np.zeros(len(frames), bool)  # rows that begin with the keys from before all corrections
    for row in restored:
        again |= np.abs(frames - (start + known.times[row] * rate)) < _SAME_FRAME
    exact = again if was is not None else again | ~differ(free, old)
    old.rotations[exact] = free.rotations[exact]
    old.root[exact] = free.root[exact]
    rows = frames.astype(np.float32)
    values = keyed_values(armature, body, rows)
    moves = _moves(again, was, now)
    is_floor_corrected = any(isinstance(c, Floor) for c in corrections_of(after))
    on_floor = feet_on_floor(corrections_of(after)) is not None  # would undo a rise before it
    kept_rise = known.rise if is_floor_corrected else 0.0
    if not on_floor:
        kept_rise = kept_rise + rise
        rises = np.where(again, kept_rise, kept_rise - known.rise)
        clip = _with_raised_keys(armature, body, clip, frames, rises[:, None] * moves[:, 2, :3])
    edits = KeyEdits(
        corrections_of(after), after.betas, shot_of(after, _start(armature, rate)), added, exact
    )
    if edits.any():
        begun, old = begin_with_edits(
            armature, body, (_moved_rows(clip, moves)[0], old), frames, edits
        )
        write_keys(armature, body, begun, frames, differ(begun, clip))
        clip = begun
        moves = np.tile(np.eye(4), (len(frames), 1, 1))
    _write_change(armature, body, clip, frames, (old, new), moves)
    if isinstance(added, Pin):
        _meet_pin(armature, body, rate, after, added)
    elif isinstance(added, FeetOnFloor) and not exact.all():
        meet_floor(armature, body, rate, after, edits)
    if on_floor:
        raised, _ = read_clip(armature, body, rate)
        _with_raised_keys(armature, body, raised, frames, np.tile(rise * UP, (len(frames), 1)))
    after_values = keyed_values(armature, body, rows)
    same = (values == after_values) | (np.isnan(values) & np.isnan(after_values))
    changed = differ(free, new) | ~same.all(axis=1) | (now is not None)
    found = changed_rows(rows, exact & changed, values, after_values, start, rate)
    return replace(found, rise=kept_rise)


def _with_raised_keys(
    armature: Object, body: Body, clip: Clip, frames: Float64Array, rises: Float64Array
) -> Clip:
    """Raise keys by vectors (T, 3), metres, and return their clip."""
    raised = Clip(clip.times, clip.rotations, clip.root + rises)
    write_keys(armature, body, raised, frames, rises.any(axis=1))
    return raised


def pinned_places(
    armature: Object, body: Body, rate: float, motion: Motion
) -> dict[Pin, Float64Array]:
    """Return where the keys have each pinned joint in its frame, (3,) metres in the world of the
    capture.

    :param rate: scene frames per second.
    """
    pins = [c for c in corrections_of(motion) if isinstance(c, Pin)]
    if not pins:
        return {}
    clip, frames = read_clip(armature, body, rate)
    shot = shot_of(motion, _start(armature, rate))
    at = sample(
        clip_with_root_motion(armature, clip, frames),
        np.array([shot.time(pin.frame) for pin in pins]),
    )
    joints = at.joints(body, motion.betas)
    return {pin: joints[k, body.joint_names.index(pin.joint)] for k, pin in enumerate(pins)}


def _meet_pin(armature: Object, body: Body, rate: float, motion: Motion, pin: Pin) -> None:
    """Correct the keys by one more pin, if edited keys do not meet it although the motion does.

    :param rate: scene frames per second.
    """
    pin = pin_in_world(motion, pin)
    clip, frames = read_clip(armature, body, rate)
    whole = clip_with_root_motion(armature, clip, frames)
    shot = shot_of(motion, _start(armature, rate))
    if missed(whole, body, motion.betas, pin, shot) > (
        _MISSED_M if pin.pixel is None else _MISSED_PX
    ):
        apart = shot.apart(whole), shot.with_gaps()
        met = resolve(
            apart[0], body, motion.betas, [pin], apart[1], slack=0.0, floor=floor_of(motion)
        )
        _write_change(armature, body, clip, frames, (whole, met))


def heights_of_foot(
    armature: Object, body: Body, rate: float, motion: Motion, frame: int, foot: str
) -> tuple[float, float]:
    """Return how high a foot is in a frame, metres: in the motion, as smooth as the keys are, and
    in the edited keys.

    :param rate: scene frames per second.
    :param frame: of the footage.
    :param foot: as in `foot_height`.
    """
    captured = smoothed(body, motion, smoothing_of(armature))
    clip, frames = read_clip(armature, body, rate)
    shown = clip_with_root_motion(armature, clip, frames), _start(armature, rate)
    return (
        foot_height(captured, body, motion.betas, shot_of(motion).time(frame), foot),
        foot_height(shown[0], body, motion.betas, shot_of(motion, shown[1]).time(frame), foot),
    )


def captured_points(armature: Object, frame: float, points_world: Float64Array) -> Float64Array:
    """Convert points of the scene (N, 3) at the current frame to the world of the capture, (N, 3)
    metres.
    """
    inverse = np.array(world_matrix(armature).inverted_safe())
    points = transform_points(inverse, points_world)
    n = len(points)
    still = Clip(np.zeros(n), np.tile(np.eye(3), (n, 1, 1, 1)), points)
    return clip_with_root_motion(armature, still, np.full(n, frame)).root


def source_frame(armature: Object, motion: Motion, frame: float, rate: float) -> int:
    """Return the footage's frame that is shown at a scene frame.

    :raises UsageError: the motion has none there, or its keys were moved.
    """
    check_times_of_keys(armature, motion, rate)
    first, last = whole_span(armature, motion, rate)
    if not first <= frame <= last:
        raise UsageError(
            f"frame {frame:g} is outside of the captured motion of '{armature.name}', which has "
            f"frames {first} to "
            f"{last}; go to one of these"
        )
    time = frame / rate - _start(armature, rate)
    row = int(_nearest_rows(motion, np.array([time]))[0])
    if abs(motion.timestamps[row] - time) > _longest_shown(motion, rate):
        raise UsageError(
            f"frame {frame:g} is in a gap of the captured motion of '{armature.name}', where the "
            "footage has no "
            "frames; go to a frame beside it"
        )
    return int(motion.frames[row])


def frames_that_show(armature: Object, motion: Motion, frame: int, rate: float) -> tuple[int, int]:
    """Return the first and the last whole scene frame at which a frame of the footage is shown; if
    there is none, twice the nearest one.

    More than one shows it where the scene has a higher rate, or the footage lacks a frame.

    :param rate: scene frames per second.
    """
    at = scene_frame(armature, motion, frame, rate)
    reach = math.ceil(_longest_shown(motion, rate) * rate)
    first, last = whole_span(armature, motion, rate)
    near = range(max(first, math.floor(at) - reach), min(last, math.ceil(at) + reach) + 1)
    times = np.array(near) / rate - _start(armature, rate)
    rows = _nearest_rows(motion, times)
    late = np.abs(motion.timestamps[rows] - times) > _longest_shown(motion, rate)
    shown = np.flatnonzero((motion.frames[rows] == frame) & ~late)
    if len(shown) == 0:
        return round(at), round(at)
    return near[shown[0]], near[shown[-1]]


def _nearest_rows(motion: Motion, times: Float64Array) -> IndexArray:
    """Return the row of a motion that is nearest to each of the times (N,); of two, the earlier
    one, in spite of rounding.
    """
    distance = np.abs(motion.timestamps[:, None] - times)
    return (distance <= distance.min(axis=0) + _SAME_S).argmax(axis=0)


def _longest_shown(motion: Motion, rate: float) -> float:
    """Return for how many seconds around its time a frame of the footage counts as shown."""
    return max(usual_step_s(motion.timestamps), 1.0 / rate)


def check_times_of_keys(armature: Object, motion: Motion, rate: float) -> None:
    """Check that the keys are at the times of the captured motion, or of the loop made from it.

    There may be fewer keys, if they were reduced, baked or deleted, and further ones may have been
    added before and after the motion.

    :param rate: scene frames per second.
    :raises UsageError: they were moved or stretched.
    """
    curves = [curve for curve in fcurves(armature) if curve.data_path.endswith(ROTATION)]
    if not curves:
        return
    frames = np.unique(np.concatenate([read_keys(curve)[:, 0] for curve in curves])).astype(float)
    captured = (motion.timestamps + _start(armature, rate)) * rate
    cycle = cycle_span(armature)
    if cycle is None:
        begins, ends = whole_span(armature, motion, rate)
        known = "motion was captured"
        is_moved = _are_moved(frames, captured, captured[0], captured[-1], _ROUNDED)
    else:
        begins, ends = cycle
        known = "loop was made"
        is_moved = _are_moved(frames, captured, begins, ends, _ROUNDED_LOOP)
    if is_moved:
        raise UsageError(
            f"the keys of '{armature.name}' are in frames {frames[0]:g} to {frames[-1]:g}, but its "
            f"{known} in frames {begins} to {ends}: put them back there in the Dope "
            "Sheet; after this change, they can be moved again"
        )


def _are_moved(
    frames: Float64Array, captured: Float64Array, first: float, last: float, rounded: float
) -> bool:
    """Return whether keys were moved or stretched in time.

    :param frames: (N,) scene frames of the keys, increasing.
    :param captured: (T,) scene frames of the captured poses.
    :param first: scene frame of the first key as it was written; ``last`` of the last.
    :param rounded: frames by which the first and the last key may be off these.
    """
    if _are_later(frames, first, last, rounded) or _are_later(
        -frames[::-1], -last, -first, rounded
    ):
        return True
    inside = (frames >= first - rounded) & (frames <= last + rounded)
    poses = ((captured >= first - rounded) & (captured <= last + rounded)).sum()
    if inside.sum() >= _WHOLE_SHARE * min(poses, last - first + 1):
        return False
    return bool((~inside).sum() > max(_ADDED_POSES, _ADDED_SHARE * len(frames)))


def _are_later(frames: Float64Array, first: float, last: float, rounded: float) -> bool:
    """Return whether all keys were shifted to later frames, whatever was added to them: there is
    none at the first frame, but there are some after the last.

    Keys that were deleted at the beginning are not there either; then, a pose that was added after
    the end is hardly as far from the end as the first key is from the beginning.

    :param frames: (N,) scene frames of the keys, increasing.
    """
    begun = frames[frames >= first - rounded]
    if not len(begun) or begun[0] <= first + rounded:
        return False
    after = frames[frames > last + rounded]
    shift = begun[0] - first
    is_shifted_end = np.abs(after - (last + shift)) <= _SHIFTED_TOGETHER
    return len(after) > _ADDED_POSES or bool(is_shifted_end.any())


def whole_span(armature: Object, motion: Motion, rate: float) -> tuple[int, int]:
    """Return the first and the last scene frame of a motion, rounded outwards to whole frames.

    :param rate: scene frames per second.
    """
    start = _start(armature, rate)
    first, last = ((motion.timestamps[row] + start) * rate for row in (0, -1))
    return math.floor(first + _WHOLE), math.ceil(last - _WHOLE)


def scene_frame(armature: Object, motion: Motion, frame: int, rate: float) -> float:
    """Return the scene frame at which a frame of the footage is shown."""
    return float(np.interp(frame, motion.frames, motion.timestamps) * rate + start_frame(armature))


def _start(armature: Object, rate: float) -> float:
    """Return the scene's time in seconds at the footage's time 0."""
    return start_frame(armature) / rate


def _at(clip: Clip, times: Float64Array, start: float) -> Clip:
    """Sample a captured clip at the keys' times; keys at its own frames must not mix in a little of
    the next frame.
    """
    own = clip.times + start
    nearest = own[np.clip(np.searchsorted(own, times - _SAME_S), 0, len(own) - 1)]
    return sample(
        Clip(own, clip.rotations, clip.root),
        np.where(np.abs(nearest - times) < _SAME_S, nearest, times),
    )


def _check_root_motion(
    armature: Object, was: Float64Array | None, now: Float64Array | None
) -> None:
    """Refuse to turn the world of keys whose root motion is on an object.

    :raises UsageError: it is, and the upright line changes.
    """
    same = was is now if was is None or now is None else np.array_equal(was, now)
    if not same and root_object(armature) is not None:
        raise UsageError(
            f"the root motion of '{armature.name}' is on an object; put it back with In Bones first"
        )


def _moves(again: BoolArray, was: Float64Array | None, now: Float64Array | None) -> Float64Array:
    """Return the transform (T, 4, 4) of each row for an upright line: rows with all corrections
    have the former one.

    :param again: (T,) rows that begin without corrections.
    """
    moves = np.tile(np.eye(4) if now is None else now, (len(again), 1, 1))
    if was is not None and now is not None and np.array_equal(was, now):
        moves[~again] = np.eye(4)
    elif was is not None:
        moves[~again] = moves[~again] @ np.linalg.inv(was)
    return moves


def _write_change(
    armature: Object,
    body: Body,
    clip: Clip,
    frames: Float64Array,
    change: tuple[Clip, Clip],
    moves: Float64Array | None = None,
) -> None:
    """Apply the change between two clips to the keys at which they differ, then move these in the
    world.

    :param moves: (T, 4, 4) rigid; rows that it moves are all written.
    """
    old, new = change
    which = differ(old, new)
    changed = clip.copy()
    inverse = transposed(old.rotations[which])
    shift = rotated(inverse[:, 0], (new.root - old.root)[which])
    changed.root[which] += rotated(clip.rotations[which, 0], shift)
    changed.rotations[which] = clip.rotations[which] @ inverse @ new.rotations[which]
    if moves is not None:
        changed, moved = _moved_rows(changed, moves)
        which = which | moved
    write_keys(armature, body, changed, frames, which)


def _moved_rows(clip: Clip, moves: Float64Array) -> tuple[Clip, BoolArray]:
    """Move each row in the world by its rigid transform (T, 4, 4); also return which rows (T,) that
    moves.
    """
    return moved_clip(clip, moves), (moves != np.eye(4)).any(axis=(1, 2))


@dataclass(frozen=True)
class KeyEdits:
    """The corrections of a motion, the last one among them, and the keys that are to be edited."""

    corrections: tuple[Correction, ...]
    betas: FloatArray  # (P,) shape coefficients
    shot: Shot  # on the clock of the keys
    new: Correction | None  # which is applied to all keys
    # (T,) keys that begin without corrections, to which all edits are applied
    rows: BoolArray

    def any(self) -> bool:
        """Return whether there is an edit among the corrections."""
        return any(isinstance(c, Interpolation | FeetOnFloor) for c in self.corrections)


def begin_with_edits(
    armature: Object, body: Body, clips: tuple[Clip, Clip], frames: Float64Array, edits: KeyEdits
) -> tuple[Clip, Clip]:
    """Edit keys, and the clip that they are compared with.

    :param clips: the keys, in the world that the corrections have moved; and the other one, in the
        captured world.
    :param frames: (T,) scene frames of the keys.
    :return: both, edited in the rows that an edit is applied to.
    :raises UsageError: a new interpolation has no keys, or none on one side.
    """
    keys, old = clips
    for each in (c for c in edits.corrections if isinstance(c, Interpolation)):
        new = each == edits.new
        rows = np.ones(len(frames), bool) if new else edits.rows
        keys = _replaced(keys, rows, interpolated(keys, [each], edits.shot, strict=new).rows(rows))
        old = _replaced(old, rows, interpolated(old, [each], edits.shot).rows(rows))
    feet = feet_on_floor(edits.corrections)
    # The floor of a few keys would not be that of all; others have the change of the motion.
    enough = (
        edits.rows.all()
        if isinstance(edits.new, FeetOnFloor)
        else 2 * edits.rows.sum() > len(frames)
    )
    if feet is None or not enough:
        return keys, old
    height = floor_above(edits.corrections, feet)
    rows = edits.rows
    placed = floored(
        armature, body, edits.betas, keys.rows(rows), frames[rows], feet, height, edits.shot
    )
    others = tuple(c for c in edits.corrections if not isinstance(c, Interpolation))
    compared = edited(old.rows(edits.rows), body, edits.betas, others, edits.shot)
    return _replaced(keys, edits.rows, placed), _replaced(old, edits.rows, compared)


def meet_floor(armature: Object, body: Body, rate: float, motion: Motion, edits: KeyEdits) -> None:
    """Put feet on the floor whose keys were edited, if they are not there although those of the
    motion are.

    :param rate: scene frames per second.
    """
    feet = feet_on_floor(corrections_of(motion))
    if feet is None:
        return
    clip, frames = read_clip(armature, body, rate)
    height = floor_above(edits.corrections, feet)
    placed = floored(armature, body, edits.betas, clip, frames, feet, height, edits.shot)
    if np.abs(placed.root - clip.root).max() > _SAME_M:
        write_keys(armature, body, placed, frames, np.ones(len(frames), bool))


def floored(
    armature: Object,
    body: Body,
    betas: FloatArray,
    clip: Clip,
    frames: Float64Array,
    feet: FeetOnFloor,
    height: float = 0.0,
    shot: Shot | None = None,
) -> Clip:
    """Put the feet of keys on the floor: those in contact are at rest only with their root motion.

    :param betas: (P,) shape coefficients.
    :param frames: (T,) scene frames of the keys.
    :param height: z of the floor, metres, in the armature's space.
    :param shot: on the clock of the keys; None: the motion is lost.
    """
    positions, angles = removed_root_motion(armature, frames)
    path = positions * [1.0, 1.0, 0.0], angles
    placed = refloor(with_trajectory(clip, *path), body, betas, feet, height, shot)
    return relative_to_trajectory(placed, *path)


def _replaced(clip: Clip, rows: BoolArray, part: Clip) -> Clip:
    """Return a clip with other values in some rows."""
    out = clip.copy()
    out.rotations[rows] = part.rotations
    out.root[rows] = part.root
    return out
