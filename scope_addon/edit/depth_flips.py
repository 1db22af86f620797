# SPDX-License-Identifier: GPL-3.0-or-later
"""Limbs and bodies mirrored in depth: the other pose that looks nearly the same in the image.

A joint p of a limb lies on its ray from the camera, as far from the joint before it, q, as the bone
is long. Of the two such places, the other one is taken:

    |s r - q| = L,   s = r·q ± sqrt((r·q)² - q·q + L²),   r = p / |p|, the camera at the origin

So joints stay where they are in the image. Bones keep how they are twisted about themselves,
relative to the plane in which the limb is bent: elbows and knees stay hinges. One that was bent
backwards or aside bends as it should then.

A whole body is mirrored in the upright plane that faces the camera, through the pelvis, so that it
stays upright and on its floor. A body's mirror image is one whose left side is the right:

    G'_i = M G_m(i) S,   M = I - 2 v vᵀ,   S = diag(-1, 1, 1)

with the global rotations G, the horizontal line of sight v, and the opposite joint m(i).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp, log, shortest_turn
from ..arrays import Float64Array, FloatArray, IndexArray, unit_vectors
from ..kinematics.axes import UP, transposed
from ..kinematics.mirrored_limbs import LIMBS, other_side
from .clip import Clip
from .corrections import BODY, DepthFlip
from .solve_pins import Shot, keys_of_span
from .spans import SIDES_EXCHANGED, interpolate

# Around each end of a span, its poses are blended into those beside it within this time.
_BLEND_S = 0.1
_NEAREST_M = 0.1  # from the camera
# A limb bent by less than about 6 degrees says nothing about the plane in which it bends, and one
# bent by more than about 20 all.
_BENDS = (0.1, 0.35)
# Of the limb's lower bone both depths are possible. The mirrored one is taken, unless the upper
# bone would be twisted by so much more, radians: then the elbow or knee would bend backwards.
_MORE_TWIST = 1.0
# About which elbows and knees bend, in the axes of both bones.
_HINGES = {"leg": (1.0, 0.0, 0.0), "left_arm": (0.0, -1.0, 0.0), "right_arm": (0.0, 1.0, 0.0)}
# Radians by which a limb goes on bending aside from its hinge if it did so before.
_MOST_OFF = 0.35
_LEAST_HORIZONTAL = 0.3  # of a line of sight; below, the camera looks down on the person
_UPPER = {"arm": True, "leg": True, "forearm": False, "shin": False}


def flipped(
    clip: Clip,
    body: Body,
    betas: FloatArray,
    flips: Iterable[DepthFlip],
    shot: Shot,
) -> Clip:
    """Mirror limbs and bodies in depth, one after the other, and blend the ends of the spans.

    :param clip: in the world in which the shot's camera is.
    :param betas: (P,) shape coefficients.
    :param shot: on the clip's clock.
    :return: a new clip; keys that no span reaches are the same to the bit.
    """
    out = clip.copy()
    for flip in flips:
        span = keys_of_span(out, flip.first, flip.last, shot)
        if not len(span) or flip.first > shot.frames[-1] or flip.last < shot.frames[0]:
            continue
        times = shot.times
        cameras = [int(np.abs(times - time).argmin()) for time in out.times[span]]
        centers = shot.world_from_camera[cameras, :3, 3]
        part = out.rows(span)
        if flip.part == BODY:
            changed = np.arange(body.K + 1)
            out.rotations[span] = _turned_around(part, body, centers)
        else:
            limb = _limb(body, flip.part)
            changed = np.array(limb[:2])
            upper = _UPPER[flip.part.partition("_")[2]]
            out.rotations[np.ix_(span, changed)] = _mirrored_limb(
                part, body, betas, centers, limb, upper=upper
            )
        _blend_ends(out, span, changed)
    return out


def _limb(body: Body, part: str) -> tuple[int, int, int]:
    """Return the joints at the start of both bones of a limb, and at its end."""
    side, _, kind = part.partition("_")
    start = f"{side}_shoulder" if kind in ("arm", "forearm") else f"{side}_hip"
    names = next(limb for limb in LIMBS if limb[0] == start)
    first, second, end = (body.joint_names.index(name) for name in names)
    return first, second, end


def _turned_around(clip: Clip, body: Body, centers: Float64Array) -> Float64Array:
    """Return the rotations (T, K+1, 3, 3) of a body that is mirrored in depth."""
    names = body.joint_names
    opposite = [names.index(other_side(name)) for name in names]
    sight = unit_vectors(clip.root - centers)
    level = sight - (sight @ UP)[:, None] * UP
    is_level = np.linalg.norm(level, axis=1, keepdims=True) > _LEAST_HORIZONTAL
    v = unit_vectors(np.where(is_level, level, sight))
    M = np.eye(3) - 2.0 * v[:, :, None] * v[:, None, :]
    rotations: Float64Array = SIDES_EXCHANGED @ clip.rotations[:, opposite] @ SIDES_EXCHANGED
    rotations[:, 0] = M @ clip.rotations[:, 0] @ SIDES_EXCHANGED
    return rotations


def _mirrored_limb(
    clip: Clip,
    body: Body,
    betas: FloatArray,
    centers: Float64Array,
    limb: tuple[int, int, int],
    *,
    upper: bool,
) -> Float64Array:
    """Return the rotations (T, 2, 3, 3) of both bones of a limb that is mirrored in depth.

    :param centers: (T, 3) the camera, metres, world.
    :param upper: whether to mirror the first bone too.
    """
    first, second, end = limb
    R, joints = clip.parts(body, betas)
    start, middle, last = (joints[:, joint] - centers for joint in limb)
    side = body.joint_names[first].partition("_")[0]
    is_leg = body.joint_names[first].endswith("hip")
    hinge = np.array(_HINGES["leg" if is_leg else f"{side}_arm"])
    place = _on_ray(middle, start, middle - start, mirrored=upper)
    found = []
    for mirrored in (True, False) if upper else (True,):
        tip = _on_ray(last, place, last - middle, mirrored=mirrored)
        bones = (middle - start, last - middle), (place - start, tip - place)
        new = _turned_bones((R[:, first], R[:, second]), *bones, hinge)
        R_parent = R[:, body.parents[first]]
        rotations = np.stack([transposed(R_parent) @ new[0], transposed(new[0]) @ new[1]], axis=1)
        rest = body.rest_joints(betas)
        twist = _twists(rotations[:, 0], rest[second] - rest[first])
        found.append((float(twist.mean()), rotations))
    is_unnatural = len(found) == 2 and found[0][0] > found[1][0] + _MORE_TWIST
    return found[1][1] if is_unnatural else found[0][1]


def _on_ray(
    joint: Float64Array,
    start: Float64Array,
    bone: Float64Array,
    *,
    mirrored: bool,
) -> Float64Array:
    """Return the place (T, 3) of a joint on its ray, at its bone's length from the bone's start.

    :param joint: (T, 3) from the camera, metres.
    :param start: (T, 3) where the bone starts now, from the camera.
    :param bone: (T, 3) the bone as it was.
    :param mirrored: whether the bone shall point to the other side of its start.
    """
    ray = unit_vectors(joint)
    nearest = (ray * start).sum(axis=1)
    off = (bone**2).sum(axis=1) - ((start**2).sum(axis=1) - nearest**2)
    half = np.sqrt(np.maximum(off, 0.0))  # a bone too short for its ray points to it
    side = np.where((ray * bone).sum(axis=1) >= 0.0, 1.0, -1.0) * (-1.0 if mirrored else 1.0)
    depth = np.maximum(nearest + side * half, _NEAREST_M)
    direction = unit_vectors(depth[:, None] * ray - start)
    return start + np.linalg.norm(bone, axis=1, keepdims=True) * direction


def _turned_bones(
    rotations: tuple[Float64Array, Float64Array],
    before: tuple[Float64Array, Float64Array],
    after: tuple[Float64Array, Float64Array],
    hinge: Float64Array,
) -> tuple[Float64Array, Float64Array]:
    """Turn both bones of a limb to other directions, each (T, 3), with the plane in which it bends.

    :param rotations: of the upper and the lower bone, global, (T, 3, 3) each.
    :param hinge: (3,) the axis about which the limb bends, in the axes of both bones.
    """
    normals = [
        np.cross(unit_vectors(upper), unit_vectors(lower)) for upper, lower in (before, after)
    ]
    bent = np.minimum(*(np.linalg.norm(normal, axis=1) for normal in normals))
    share = np.clip((bent - _BENDS[0]) / (_BENDS[1] - _BENDS[0]), 0.0, 1.0)
    off_upper = _angle_about(before[0], rotations[0] @ hinge, normals[0])
    wrong = off_upper - np.clip(off_upper, -_MOST_OFF, _MOST_OFF)
    turned = []
    for R, old, new in zip(rotations, before, after, strict=True):
        turn = shortest_turn(old, new)
        off = _angle_about(old, R @ hinge, normals[0]) - wrong
        angle = share * (_angle_about(new, turn @ R @ hinge, normals[1]) - off)
        turned.append(exp(angle[:, None] * unit_vectors(new)) @ turn @ R)
    return turned[0], turned[1]


def _angle_about(axis: Float64Array, start: Float64Array, end: Float64Array) -> Float64Array:
    """Return the angles (T,), −π to π, by which directions (T, 3) turn about an axis (T, 3) to
    others.
    """
    axis = unit_vectors(axis)
    across = np.cross(axis, start)
    sine = (across * end).sum(axis=1)
    cosine = (np.cross(across, axis) * end).sum(axis=1)
    return np.arctan2(sine, cosine)


def _twists(rotations: Float64Array, bone: Float64Array) -> Float64Array:
    """Return the angles (T,), 0 to π, by which rotations (T, 3, 3) twist about a bone (3,) at
    rest.
    """
    swing = shortest_turn(
        np.broadcast_to(bone, (len(rotations), 3)), (rotations @ bone[:, None])[..., 0]
    )
    twist: Float64Array = log(transposed(swing) @ rotations)
    return np.linalg.norm(twist, axis=-1)


def _blend_ends(clip: Clip, span: IndexArray, joints: IndexArray) -> None:
    """Blend the joints of a span of keys into those before and after it."""
    times = clip.times
    inside_s = min(_BLEND_S, 0.25 * float(times[span[-1]] - times[span[0]]))
    ends = (
        (times[span[0]] - _BLEND_S, times[span[0]] + inside_s),
        (times[span[-1]] - inside_s, times[span[-1]] + _BLEND_S),
    )
    blended = clip.copy()
    for begin, end in ends:
        window = np.flatnonzero((times > begin + 1e-6) & (times < end - 1e-6))
        window = window[(window > 0) & (window < len(clip) - 1)]
        is_beside = len(window) and (window[0] < span[0] or window[-1] > span[-1])
        if is_beside:
            smooth = interpolate(clip, times[window[0]], times[window[-1]])
            blended.rotations[np.ix_(window, joints)] = smooth.rotations[np.ix_(window, joints)]
    clip.rotations[:] = blended.rotations
