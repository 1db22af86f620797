# SPDX-License-Identifier: GPL-3.0-or-later
"""Converting a captured armature's keys to a clip in numpy and back, for editing, and removing keys
that the interpolation between the others does not need.

The inverse of ``animation.py``: Ω_i = C_iᵀ B_i C_i, R_0 = R_world_model C_0ᵀ B_0 C_0, pelvis =
location + h_0, in the armature's space. The keys are the only source, so undo and manual changes
are respected.

Blender interpolates the four components of a quaternion linearly and normalizes; the error bound of
a reduction holds for exactly that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from bpy.types import FCurve, Object

from ....solver.body import Body
from ....solver.rotations import matrix_from_quaternion
from ...arrays import BoolArray, Float64Array, FloatArray, IndexArray
from ...edit.clip import Clip, band_limited, sample
from ...errors import UsageError
from ...kinematics.axes import R_WORLD_MODEL, transposed
from ...kinematics.smoothing import continuous_quaternions
from ..actions import (
    bone_path,
    change_keys,
    check_not_in_nla,
    check_not_moved_by_nla,
    fcurves,
    read_keys,
    rewrite_keys,
    values_between_keys,
)
from ..timing import whole_frames_of
from .armature import rest_orientations

ROTATION = "rotation_quaternion"
LOCATION = "location"


def read_clip(armature: Object, body: Body, rate: float) -> tuple[Clip, Float64Array]:
    """Read the motion from the keys.

    If curves have keys at different frames, every frame with a key on any curve is included.

    :param rate: scene frames per second.
    :return: the motion, and the scene frames (T,) of its keys.
    :raises UsageError: when a bone or its keys are missing.
    """
    curves = _curves(armature, body)
    frames = np.unique(
        np.concatenate([read_keys(curve)[:, 0] for bone in curves.values() for curve in bone])
    )
    return read_clip_at(armature, body, rate, frames), frames


def read_clip_at(armature: Object, body: Body, rate: float, frames: Float64Array) -> Clip:
    """Read the motion at scene frames (T,), as interpolated by Blender.

    :param rate: scene frames per second.
    :raises UsageError: when a bone or its keys are missing.
    """
    curves = _curves(armature, body)
    values = {
        path: np.stack([_values(curve, frames) for curve in bone], axis=1)
        for path, bone in curves.items()
    }
    q = np.stack([values[bone_path(name, ROTATION)] for name in body.joint_names], axis=1)
    B = matrix_from_quaternion(q / np.maximum(np.linalg.norm(q, axis=-1, keepdims=True), 1e-9))
    C = _axes(armature, body)
    rotations = transposed(C) @ B @ C
    rotations[:, 0] = R_WORLD_MODEL @ rotations[:, 0]
    pelvis = values[location_path(body)] + _root_head(armature, body)
    return Clip(frames / rate, rotations, pelvis)


def channel_values(armature: Object, body: Body, clip: Clip) -> tuple[Float64Array, Float64Array]:
    """Compute Blender's channels of a clip.

    :return: quaternions (T, K+1, 4) on one hemisphere; root locations (T, 3) in the armature's
        space.
    """
    C = _axes(armature, body)
    rotations = clip.rotations.copy()
    rotations[:, 0] = R_WORLD_MODEL.T @ rotations[:, 0]
    B = C @ rotations @ transposed(C)
    return continuous_quaternions(B), clip.root - _root_head(armature, body)


def write_clip(armature: Object, body: Body, clip: Clip, frames: Float64Array) -> None:
    """Replace the keys of all bones by the clip's, at scene frames (T,); curves, groups and action
    are kept.

    :raises UsageError: when a bone or its keys are missing.
    """
    curves = _curves(armature, body)
    values = _values_by_path(body, *channel_values(armature, body, clip))
    for path, bone in curves.items():
        for index, curve in enumerate(bone):
            rewrite_keys(curve, frames, values[path][:, index])


def write_keys(
    armature: Object, body: Body, clip: Clip, frames: Float64Array, which: BoolArray
) -> None:
    """Replace only some keys by the clip's; a curve that has no key at one of these frames gets
    one.

    :param frames: (T,) scene frames of the clip's keys.
    :param which: (T,) the keys to write.
    :raises UsageError: when a bone or its keys are missing.
    """
    curves = _curves(armature, body)
    values = _values_by_path(body, *channel_values(armature, body, clip))
    for path, bone in curves.items():
        new = values[path]
        # the sign of the quaternion that is there, since the keys around it stay
        if len(bone) == 4:
            old = np.stack([_values(curve, frames) for curve in bone], axis=1)
            new = new * np.where((new * old).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
        for index, curve in enumerate(bone):
            change_keys(curve, frames[which], new[which, index])


def bake_whole_frames(armature: Object, body: Body, rate: float) -> tuple[int, int]:
    """Replace the keys by one on every whole frame of the scene, with a low-pass filter against
    aliasing.

    :param rate: scene frames per second.
    :return: the number of keys per curve before and after.
    :raises UsageError: when a bone or its keys are missing.
    """
    clip, frames = read_clip(armature, body, rate)
    whole = whole_frames_of(frames)
    write_clip(armature, body, sample(band_limited(clip, rate), whole / rate), whole)
    return len(frames), len(whole)


@dataclass(frozen=True)
class Reduction:
    """The result of ``reduce_keys``: numbers of keys, and the largest errors at the frames of the
    former keys.
    """

    before: int
    after: int
    angle: float  # radians, of any bone relative to its parent
    pelvis_m: float  # metres, of the pelvis in the armature's space
    joint_m: float  # metres, of any joint there: where the errors of the bones above it add up


def reduce_keys(
    armature: Object, body: Body, betas: FloatArray, rate: float, angle: float, distance: float
) -> Reduction:
    """Remove the keys that linear interpolation does not need, separately for each bone.

    :param betas: (P,) shape coefficients, for measuring the error of joints.
    :param rate: scene frames per second.
    :param angle: maximum error of any bone's rotation, radians.
    :param distance: maximum error of the pelvis's position, metres.
    :raises UsageError: when a bone or its keys are missing.
    """
    clip, frames = read_clip(armature, body, rate)
    q, location = channel_values(armature, body, clip)
    values = _values_by_path(body, q, location)
    before = after = 0
    for path, bone in _curves(armature, body).items():
        before += sum(len(curve.keyframe_points) for curve in bone)
        if path == location_path(body):
            keep = _kept_keys(clip.times, location, _distances, distance)
        else:
            keep = _kept_keys(clip.times, values[path], angles_between, angle)
        for index, curve in enumerate(bone):
            rewrite_keys(curve, frames[keep], values[path][keep, index])
        after += len(keep) * len(bone)
    reduced = read_clip_at(armature, body, rate, frames)
    off = angles_between(channel_values(armature, body, reduced)[0], q)
    moved = np.linalg.norm(reduced.joints(body, betas) - clip.joints(body, betas), axis=-1)
    pelvis_m = float(moved[:, 0].max())
    return Reduction(before, after, float(off.max()), pelvis_m, float(moved.max()))


def channel_curves(armature: Object, body: Body) -> list[FCurve]:
    """Return the curves of all bones' rotations and of the root's location, always in the same
    order.

    :raises UsageError: when a bone or its keys are missing.
    """
    return [curve for bone in _curves(armature, body).values() for curve in bone]


def location_path(body: Body) -> str:
    """Return the data path of the root's location."""
    return bone_path(body.joint_names[0], LOCATION)


def _values_by_path(body: Body, q: Float64Array, location: Float64Array) -> dict[str, Float64Array]:
    """Return the values of ``channel_values`` by data path, (T, 4) or (T, 3)."""
    rotations = {bone_path(name, ROTATION): q[:, k] for k, name in enumerate(body.joint_names)}
    return rotations | {location_path(body): location}


def _root_head(armature: Object, body: Body) -> Float64Array:
    """Return h_0 (3,)."""
    return np.array(armature.data.bones[body.joint_names[0]].head_local)


def _curves(armature: Object, body: Body) -> dict[str, list[FCurve]]:
    """Return the curves of every bone's rotation and the root's location by data path, in the order
    of their index.
    """
    _check_bones(armature, body)
    check_not_moved_by_nla(armature)
    wanted = {bone_path(name, ROTATION): 4 for name in body.joint_names} | {location_path(body): 3}
    found: dict[str, dict[int, FCurve]] = {path: {} for path in wanted}
    for curve in fcurves(armature):
        if curve.data_path in found and len(curve.keyframe_points):
            found[curve.data_path][curve.array_index] = curve
    missing = [path for path, count in wanted.items() if len(found[path]) != count]
    if missing:
        check_not_in_nla(armature)
        raise UsageError(
            f"'{armature.name}' has lost the keys of {missing[0]}; undo their "
            "removal, or capture again"
        )
    return {path: [by_index[i] for i in sorted(by_index)] for path, by_index in found.items()}


def _values(curve: FCurve, frames: Float64Array) -> Float64Array:
    """Evaluate the curve's keys at frames (T,); if these are theirs, read them, which is much
    faster.
    """
    keys = read_keys(curve)
    if len(keys) == len(frames) and (keys[:, 0] == frames).all():
        return keys[:, 1].astype(float)
    return values_between_keys(curve, frames)


def _check_bones(armature: Object, body: Body) -> None:
    """Check that an armature has the body's bones, and that the keys that a capture has written
    rotate them.

    :raises UsageError: a bone was renamed or removed, or has another rotation mode.
    """
    for name in body.joint_names:
        if name not in armature.pose.bones:
            raise UsageError(
                f"'{armature.name}' has no bone '{name}'; if you have renamed it, give it this "
                "name again, or choose "
                "another armature that Scope captured"
            )
        mode = armature.pose.bones[name].rotation_mode
        if mode != "QUATERNION":
            raise UsageError(
                f"'{name}' of '{armature.name}' has the rotation mode {mode}, in which its "
                "captured keys have no "
                "effect; change it back to Quaternion (WXYZ), and its keys too if you have "
                "converted them"
            )


def _axes(armature: Object, body: Body) -> Float64Array:
    """Return C_i = M_iᵀ R_world_model (K+1, 3, 3)."""
    return transposed(rest_orientations(armature, body)) @ R_WORLD_MODEL


def _kept_keys(
    times: Float64Array,
    values: Float64Array,
    errors: Callable[[Float64Array, Float64Array], Float64Array],
    bound: float,
) -> IndexArray:
    """Return the indices of keys between which all others are interpolated within an error bound.

    A span is split at its worst key while the error exceeds the bound (Ramer, Douglas and Peucker).

    :param times: (T,) seconds.
    :param values: (T, n); quaternions are all on one hemisphere.
    :param errors: of N interpolated values (N, n) and the keys' own, (N,) in the unit of ``bound``.
    """
    keep = np.zeros(len(times), bool)
    keep[[0, -1]] = True
    spans = [(0, len(times) - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        inside = slice(a + 1, b)
        share = ((times[inside] - times[a]) / (times[b] - times[a]))[:, None]
        off = errors(values[a] + share * (values[b] - values[a]), values[inside])
        worst = int(off.argmax())
        if off[worst] > bound:
            middle = a + 1 + worst
            keep[middle] = True
            spans += [(a, middle), (middle, b)]
    return np.flatnonzero(keep)


def _distances(p: Float64Array, wanted: Float64Array) -> Float64Array:
    """Return the distances (N,) between positions (N, 3)."""
    return np.linalg.norm(p - wanted, axis=1)


def angles_between(q: Float64Array, wanted: Float64Array) -> Float64Array:
    """Return the angles between rotations, by the sine of a quarter of each: accurate for small
    angles.

    :param q: (..., 4) quaternions of any length.
    :param wanted: (..., 4) unit quaternions.
    :return: (...) radians.
    """
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    chord = np.minimum(np.linalg.norm(q - wanted, axis=-1), np.linalg.norm(q + wanted, axis=-1))
    return 4.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))
