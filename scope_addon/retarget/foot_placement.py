# SPDX-License-Identifier: GPL-3.0-or-later
"""Placing a rig's feet where the body's are, scaled, by lowering the pelvis and solving the
legs: two-bone inverse kinematics in closed form, for all frames at once.

The goals of the ankles allow for feet that differ in shape from the body's. A foot that rolls from
the heel onto the ball rotates about the one that is on the floor, and that point must not move. The
ankle follows from either point i, heel or ball:

    a_i = G(p_i) + Y c_i − E q_i + h,      c_i = q_i − t s_i, with its height set to 0,

    p_i   the point on the body, metres, world frame
    s_i   from the body's ankle to the point, at rest;  q_i: the same on the rig
    s     the rig's leg length divided by the body's
    t     the scale of positions on the floor, usually s
    G(p)  t p, but the height is that of the rig's point at rest plus s times the rise of p above
          its height at rest
    D, Y  rotation of the foot from rest, and its rotation about the vertical alone (heading)
    E     D, but a foot that is longer than the body's, scaled, is pitched less: otherwise its ankle
          would rise too far for its leg
    h     from t times the body's hip to the rig's, on the floor: so legs have the directions of the
          body's, however wide the hips are; constant, or nearly so, while the foot rests. Of a
          single frame, it points to the side of the foot, which turns less than the pelvis

So a point that is at rest on the body is at rest on the rig. On a flat foot both goals are the
same: h from t times the body's ankle, at the height of the rig's ankle; so a longer foot extends at
both ends, and nothing jumps. The two goals are blended by a logistic function of the difference in
height of the points, in favour of the lower one. Neither point penetrates the floor, even where the
captured foot does, unless the person is on a lower floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp, shortest_turn
from ..arrays import BoolArray, Float64Array, FloatArray, unit_vectors
from ..edit.clip import Clip, about_z
from ..kinematics.axes import UP, rotated, transposed
from ..kinematics.foot_skin import FootSkin, lower_floors
from ..kinematics.leg_reach import cross, knee_turn
from ..kinematics.sequences import runs
from ..kinematics.smoothing import fill_gaps, gaussian_smooth
from ..kinematics.standing import standing_probability
from ..scene_gaps import usual_step_s
from .rest_pose import Pose, Skeleton, head_positions

# Thickness of the sole, and length of the heel region.
_SOLE_M = 0.015
_HEEL_M = 0.02
_REACH = 0.9995  # Share of a leg's length beyond which the pelvis is lowered.
_SIDES = ("left", "right")
_MAX_STRETCH = 0.9999  # Share of the leg's length beyond which the knee would snap.
_LEVEL = np.array([1.0, 1.0, 0.0])
_SOFT_M = 0.004  # Scale of the logistic function of the difference in height of heel and ball.
# Slower changes of h are followed while a foot rests: somebody may turn without taking steps.
_STANCE_HZ = 0.3
# Feet whose toes point down by more than 60 degrees lie or kneel: from there on, the pitch is kept.
_STEEP = 2.0
_DROP_S = 4 / 30  # Time before and after, over which the pelvis is lowered.


@dataclass(frozen=True)
class Legs:
    """The L legs of a rig that have an ankle, beside the body's, at rest. Bones are the rig's, by
    index.
    """

    hips: list[int]
    knees: list[int]
    ankles: list[int]
    joints: list[int]  # the body's ankles
    sockets: list[int]  # the body's hips
    toed: list[int]  # the legs that have a bone for the toes
    toes: list[int]  # these bones
    # (len(toed), 3, 3) A_b F R_b of these bones, as in ``transfer.py``
    toes_in_t_pose: Float64Array
    body: FootRest  # (L, 3) and (L,)
    rig: FootRest
    tips: Float64Array  # (len(toed), 3) from the ball to the tip of the toes, metres
    lengths: Float64Array  # (L,) of the legs, nearly stretched, metres
    # (3,) scale of positions: that on the floor twice, and the ratio of leg lengths, rig to body.
    scales: Float64Array


def legs_at_rest(
    rig: Skeleton,
    row: dict[str, int],
    alignment: Float64Array,
    body: Body,
    rest: tuple[Float64Array, Float64Array],
    scales: Float64Array,
) -> Legs | None:
    """Measure the legs of a rig and of the body at rest; None if the rig has no ankles.

    :param row: the rig's bone of each body part.
    :param alignment: (B, 3, 3) A_b F.
    :param rest: the body's vertices (V, 3) and joints (K+1, 3) at rest, metres, world axes.
    :param scales: (3,) of positions on the floor, twice, and the rig's leg length divided by the
        body's.
    """
    sides = [side for side in _SIDES if f"{side}_ankle" in row]
    if not sides:
        return None
    hips, knees, ankles = (
        [row[f"{side}_{part}"] for side in sides] for part in ("hip", "knee", "ankle")
    )
    toe_of = [row.get(f"{side}_foot") for side in sides]
    source = _body_feet(body, *rest, sides)
    feet = [
        _rig_foot(rig, alignment[ankle], ankle, toe, source.heel[leg], source.ball[leg], scales[2])
        for leg, (ankle, toe) in enumerate(zip(ankles, toe_of, strict=True))
    ]
    heels, balls, heights = (np.array(each) for each in zip(*feet, strict=True))
    toed = [leg for leg, toe in enumerate(toe_of) if toe is not None]
    toes = [toe for toe in toe_of if toe is not None]
    sizes = [np.linalg.norm(rig.ends[toe] - rig.heads[toe]) for toe in toes]
    # What toes end at may lie above or below them, so their direction is taken from the foot.
    tips = [
        balls[leg] * [1, 1, 0] / np.linalg.norm(balls[leg, :2]) * size
        for leg, size in zip(toed, sizes, strict=True)
    ]
    places = rig.heads[[hips, knees, ankles]]  # (3, L, 3)
    return Legs(
        hips=hips,
        knees=knees,
        ankles=ankles,
        joints=[body.joint_names.index(f"{side}_ankle") for side in sides],
        sockets=[body.joint_names.index(f"{side}_hip") for side in sides],
        toed=toed,
        toes=toes,
        toes_in_t_pose=alignment[toes] @ rig.rotations[toes],
        body=source,
        rig=FootRest(heels, balls, heights),
        tips=np.array(tips).reshape(-1, 3),
        lengths=_REACH * np.linalg.norm(np.diff(places, axis=0), axis=2).sum(axis=0),
        scales=scales,
    )


def _body_feet(body: Body, v: Float64Array, J: Float64Array, sides: list[str]) -> FootRest:
    """Measure the feet of the body at rest. The heel is the rear end of what the foot, without its
    toes, stands on.
    """
    low = float(v[:, 2].min())
    ankles = [body.joint_names.index(f"{side}_ankle") for side in sides]
    balls = [body.joint_names.index(f"{side}_foot") for side in sides]
    heels = J[ankles]
    for foot, ankle in enumerate(ankles):
        sole = v[(body.strongest_joints == ankle) & (v[:, 2] < low + _SOLE_M)]
        if len(sole):
            heels[foot] = sole[sole[:, 1] > sole[:, 1].max() - _HEEL_M].mean(axis=0)
    heels[:, 2] = low
    return FootRest(heels - J[ankles], J[balls] - J[ankles], J[ankles, 2] - low)


def _rig_foot(
    rig: Skeleton,
    AF: Float64Array,
    ankle: int,
    toe: int | None,
    heel_of_body: Float64Array,
    ball_of_body: Float64Array,
    scale: float,
) -> tuple[Float64Array, Float64Array, float]:
    """Measure the rig's foot: heel and ball (3,) from the ankle, and its height. Without a bone at
    the ball, its length is taken from the body's.
    """
    height = float(rig.heads[ankle, 2] - rig.floor)
    ball = AF @ ((rig.heads[toe] if toe is not None else rig.ends[ankle]) - rig.heads[ankle])
    length = float(np.linalg.norm(ball_of_body[:2]))
    share = float(np.linalg.norm(ball[:2])) / length
    # A bone for the toes shows where the ball is, however long the foot of a short leg.
    longest = 3 * scale if toe is None else np.inf
    if not 0.3 * scale < share < longest or ball @ ball_of_body < 0:
        share = scale
        ball = np.array([*(scale * ball_of_body[:2]), -0.8 * height])
    # No bone ends at the heel, so its position is proportional to the body's.
    return np.array([*(share * heel_of_body[:2]), -height]), ball, height


def place_feet(
    rig: Skeleton,
    legs: Legs,
    bone_turns: Float64Array,
    pose: Pose,
    joints: Float64Array,
    times: Float64Array,
    one_floor: BoolArray,
) -> None:
    """Move the rig's ankles, and with them heels and balls, to where the body's are.

    :param bone_turns: (T, B, 3, 3) D of each bone, as in ``transfer.py``.
    :param pose: the rig's motion, which changes.
    :param joints: (T, K+1, 3) of the body, metres, world frame.
    :param times: (T,) seconds.
    :param one_floor: (T,) where feet and toes are kept above the floor; see `frames_on_one_floor`.
    """
    world = pose.rotations
    heads = pose.heads
    turns = bone_turns[:, legs.ankles]
    unpitched = _unpitched(legs, turns)
    rig_turns = _pitched(turns, -unpitched)
    world[:, legs.ankles] = rig_turns @ transposed(turns) @ world[:, legs.ankles]
    goals = ankle_goal(
        legs.body,
        legs.rig,
        legs.scales,
        (turns, rig_turns),
        joints[:, legs.joints],
        one_floor=one_floor[:, None],
    )
    goals += _stance(legs, heads, turns, joints, times)
    if legs.toed:
        toes = _with_their_feet(
            bone_turns[:, legs.toes], turns[:, legs.toed], unpitched[:, legs.toed]
        )
        balls = (goals + rotated(rig_turns, legs.rig.ball))[one_floor][:, legs.toed]
        rested = (legs.rig.height + legs.rig.ball[:, 2])[legs.toed]
        toes[one_floor] = flat_toes(toes[one_floor], legs.tips, balls, rested)
        world[:, legs.toes] = toes @ legs.toes_in_t_pose
    heads[..., 2] -= pelvis_drop(heads[:, legs.hips], goals, legs.lengths, times)[:, None]
    at = _rows(heads[:, legs.hips]), _rows(heads[:, legs.knees]), _rows(heads[:, legs.ankles])
    left = _rows(bone_turns[:, legs.hips, :, 0])  # The axis about which the body's knees bend.
    thighs = _rows(world[:, legs.hips])
    shins = _rows(world[:, legs.knees])
    solved = solve_leg(thighs, shins, at, _rows(goals), left)
    world[:, legs.hips], world[:, legs.knees] = (R.reshape(len(world), -1, 3, 3) for R in solved)
    placed = head_positions(rig, world)
    first = legs.hips[0]
    heads[:] = placed + (heads[:, first] - placed[:, first])[:, None]


def _unpitched(legs: Legs, turns: Float64Array) -> Float64Array:
    """Return by how much less (T, L) the rig's feet are pitched down than the body's, radians; a
    foot that points steeply down keeps its pitch.

    :param turns: (T, L, 3, 3) D of the feet.
    """
    lengths = np.linalg.norm(legs.rig.ball[:, :2], axis=1)
    wanted = legs.scales[2] * np.linalg.norm(legs.body.ball[:, :2], axis=1)
    excess = 1.0 - np.minimum(wanted / lengths, 1.0)
    pitch = turns[..., 2, 1] * np.clip(_STEEP * turns[..., 2, 2], 0.0, 1.0)
    unpitched: Float64Array = excess * pitch
    return unpitched


def _pitched(turns: Float64Array, angles: Float64Array) -> Float64Array:
    """Return rotations (..., 3, 3) pitched down by angles (...), radians, about their own axes from
    side to side.
    """
    return exp(angles[..., None] * turns[..., 0]) @ turns


def _with_their_feet(
    toes: Float64Array, feet: Float64Array, unpitched: Float64Array
) -> Float64Array:
    """Return toes (T, L, 3, 3) pitched as much less as their feet, but not beyond the pitch of
    these: toes that are bent, as flat ones under a raised heel, keep their direction.

    :param toes: (T, L, 3, 3) D of the toes.
    :param feet: (T, L, 3, 3) D of the feet.
    :param unpitched: (T, L) see `_unpitched`.
    """
    steeper = toes[..., 2, 1] - feet[..., 2, 1] + unpitched  # than the rig's feet, nearly radians
    less = np.clip(steeper, np.minimum(unpitched, 0.0), np.maximum(unpitched, 0.0))
    return _pitched(toes, -less)


def _stance(
    legs: Legs,
    heads: Float64Array,
    turns: Float64Array,
    joints: Float64Array,
    times: Float64Array,
) -> Float64Array:
    """Return h (T, L, 3), metres.

    :param heads: (T, B, 3) of the rig, metres, world frame.
    :param turns: (T, L, 3, 3) D of the feet.
    :param joints: (T, K+1, 3) of the body, metres, world frame.
    :param times: (T,) seconds.
    """
    offset = (heads[:, legs.hips] - legs.scales * joints[:, legs.sockets]) * _LEVEL
    if len(times) == 1:  # in a live capture, no other frame tells whether a foot rests
        sideways = unit_vectors(turns[..., 0] * _LEVEL)
        across = (offset * sideways).sum(axis=-1, keepdims=True)
        return sideways * np.copysign(np.linalg.norm(offset, axis=-1, keepdims=True), across)
    stands = [
        # A foot that is slow at any height may be held there, too.
        standing_probability(point, UP, times, uneven_ground=True)
        for at in (legs.body.heel, legs.body.ball)
        for point in [joints[:, legs.joints] + rotated(turns, at)]
    ]
    rests = np.maximum(*stands) > 0.5
    for leg, of_leg in enumerate(rests.T):
        held = np.zeros_like(offset[:, leg])
        for span in (slice(*run) for run in runs(of_leg)):
            mean = gaussian_smooth(offset[span, leg], times[span], _STANCE_HZ)
            held[span] = mean - offset[span, leg]
        if of_leg.any():
            offset[:, leg] += fill_gaps(held, of_leg, times)
    return offset


def frames_on_one_floor(clip: Clip, body: Body, betas: FloatArray) -> BoolArray:
    """Return the (T,) frames in which the feet do not walk or stand on another, lower floor, as at
    the foot of a stage.
    """
    heights = FootSkin(body, betas).heights(*clip.parts(body, betas), UP)
    contact = standing_probability(clip.soles(body, betas), UP, clip.times)
    found = np.ones(len(clip), bool)
    for first, end in lower_floors(heights, contact, clip.times):
        found[first:end] = False
    return found


def _rows(of_legs: Float64Array) -> Float64Array:
    """Return the entries (T·L, ...) of T frames and L legs, (T, L, ...), which are solved at
    once.
    """
    return of_legs.reshape(-1, *of_legs.shape[2:])


def solve_leg(
    thigh: Float64Array,
    shin: Float64Array,
    joints: tuple[Float64Array, Float64Array, Float64Array],
    goal: Float64Array,
    sideways: Float64Array,
) -> tuple[Float64Array, Float64Array]:
    """Rotate thigh and shin so that the ankle reaches the goal; a bent knee stays in its plane.

    The knee first turns about the axis of `leg_reach`, which leads a nearly straight or
    overstretched one forwards. If that axis is not perpendicular to the leg, a part of the distance
    may remain; the law of cosines corrects it. Then the leg is rotated so that the ankle is in the
    direction of the goal. If the goal is out of reach, the leg points to it, stretched.

    :param thigh: (T, 3, 3) bone to world.
    :param shin: (T, 3, 3) bone to world.
    :param joints: hip, knee and ankle, each (T, 3), metres, world frame.
    :param goal: (T, 3) target of the ankle, metres, world frame.
    :param sideways: (T, 3) the unit axis about which the shin bends backwards, world frame.
    :return: the new rotations of thigh and shin.
    """
    hip, knee, ankle = joints
    upper = knee - hip
    lower = ankle - knee
    a = np.linalg.norm(upper, axis=1)
    b = np.linalg.norm(lower, axis=1)
    distance = np.clip(
        np.linalg.norm(goal - hip, axis=1), np.abs(a - b) + 1e-6, _MAX_STRETCH * (a + b)
    )
    at_knee = knee_turn(upper, lower, sideways, distance)
    lower = rotated(at_knee, lower)
    normal = cross(upper, lower)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(size > 1e-4 * (a * b)[:, None], normal / np.maximum(size, 1e-12), sideways)
    bend = np.arccos(np.clip((np.sum(upper * lower, axis=1)) / (a * b), -1, 1))
    wanted = np.arccos(np.clip((distance**2 - a**2 - b**2) / (2 * a * b), -1, 1))
    rest = exp(normal * (wanted - bend)[:, None])
    swing = shortest_turn(upper + rotated(rest, lower), goal - hip)
    return swing @ thigh, swing @ rest @ at_knee @ shin


@dataclass(frozen=True)
class FootRest:
    """Feet at rest, in metres of their own skeleton, world axes."""

    heel: Float64Array  # (..., 3) from the ankle
    ball: Float64Array  # (..., 3) from the ankle
    height: Float64Array  # (...) of the ankle above the floor


def ankle_goal(
    source: FootRest,
    rig: FootRest,
    scales: Float64Array,
    turns: tuple[Float64Array, Float64Array],
    ankle: Float64Array,
    one_floor: BoolArray,
) -> Float64Array:
    """Compute the goals of the rig's ankles, for any number of frames and feet at once.

    :param source: the body's feet.
    :param rig: the rig's feet.
    :param scales: (3,), t, t and s.
    :param turns: (..., 3, 3) D and E, the rotations of the body's feet and the rig's from rest.
    :param ankle: (..., 3) the body's, metres.
    :param one_floor: (...) where feet are kept above the floor.
    :return: (..., 3) metres, without h.
    """
    # About the vertical alone, from the sideways axis, which stays horizontal.
    turn, rig_turn = turns
    yaw = about_z(np.arctan2(turn[..., 1, 0], turn[..., 0, 0])).reshape(turn.shape)
    goals = []
    heights = []
    rolled = []
    for s, q in ((source.heel, rig.heel), (source.ball, rig.ball)):
        point = ankle + rotated(turn, s)
        rig_point = rotated(rig_turn, q)
        # The height above its rest position on the floor.
        above = point[..., 2] - (source.height + s[..., 2])
        place = scales * point
        place[..., 2] = scales[2] * above + rig.height + q[..., 2]
        goals.append(place + rotated(yaw, (q - scales * s) * _LEVEL) - rig_point)
        heights.append(above)
        rolled.append(rig_point[..., 2] - (rig.height + q[..., 2]))
    # A weight of 1 means that the ball is in contact.
    share = 1.0 / (1.0 + np.exp(np.clip((heights[1] - heights[0]) / _SOFT_M, -50, 50)))
    goal: Float64Array = goals[0] + share[..., None] * (goals[1] - goals[0])
    lowest = np.where(one_floor, -np.minimum(rolled[0], rolled[1]), -np.inf)
    goal[..., 2] = np.maximum(goal[..., 2], lowest)
    return goal


def flat_toes(
    toe: Float64Array,
    rest: Float64Array,
    ball: Float64Array,
    ball_rest: Float64Array,
) -> Float64Array:
    """Raise toes whose tips would penetrate the floor.

    A capture in which the toes never bend pushes them into the floor when the heel rises; here they
    stay flat on it.

    :param toe: (..., 3, 3) rotations of the toes from rest.
    :param rest: (..., 3) from ball to tip at rest, metres.
    :param ball: (..., 3) metres.
    :param ball_rest: (...) height of the ball at rest, metres.
    :return: (..., 3, 3) rotations of the toes from rest.
    """
    tip = rotated(toe, rest)
    length = np.maximum(np.sqrt((rest * rest).sum(axis=-1)), 1e-9)
    lowest = np.clip(rest[..., 2] - (ball[..., 2] - ball_rest), -length, length)
    across = np.hypot(tip[..., 0], tip[..., 1])
    # The axis is undefined for toes that point straight down.
    penetrates = (tip[..., 2] < lowest) & (across > 0.05 * length)
    if not penetrates.any():
        return toe
    angle = np.arcsin(np.clip(tip[..., 2] / length, -1, 1))
    lift = np.where(penetrates, np.arcsin(lowest / length) - angle, 0.0)
    side = (
        np.stack([tip[..., 1], -tip[..., 0], np.zeros_like(across)], axis=-1)
        / np.maximum(across, 1e-9)[..., None]
    )
    return exp(side * lift[..., None]) @ toe


def pelvis_drop(
    hips: Float64Array,
    goals: Float64Array,
    lengths: Float64Array,
    times: Float64Array,
) -> Float64Array:
    """Compute how far the pelvis has to be lowered, smoothly in time, for the legs to reach the
    goals of the ankles.

    :param hips: (T, L, 3) of L legs, metres.
    :param goals: (T, L, 3) of the ankles, metres.
    :param lengths: (L,) of the stretched legs, metres.
    :param times: (T,) seconds.
    :return: (T,) metres.
    """
    level = np.linalg.norm((goals - hips)[..., :2], axis=-1)
    upright = np.sqrt(np.maximum(lengths**2 - level**2, (0.5 * lengths) ** 2))
    needed: Float64Array = np.maximum(0.0, (hips - goals)[..., 2] - upright).max(axis=1)
    if not needed.any() or len(needed) == 1:
        return needed
    # A maximum filter, then a weighted mean of the same width: nowhere less than needed, and
    # smooth.
    frames = round(_DROP_S / usual_step_s(times))
    width = np.arange(-frames, frames + 1)
    near = np.clip(np.arange(len(needed))[:, None] + width, 0, len(needed) - 1)
    weight = 1 + np.cos(np.pi * width / (frames + 1))
    return needed[near].max(axis=1)[near] @ (weight / weight.sum())
