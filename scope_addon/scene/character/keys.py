# SPDX-License-Identifier: GPL-3.0-or-later
"""A captured armature's keys as a clip in numpy, and back: what the operators after a capture work on.

The inverse of ``animation.py``: Ω_i = C_iᵀ B_i C_i, R_0 = R_world_model C_0ᵀ B_0 C_0, pelvis = location + h_0, in the
armature's space. The keys are the truth; so undo, and what an animator has changed by hand, count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np

from ....solver.body import Body
from ....solver.rotations import matrix_from_quaternion
from ....solver.rotations import quaternion_from_matrix as quaternions
from ...edit.clip import Clip, band_limited, sample
from ...edit.reduce import angles_between, select_position_keys, select_quaternion_keys
from ...errors import UsageError
from ...kinematics.axes import R_WORLD_MODEL
from ..animation_data.actions import bone_path, fcurves, read_keys, rewrite_keys
from .animation import on_one_hemisphere
from .armature import rest_orientations

ROTATION, LOCATION = "rotation_quaternion", "location"


def read_clip(armature: bpy.types.Object, body: Body, rate: float) -> tuple[Clip, np.ndarray]:
    """The motion that the keys hold, and the scene frames (T,) of its keys.

    Where curves have keys at different frames, every frame that has a key on any of them counts.

    :param rate: scene frames a second.
    :raises UsageError: a bone or its keys are missing.
    """
    curves = _curves(armature, body)
    frames = np.unique(np.concatenate([read_keys(curve)[:, 0] for bone in curves.values() for curve in bone]))
    return read_clip_at(armature, body, rate, frames), frames


def read_clip_at(armature: bpy.types.Object, body: Body, rate: float, frames: np.ndarray) -> Clip:
    """The motion at scene frames (T,), as Blender interpolates it."""
    curves = _curves(armature, body)
    values = {path: np.stack([_values(curve, frames) for curve in bone], axis=1) for path, bone in curves.items()}
    q = np.stack([values[bone_path(name, ROTATION)] for name in body.joint_names], axis=1)
    B = matrix_from_quaternion(q / np.maximum(np.linalg.norm(q, axis=-1, keepdims=True), 1e-9))
    C = _axes(armature, body)
    rotations = np.swapaxes(C, 1, 2) @ B @ C
    rotations[:, 0] = R_WORLD_MODEL @ rotations[:, 0]
    pelvis = values[location_path(body)] + _root_head(armature, body)
    return Clip(frames / rate, rotations, pelvis)


def channels(armature: bpy.types.Object, body: Body, clip: Clip) -> tuple[np.ndarray, np.ndarray]:
    """Blender's values of a clip: quaternions (T, K+1, 4) on one hemisphere, root locations (T, 3)."""
    C = _axes(armature, body)
    rotations = clip.rotations.copy()
    rotations[:, 0] = R_WORLD_MODEL.T @ rotations[:, 0]
    B = C @ rotations @ np.swapaxes(C, 1, 2)
    return on_one_hemisphere(quaternions(B)), clip.root - _root_head(armature, body)


def write_clip(armature: bpy.types.Object, body: Body, clip: Clip, frames: np.ndarray) -> None:
    """Replace the keys of all bones by the clip's, at scene frames (T,); curves, groups and action stay."""
    values = _values_by_path(body, *channels(armature, body, clip))
    for path, bone in _curves(armature, body).items():
        for index, curve in enumerate(bone):
            rewrite_keys(curve, frames, values[path][:, index])


def bake_whole_frames(armature: bpy.types.Object, body: Body, rate: float) -> tuple[int, int]:
    """A key on every whole frame of the scene between the first key and the last; returns keys a curve before, after.

    :param rate: scene frames a second. Detail faster than that is smoothed away first.
    """
    clip, frames = read_clip(armature, body, rate)
    whole = np.arange(math.ceil(frames[0] - 1e-4), math.floor(frames[-1] + 1e-4) + 1, dtype=float)
    if not len(whole):  # all keys lie between two frames
        whole = np.round(frames[:1])
    write_clip(armature, body, sample(band_limited(clip, rate), whole / rate), whole)
    return len(frames), len(whole)


@dataclass(frozen=True)
class Reduction:
    """What ``reduce_keys`` did: numbers of keys, and the largest errors at the frames that had keys."""

    before: int
    after: int
    angle: float  # radians, of any bone against its parent
    joint_m: float  # of any joint in the armature's space


def reduce_keys(
    armature: bpy.types.Object, body: Body, betas: np.ndarray, rate: float, angle: float, distance: float
) -> Reduction:
    """Remove the keys that linear interpolation does not need, each bone by itself.

    :param angle: radians that any bone's rotation may be off by; distance: metres that the pelvis may.
    """
    clip, frames = read_clip(armature, body, rate)
    q, location = channels(armature, body, clip)
    values = _values_by_path(body, q, location)
    before = after = 0
    for path, bone in _curves(armature, body).items():
        before += sum(len(curve.keyframe_points) for curve in bone)
        if path == location_path(body):
            keep = select_position_keys(clip.times, location, distance)
        else:
            keep = select_quaternion_keys(clip.times, values[path], angle)
        for index, curve in enumerate(bone):
            rewrite_keys(curve, frames[keep], values[path][keep, index])
        after += len(keep) * len(bone)
    reduced = read_clip_at(armature, body, rate, frames)
    off = angles_between(channels(armature, body, reduced)[0], q)
    moved = np.linalg.norm(reduced.joints(body, betas) - clip.joints(body, betas), axis=-1)
    return Reduction(before, after, float(off.max()), float(moved.max()))


def location_path(body: Body) -> str:
    """Data path of the root's location."""
    return bone_path(body.joint_names[0], LOCATION)


def _values_by_path(body: Body, q: np.ndarray, location: np.ndarray) -> dict[str, np.ndarray]:
    """What ``channels`` gives, (T, 4) or (T, 3) by data path."""
    rotations = {bone_path(name, ROTATION): q[:, k] for k, name in enumerate(body.joint_names)}
    return rotations | {location_path(body): location}


def _root_head(armature: bpy.types.Object, body: Body) -> np.ndarray:
    """(3,) h_0."""
    return np.array(armature.data.bones[body.joint_names[0]].head_local)


def _curves(armature: bpy.types.Object, body: Body) -> dict[str, list[bpy.types.FCurve]]:
    """Curves by data path, in order of their index: every bone's rotation, and the root's location."""
    wanted = {bone_path(name, ROTATION): 4 for name in body.joint_names} | {location_path(body): 3}
    found: dict[str, dict[int, bpy.types.FCurve]] = {path: {} for path in wanted}
    for curve in fcurves(armature):
        if curve.data_path in found and len(curve.keyframe_points):
            found[curve.data_path][curve.array_index] = curve
    missing = [path for path, count in wanted.items() if len(found[path]) != count]
    animation = armature.animation_data
    if missing and animation is not None and animation.action is None and len(animation.nla_tracks):
        raise UsageError(
            f"'{armature.name}' moves by the NLA track '{animation.nla_tracks[0].name}', not by an action of its own: "
            "enter Tweak Mode on the track's strip (Tab), or choose the action in the Action Editor again"
        )
    if missing:
        raise UsageError(
            f"'{armature.name}' has lost the keys of {missing[0]}; undo what removed them, or capture again"
        )
    return {path: [by_index[i] for i in sorted(by_index)] for path, by_index in found.items()}


def _values(curve: bpy.types.FCurve, frames: np.ndarray) -> np.ndarray:
    """(T,) the curve at frames; read off where its keys are there, which is much faster."""
    keys = read_keys(curve)
    if len(keys) == len(frames) and (keys[:, 0] == frames).all():
        return keys[:, 1].astype(float)
    return np.array([curve.evaluate(frame) for frame in frames])


def _axes(armature: bpy.types.Object, body: Body) -> np.ndarray:
    """(K+1, 3, 3) C_i = M_iᵀ R_world_model."""
    missing = [name for name in body.joint_names if name not in armature.data.bones]
    if missing:
        raise UsageError(f"'{armature.name}' has no bone '{missing[0]}'; choose an armature that Scope has captured")
    return np.swapaxes(rest_orientations(armature, body), 1, 2) @ R_WORLD_MODEL
