# SPDX-License-Identifier: GPL-3.0-or-later
"""Spans of frames that should be reviewed: filled in, far from the footage, unsure, not plausible,
or under the floor. Numpy only.

Not plausible is what a person cannot do, by the joints of a finished motion, of which the footage
itself says nothing:

- swing: a hand or foot moves far along the line of sight in no time, though it hardly moves in the
  image, as if it had been solved in front of the body and then behind it;
- lean: the weight is held beside the feet for seconds, where anybody would fall;
- floating: both feet are above the floor for longer than a jump takes;
- leap: the body is elsewhere within a few frames, or in another pose from one frame to the next,
  and slow before and after that, as where footage leaves out what happened, or somebody else is
  followed;
- spin: the pelvis turns in the same way, as where a body is fitted the wrong way round for a while;
- snap: a hand or foot is elsewhere within a few frames, relative to shoulder or hip, as where a
  leg's keypoints were on the other leg;
- far: the body misses the footage by far for longer than a moment, for its size;
- bent knees: a person who stands or walks never straightens a knee in the whole clip.

It may be true: of a punch, of somebody who is held or hangs, of a crouch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..solver.names import BODY_JOINTS
from .arrays import BoolArray, Float32Array, Float64Array
from .motion import Motion
from .scene_gaps import usual_step_s

# reprojection error above which a frame should be reviewed, as a share of the image's longer side
FAR_SHARE = 0.03
# The same at the distance of the person, and how long it lasts then. In 60 captures of ordinary
# footage, the error is at most 0.046 m for so long.
FAR_M = 0.055
FAR_S = 0.2
LOW_CONFIDENCE = 0.35  # mean over the joints that keypoints determine
SWING_S = 0.2  # within which a limb swings
# Along the line of sight, relative to the shoulder or hip. In 23 real clips where no limb swings,
# hands and feet move by 0.43 m at most.
SWING_DEPTH_M = 0.5
SWING_IMAGE_M = 0.12  # across it, at the distance of the person
LEAN_M = 0.25  # of the mass's centre from the feet, on the floor
LEAN_S = 2.0
NOT_SITTING = 0.7  # height of the pelvis over two thighs, from which nobody sits
FLOATING_M = 0.25  # of both ankles' height above that at which they stand
FLOATING_S = 1.2  # a jump of 1.7 m
LEAP_M_S = 8.0  # in 40 captures without a leap, below 6
LEAP_S = 0.3  # within which the body is less than half as fast before it, and after it
# Of a leap. In a step, the mean of all keypoints moves by at most 0.07 m more than in any step near
# it in 60 captures without a leap, and by 0.2 m and more in six with one.
LEAP_M = 0.15
POSE_LEAP_M_S = 3.0
SPIN_RAD_S = 4 * np.pi  # in 60 captures without a spin, below 1.5 π
SPIN_RAD = 0.5
# Share of the distance between the hips that is level, from which on the pelvis has a heading.
LEVEL_HIPS = 0.6
# By which a hand or foot speeds up, and slows down after it, in the time of `SNAP_S`: a boxer's
# fist reaches 200 m/s². In that time, it is faster by 6.7 m/s than before and after it.
SNAP_M_S2 = 200.0
SNAP_S = 1 / 30
_SURE_KEYPOINT = 0.5  # confidence
_FEWEST_KEYPOINTS = 10  # of a body; fewer are a limb
BENT_KNEE_DEG = 155.0  # the straightest knee of a standing person
STANDING = 0.85  # distance of hip and ankle over the leg's length, from which a person stands
BENT_S = 3.0  # of standing, in which a knee is straight at some time

_ANKLE_M = 0.09  # height of a standing person's ankle
_FOOT = ("ankle", "foot")
_AT = {name: k for k, name in enumerate(BODY_JOINTS)}
# Ends of limbs, and the joints from which they reach.
_LIMBS = [
    (_AT[f"{side}_{end}"], _AT[f"{side}_{root}"])
    for side in ("left", "right")
    for end, root in (("wrist", "shoulder"), ("ankle", "hip"))
]
# Shares of the body's mass, after Winter's table: trunk and head, thighs, shanks, arms.
_MASSES = {"spine1": 0.3, "spine3": 0.2, "head": 0.08, "left_elbow": 0.05, "right_elbow": 0.05}
_MASSES |= {"left_hip": 0.06, "right_hip": 0.06, "left_knee": 0.1, "right_knee": 0.1}


@dataclass(frozen=True)
class Span:
    """Rows ``first`` to ``last`` of a motion, inclusive, and why they should be reviewed: a key of
    ``notices.REASONS``.
    """

    reason: str
    first: int
    last: int


def find_review_spans(
    motion: Motion, gap_s: float = 0.0, under_floor: BoolArray | None = None
) -> list[Span]:
    """Find the spans of a motion that should be reviewed.

    :param gap_s: spans of the same reason that are less than this many seconds apart are merged.
    :param under_floor: (T,) frames in which a foot is under the floor; None: not known.
    :return: the spans of each reason in turn, in chronological order; of not seen, far and unsure,
        a frame has at most one.
    """
    unseen = ~motion.valid
    found = implausible(motion)
    far = ~unseen & (motion.residual_px > FAR_SHARE * motion.image_size.max()) | found.pop("far")
    unsure = ~unseen & ~far & (body_confidence(motion) < LOW_CONFIDENCE)
    masks = {"unseen": unseen, "far": far, "unsure": unsure, **found}
    if under_floor is not None:
        masks["floor"] = under_floor
    return [
        Span(why, *pair)
        for why, mask in masks.items()
        for pair in _spans(mask, motion.timestamps, gap_s)
    ]


def body_confidence(motion: Motion) -> Float32Array | Float64Array:
    """Return the mean confidence of each frame, (T,), over the body's joints that are seen in at
    least one frame.

    Fingers, which are often occluded, do not count.
    """
    confidence = motion.joint_confidence[:, : len(BODY_JOINTS)]
    shown = confidence.max(axis=0) > 0
    return confidence[:, shown].mean(axis=1) if shown.any() else np.zeros(len(motion))


def body_sigma_m(motions: Sequence[Motion]) -> float:
    """Return the median standard deviation of the body's joints, without fingers, over the frames
    of motions in which it is known, metres; NaN if there are none.
    """
    sigmas = [np.ravel(np.asarray(m.joint_sigma_m)[:, : len(BODY_JOINTS)]) for m in motions]
    known = np.concatenate(sigmas)
    known = known[np.isfinite(known)]
    return float(np.median(known)) if len(known) else float("nan")


def _spans(mask: BoolArray, timestamps: Float64Array, gap_s: float) -> list[tuple[int, int]]:
    """Return the first and last row of each run of True in ``mask``, (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask, int), [0]])))
    out: list[tuple[int, int]] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if out and timestamps[first] - timestamps[out[-1][1]] < gap_s:
            out[-1] = out[-1][0], end - 1
        else:
            out.append((first, end - 1))
    return out


def implausible(motion: Motion) -> dict[str, BoolArray]:
    """Return the frames (T,) of a motion that are not plausible, by the reason, a key of
    ``notices.REASONS``.
    """
    never = np.zeros(len(motion), bool)
    if len(motion) < 2 or not motion.image_size.any():  # imported: no camera has seen it
        return dict.fromkeys(("far", "swing", "lean", "floating", "leap", "spin", "snap"), never)
    joints = joints_in_world(motion)
    return {
        "far": _held(motion, _misses_m(motion) > FAR_M, FAR_S) & motion.valid,
        "swing": _swings(motion) & motion.valid,
        "lean": _leans(motion, joints) & motion.valid,
        "floating": _floats(motion, joints) & motion.valid,
        "leap": (_leaps(motion, joints[:, _AT["pelvis"]]) | _pose_leaps(motion)) & motion.valid,
        "spin": _spins(motion, joints) & motion.valid,
        "snap": _snaps(motion) & motion.valid,
    }


def joints_in_world(motion: Motion) -> Float64Array:
    """Return the body's joints (T, 22, 3) in the world, metres."""
    joints = motion.joints_cam[:, : len(BODY_JOINTS)].astype(float)
    T = motion.world_from_camera
    turned: Float64Array = np.einsum("tij,tkj->tki", T[:, :3, :3], joints)
    return turned + T[:, None, :3, 3]


def has_bent_knees(motion: Motion) -> bool:
    """Return whether the person stands or walks for a while, and no knee is ever straight."""
    joints = joints_in_world(motion)
    straightest = np.zeros(len(motion))
    stands = np.zeros(len(motion), bool)
    for side in ("left", "right"):
        hip, knee, ankle = (joints[:, _AT[f"{side}_{name}"]] for name in ("hip", "knee", "ankle"))
        thigh = np.linalg.norm(hip - knee, axis=1)
        shank = np.linalg.norm(ankle - knee, axis=1)
        reach = np.linalg.norm(hip - ankle, axis=1)
        cosine = (thigh**2 + shank**2 - reach**2) / np.maximum(2 * thigh * shank, 1e-9)
        straightest = np.maximum(straightest, np.degrees(np.arccos(np.clip(cosine, -1, 1))))
        is_upright = hip[:, 2] - ankle[:, 2] > STANDING * (thigh + shank)
        stands |= is_upright & motion.valid
    period = usual_step_s(motion.timestamps)
    if stands.sum() * period < BENT_S or stands.sum() < 0.5 * motion.valid.sum():
        return False
    return bool(np.percentile(straightest[stands], 98) < BENT_KNEE_DEG)


def _swings(motion: Motion) -> BoolArray:
    times = motion.times_with_gaps
    rows = np.arange(len(motion))
    later = np.minimum(np.searchsorted(times, times + SWING_S, side="right") - 1, len(motion) - 1)
    found = np.zeros(len(motion), bool)
    for end, root in _LIMBS:
        at = (motion.joints_cam[:, end] - motion.joints_cam[:, root]).astype(float)
        change = at[later] - at[rows]
        swings = (
            (np.abs(change[:, 2]) > SWING_DEPTH_M)
            & (np.linalg.norm(change[:, :2], axis=1) < SWING_IMAGE_M)
            & motion.valid[later]
        )
        for row in np.flatnonzero(swings):
            found[row : later[row] + 1] = True
    return found


def _leans(motion: Motion, joints: Float64Array) -> BoolArray:
    weights = np.array(list(_MASSES.values()))
    mass = np.einsum("k,tki->ti", weights, joints[:, [_AT[name] for name in _MASSES]])
    mass /= weights.sum()
    feet = joints[:, [_AT[f"{side}_{part}"] for side in ("left", "right") for part in _FOOT], :2]
    # Of the nearest point between the two feet.
    nearest = np.full(len(motion), np.inf)
    for a in range(4):
        for b in range(a + 1, 4):
            nearest = np.minimum(nearest, _distance(mass[:, :2], feet[:, a], feet[:, b]))
    stands = (motion.foot_contact > 0.5).any(axis=1)
    lowest_ankle = joints[:, [_AT["left_ankle"], _AT["right_ankle"]], 2].min(axis=1)
    pelvis_height = joints[:, _AT["pelvis"], 2] - lowest_ankle
    thigh = np.linalg.norm(joints[:, _AT["left_hip"]] - joints[:, _AT["left_knee"]], axis=1)
    stands &= pelvis_height > NOT_SITTING * 2 * thigh
    return _held(motion, (nearest > LEAN_M) & stands, LEAN_S)


def _floats(motion: Motion, joints: Float64Array) -> BoolArray:
    if motion.uneven_ground:
        return np.zeros(len(motion), bool)
    # The ankles of people on their feet, and hands or pelvis of others.
    above_feet = [k for name, k in _AT.items() if not name.endswith("foot")]
    lowest = joints[:, above_feet, 2].min(axis=1)
    return _held(motion, lowest > _ANKLE_M + FLOATING_M, FLOATING_S)


def _misses_m(motion: Motion) -> Float64Array:
    """Return the reprojection error (T,) at the distance of the pelvis, metres."""
    depth = motion.joints_cam[:, _AT["pelvis"], 2].astype(float)
    missed: Float64Array = motion.residual_px * depth / motion.intrinsics_of_frames[:, 0, 0]
    return missed


def _leaps(motion: Motion, pelvis: Float64Array) -> BoolArray:
    """Return the frames (T,) before and after a step of a leap.

    :param pelvis: (T, 3) in the world, metres.
    """
    return _bursts(motion, np.diff(pelvis, axis=0), LEAP_M_S, LEAP_M)


def _spins(motion: Motion, joints: Float64Array) -> BoolArray:
    """Return the frames (T,) before and after a step in which the hips turn too fast."""
    across = joints[:, _AT["left_hip"]] - joints[:, _AT["right_hip"]]
    is_level = np.linalg.norm(across[:, :2], axis=1) > LEVEL_HIPS * np.linalg.norm(across, axis=1)
    heading = np.arctan2(across[:, 1], across[:, 0])
    turns = (np.diff(heading) + np.pi) % (2 * np.pi) - np.pi
    turns = np.where(is_level[1:] & is_level[:-1], turns, 0.0)
    return _bursts(motion, turns[:, None], SPIN_RAD_S, SPIN_RAD)


def _bursts(motion: Motion, steps: Float64Array, fastest: float, least: float) -> BoolArray:
    """Return the frames (T,) before and after a step that is faster than anybody can be, and slow
    before and after it.

    :param steps: (T - 1, n) from each frame to the next.
    :param fastest: per second.
    :param least: what the steps that are so fast must add up to.
    """
    times = motion.times_with_gaps
    speed = np.linalg.norm(steps, axis=1) / np.diff(times)
    is_seen = motion.valid[1:] & motion.valid[:-1]
    found = np.zeros(len(motion), bool)
    for k in np.flatnonzero((speed > fastest) & is_seen):
        before, after = _near_steps(times, speed, k)
        if not all(len(others) and others.min() < 0.5 * speed[k] for others in (before, after)):
            continue
        # at high rates, smoothing spreads a leap over several frames
        slow = np.flatnonzero(np.r_[True, speed < 0.5 * speed[k], True])
        number = np.searchsorted(slow, k + 1)
        total = steps[slow[number - 1] : slow[number] - 1].sum(axis=0)
        found[k : k + 2] |= np.linalg.norm(total) > least
    return found


def _snaps(motion: Motion) -> BoolArray:
    """Return the frames (T,) from before to after the moment in which a hand or foot, relative to
    shoulder or hip, is much faster than just before and just after it.
    """
    times = motion.times_with_gaps
    found = np.zeros(len(motion), bool)
    n = max(1, round(SNAP_S / max(usual_step_s(motion.timestamps), 1e-6)))
    if len(motion) < 3 * n + 1:
        return found
    span_s = times[n:] - times[:-n]
    is_seen = np.lib.stride_tricks.sliding_window_view(motion.valid, 3 * n + 1).all(axis=1)
    for end, root in _LIMBS:
        at = (motion.joints_cam[:, end] - motion.joints_cam[:, root]).astype(float)
        speed = np.linalg.norm(at[n:] - at[:-n], axis=1) / span_s
        beside = np.maximum(speed[: -2 * n], speed[2 * n :])
        snaps = speed[n:-n] - beside > SNAP_M_S2 * span_s[n:-n]
        for row in np.flatnonzero(snaps & is_seen) + n:
            found[row : row + n + 1] = True
    return found


def _pose_leaps(motion: Motion) -> BoolArray:
    """Return the frames (T,) before and after a step in which all keypoints together move far more
    than in those near it, where a moment is left out of footage of a camera that stays.

    With rays d = R_world_camera ((u - c_x) / f_x, (v - c_y) / f_y, 1), the keypoints move by the
    mean of z |Δd|, z the depth of the pelvis. A limb that is mistaken for another one is a small
    part of that.
    """
    times = motion.times_with_gaps
    K = motion.intrinsics_of_frames[:, None]
    flat = (motion.keypoints2d[..., :2] - K[..., :2, 2]) / K[..., (0, 1), (0, 1)]
    lines = np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1)
    rays = lines @ np.swapaxes(motion.world_from_camera[:, :3, :3], 1, 2)
    depth = motion.joints_cam[1:, _AT["pelvis"], 2]
    moved_m = depth[:, None] * np.linalg.norm(np.diff(rays, axis=0), axis=-1)
    is_sure = (motion.keypoints2d[..., 2] > _SURE_KEYPOINT) & motion.valid[:, None]
    counts = is_sure[1:] & is_sure[:-1]
    mean_m = np.where(counts, moved_m, 0.0).sum(axis=1) / np.maximum(counts.sum(axis=1), 1)
    found = np.zeros(len(motion), bool)
    for k in np.flatnonzero((mean_m > LEAP_M) & (counts.sum(axis=1) >= _FEWEST_KEYPOINTS)):
        before, after = _near_steps(times, mean_m, k)
        if len(before) and len(after):
            beyond_m = mean_m[k] - max(before.max(), after.max())
            is_fast = beyond_m > POSE_LEAP_M_S * (times[k + 1] - times[k])
            found[k : k + 2] |= beyond_m > LEAP_M and is_fast
    return found


def _near_steps(
    times: Float64Array, values: Float64Array, k: int
) -> tuple[Float64Array, Float64Array]:
    """Return the values (T - 1,) of the steps up to `LEAP_S` before and after the k-th one."""
    before = values[:k][times[k] - times[:k] <= LEAP_S]
    after = values[k + 1 :][times[k + 2 :] - times[k + 1] <= LEAP_S]
    return before, after


def _distance(point: Float64Array, a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the distances (T,) of points (T, 2) from the segments from a to b, (T, 2)."""
    along = b - a
    share = ((point - a) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
    nearest = a + np.clip(share, 0, 1)[:, None] * along
    return np.linalg.norm(point - nearest, axis=1)


def _held(motion: Motion, mask: BoolArray, least_s: float) -> BoolArray:
    """Return the runs of a mask (T,) that last long enough within a scene; frames in which the
    person was not seen do not count.
    """
    held = np.zeros(len(mask), bool)
    for scene in motion.scenes:
        times = motion.timestamps[scene]
        steps_s = np.diff(times, prepend=times[:1])
        seen_s = times - np.cumsum(np.where(motion.valid[scene], 0.0, steps_s))
        for first, last in _spans(mask[scene], times, 0.0):
            held[scene][first : last + 1] = seen_s[last] - seen_s[first] >= least_s
    return held
