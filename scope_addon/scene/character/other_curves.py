# SPDX-License-Identifier: GPL-3.0-or-later
"""The curves that a capture has beside those of the bones' motion: measurements and contact on the
bones, shape and expressions on the body.

A loop cuts them to its cycle, so that the whole action, and a strip of it in the NLA, is as long as
the cycle. Whoever restores the whole motion restores them from the captured one.

The measurements are keys of confidence, standard deviation and contact on the bones, and timeline
markers at review spans. ``confidence`` (0..1) is that of the keypoints in which the bone's rotation
is visible. ``sigma_cm`` is the standard deviation of its joint's position (`docs/motion_file.md`),
where it is known. ``contact`` (0..1) is the probability that the heel (on the ankle's bone) or the
toes (on the foot's) are at rest on the floor; drivers and constraints can use it.
"""

from __future__ import annotations

import numpy as np
from bpy.types import FCurve, Object, Scene

from ....solver.body import Body
from ...arrays import BoolArray, Float64Array
from ...edit.corrected_motion import corrections_of
from ...edit.corrections import Exchange
from ...edit.spans import joints_of_limbs
from ...kinematics.mirrored_limbs import other_side
from ...motion import Motion
from ...notices import REASONS
from ...review_spans import find_review_spans
from ..actions import (
    Channels,
    bone_property_path,
    change_keys,
    fcurves,
    read_keys,
    rewrite_keys,
    shape_key_path,
    values_between_keys,
)
from ..datablocks import shape_keys_of
from ..stored_values import in_scene
from .body_mesh import shape_key_name
from .keys import channel_curves

_CONSTANT = "CONSTANT"
CONFIDENCE = "confidence"
CONTACT = "contact"
SIGMA = "sigma_cm"
# The bones that carry the columns of ``Motion.foot_contact``.
CONTACT_BONES = ("left_ankle", "left_foot", "right_ankle", "right_foot")
_DESCRIPTIONS = {
    CONFIDENCE: "Confidence of the keypoints that show how this bone is turned",
    SIGMA: "Standard deviation of the position of this bone's joint, in centimetres",
    CONTACT: "Probability that this end of the foot rests on the floor",
}
MARKER_NAMES = {
    "unseen": "not seen",
    "far": "check",
    "unsure": "unsure",
    "floor": "under floor",
    "swing": "limb swings",
    "lean": "leans",
    "floating": "floats",
    "leap": "leaps",
    "spin": "spins",
    "snap": "limb snaps",
}
_MAX_MARKERS = 40  # more would clutter the timeline
_GAP_S = 0.5  # spans closer than this share a marker


def cut_to_cycle(armature: Object, body: Body, first: float, last: float) -> None:
    """Cut the curves to scene frames, with a key at both ends; a curve of one key has it at the
    first.
    """
    moving = {(curve.data_path, curve.array_index) for curve in channel_curves(armature, body)}
    for curve in _curves(armature):
        if (curve.data_path, curve.array_index) in moving or not len(curve.keyframe_points):
            continue
        frames, values = read_keys(curve).T.astype(float)
        interpolation = curve.keyframe_points[0].interpolation
        is_constant = len(frames) == 1 or interpolation == _CONSTANT
        inside = (frames > first) & (frames < last)
        at = np.array([first]) if len(frames) == 1 else np.r_[first, frames[inside], last]
        kept = values_between_keys(curve, at)
        rewrite_keys(curve, at, kept, _CONSTANT if is_constant else "LINEAR")


def restore_whole_motion(
    armature: Object, body: Body, motion: Motion, frames: Float64Array
) -> None:
    """Give the curves the keys of the whole captured motion again, at scene frames (T,).

    Curves that the user has removed stay removed.
    """
    values = {
        bone_property_path(*names): column
        for names, column in measurements_of(body, motion).items()
    }
    if motion.face:
        names = motion.face["expression_names"].tolist()
        weights = motion.face["expressions"].astype(float)
        values |= {shape_key_path(name): weights[:, k] for k, name in enumerate(names)}
    shape = {
        shape_key_path(shape_key_name(p)): np.full(len(frames), beta)
        for p, beta in enumerate(motion.betas)
    }
    for curve in _curves(armature):
        is_shape = curve.data_path in shape
        column = shape.get(curve.data_path, values.get(curve.data_path))
        if column is None:
            continue
        known = np.isfinite(column)
        if len(curve.keyframe_points) == 1:  # it never changes
            known &= np.arange(len(column)) == np.flatnonzero(known)[0]
        interpolation = _CONSTANT if is_shape or known.sum() == 1 else "LINEAR"
        rewrite_keys(curve, frames[known], np.asarray(column)[known], interpolation)


def _curves(armature: Object) -> list[FCurve]:
    """Return the curves of an armature and of its meshes' shape keys that this file may change."""
    blocks = [armature, *shape_keys_of(armature)]
    return [curve for block in blocks if block.library is None for curve in fcurves(block)]


def key_measurements(
    armature: Object, channels: Channels, body: Body, motion: Motion, frames: Float64Array
) -> None:
    """Key confidence, standard deviation and contact as custom properties of the bones, at scene
    frames (T,).

    The curves are hidden in the graph editor, where they would obscure those of the rotations.
    """
    for (bone_name, name), values in measurements_of(body, motion).items():
        # deviations are unknown in frames that are filled in, and in some motions
        known = np.isfinite(values)
        if not known.any():
            continue
        bone = armature.pose.bones[bone_name]
        most = 1000.0 if name == SIGMA else 1.0
        bone[name] = float(values[known][0])
        bone.id_properties_ui(name).update(
            min=0.0, max=most, soft_min=0.0, soft_max=most, description=_DESCRIPTIONS[name]
        )
        for curve in channels.write(
            bone_property_path(bone_name, name), frames[known], values[known], group=name.title()
        ):
            curve.hide = True


def measurements_of(body: Body, motion: Motion) -> dict[tuple[str, str], Float64Array]:
    """Return the values (T,) by bone and property, with the sides exchanged as the corrections say;
    NaN where one is not known.
    """
    columns = {
        (name, CONFIDENCE): motion.joint_confidence[:, i] for i, name in enumerate(body.joint_names)
    }
    columns |= {
        (name, CONTACT): motion.foot_contact[:, i]
        for i, name in enumerate(CONTACT_BONES)
        if name in body.joint_names
    }
    sigma_cm = 100.0 * np.asarray(motion.joint_sigma_m, float)
    columns |= {(name, SIGMA): sigma_cm[:, i] for i, name in enumerate(body.joint_names)}
    for exchange in corrections_of(motion):
        if isinstance(exchange, Exchange):
            rows = (motion.frames >= exchange.first) & (motion.frames <= exchange.last)
            limbs = {body.joint_names[k] for k in joints_of_limbs(body, exchange.limbs)}
            others = {
                (name, what): columns[other_side(name), what]
                for name, what in columns
                if name in limbs
            }
            columns |= {
                names: np.where(rows, other, columns[names]) for names, other in others.items()
            }
    return columns


def exchange_measurements(
    armature: Object, body: Body, before: Motion, after: Motion, frames: Float64Array
) -> None:
    """Change the keys of measurements where another correction exchanges left and right, so that
    the foot that rests in the user's eyes has the contact.

    :param after: the same motion as ``before`` with other corrections.
    :param frames: (T,) scene frames of its rows.
    """
    was = measurements_of(body, before)
    now = measurements_of(body, after)
    changed = {
        bone_property_path(*names): names
        for names in now
        if not np.array_equal(was[names], now[names], equal_nan=True)
        and np.isfinite(was[names]).any()
        and np.isfinite(now[names]).any()
    }
    for curve in _curves(armature) if changed else ():
        names = changed.get(curve.data_path)
        if names is None:
            continue
        at = read_keys(curve)[:, 0].astype(float)
        old = _known_values_at(at, frames, was[names])
        new = _known_values_at(at, frames, now[names])
        change_keys(curve, at[old != new], new[old != new])


def _known_values_at(at: Float64Array, frames: Float64Array, values: Float64Array) -> Float64Array:
    """Return values (T,) at frames (T,) between those that are known, at frames (n,)."""
    known = np.isfinite(values)
    return np.interp(at, frames[known], values[known])


def add_review_markers(
    scene: Scene,
    prefix: str,
    motion: Motion,
    frames: Float64Array,
    under_floor: BoolArray,
) -> list[str]:
    """Add a timeline marker at the start of each review span; return the names of the new ones.

    If there are too many spans, the longest get a marker. Its name states the reason: "not seen
    12-18".

    :param prefix: of the marker's name, to distinguish several people.
    :param frames: (T,) scene frame of each pose.
    :param under_floor: (T,) poses with a foot under the floor.
    """
    spans = sorted(
        find_review_spans(motion, _GAP_S, under_floor), key=lambda span: span.first - span.last
    )[:_MAX_MARKERS]
    names = []
    there = {(marker.name, marker.frame) for marker in scene.timeline_markers}
    for span in sorted(spans, key=lambda span: span.first):
        at = in_scene(span, frames)
        name = f"{prefix}{MARKER_NAMES[span.reason]} {at}"
        if (name, at.first) not in there:
            scene.timeline_markers.new(name, frame=at.first)
            names.append(name)
    return names


assert MARKER_NAMES.keys() == REASONS.keys()
