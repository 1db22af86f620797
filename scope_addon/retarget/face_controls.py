# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions on the bones that move a face: which maps are built in, and what a map makes of
weights.

Each control is moved and turned along the axes of the face, from rest, by sums over the expressions
k:

    t = length · Σ_k w_k (left, up, forward)_k        ω = Σ_k w_k (pitch, yaw, roll)_k

with lengths as in `FaceFrame`. With R_0 the control's rest rotation and A the face's axes, its
channels are location R_0ᵀ A t and rotation R_0ᵀ A exp(ω) Aᵀ R_0. A control that an eye looks at is
moved instead of turned, about that eye.

A `FaceFrame` is the face of a rig at rest, in the armature's space. A face that is scaled or turned
therefore moves alike: amounts are shares of its own lengths, along its own axes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from ...solver.errors import InputError
from ...solver.rotations import exp
from ..arrays import Float64Array, FloatArray, unit_vectors
from .expression_map import MOVED, TURNED, ExpressionMap, load_expression_map, weighted_sum
from .rest_pose import BoneMotion

FOLDER = Path(__file__).resolve().parents[2] / "assets" / "face" / "controls"
# The built-in maps, and bones that only the rig of each has.
_RIGS = {
    "rigify": ("jaw_master", "lips.L", "lips.R", "ORG-eye.L"),
    "rigify_skin": ("jaw_master", "lip_end.L.001", "lip_end.R.001", "ORG-eye.L"),
    "mpfb": ("jaw", "levator05.L", "orbicularis03.L", "eye.L"),
}
# Bones at the same place of a face, by rig: Rigify's older face, its newer one, MPFB's default rig.
_EYES = (("ORG-eye.L", "ORG-eye.R"), ("eye.L", "eye.R"))
_MOUTH = (("lips.L", "lips.R"), ("lip_end.L.001", "lip_end.R.001"), ("levator05.L", "levator05.R"))
_LIDS = (("lid.T.L.002", "lid.B.L.002"),)
_MIN_LENGTH = 1e-9
# What a control's name begins with, and the length in which it is moved; all others by the width of
# the mouth.
_BY_LIDS = ("lid",)
_BY_EYES = ("brow", "nose", "cheek.T", "oculi", "levator06")


def has_face_controls(bones: Collection[str]) -> bool:
    """Return whether a rig with these bones has a face for which a map is built in."""
    return _rig_of(bones) is not None


def guess_control_map(bones: Collection[str]) -> ExpressionMap:
    """Return the built-in map of the rig with these bones, without controls that it lacks; an empty
    one if none fits.

    :raises InputError: the map's file is damaged.
    """
    rig = _rig_of(bones)
    if rig is None:
        return ExpressionMap({})
    return ExpressionMap(
        {}, {bone: amounts for bone, amounts in built_in(rig).controls.items() if bone in bones}
    )


def control_motions(
    expression_map: ExpressionMap, weights: FloatArray, bones: Mapping[str, RestBone]
) -> list[BoneMotion]:
    """Return the channels of the controls that the map and the rig have.

    :param weights: (T, 52) in the order of `EXPRESSIONS`.
    :param bones: all bones of the rig at rest.
    :raises InputError: the rig's face cannot be measured.
    """
    frame = measure_face(bones)
    motions = []
    for bone, channels in expression_map.controls.items():
        if bone not in bones or not any(channels.values()):
            continue
        sums = {
            channel: weighted_sum(factors, weights)
            for channel, factors in channels.items()
            if factors
        }
        motions.append(_motion(bone, sums, frame, bones))
    return motions


def _motion(
    bone: str, sums: dict[str, Float64Array], frame: FaceFrame, bones: Mapping[str, RestBone]
) -> BoneMotion:
    """Return the channels of one control.

    :param sums: (T,) of each channel of the map.
    """
    rest = bones[bone]
    still = np.zeros(len(next(iter(sums.values()))))
    to_face = rest.rotation.T @ frame.axes
    moved, turned = (
        np.stack([sums.get(name, still) for name in names], axis=1) for names in (MOVED, TURNED)
    )
    moved = moved * frame.length(bone)
    eye = pivot(bones, bone)
    if eye is not None:
        moved = moved + _around(eye, rest.head, turned, frame)
        turned = np.zeros_like(turned)
    location_axes = rest.rotation if rest.location_axes is None else rest.location_axes
    return BoneMotion(
        bone,
        rotations=to_face @ exp(np.radians(turned)) @ to_face.T,
        locations=moved @ frame.axes.T @ location_axes,
    )


def _around(
    eye: Float64Array,
    target: Float64Array,
    turned: Float64Array,
    frame: FaceFrame,
) -> Float64Array:
    """Return how far (T, 3), in the face's axes, a target moves so that an eye turns; from where it
    looks at rest.

    :param turned: (T, 3) degrees about left, up and forward.
    """
    seen = frame.axes.T @ (target - eye)
    ahead = unit_vectors(seen)
    left = np.array([1.0, 0.0, 0.0]) - ahead[0] * ahead
    axes = np.stack([left, np.cross(ahead, left), ahead], axis=1)
    return exp(np.radians(turned) @ axes.T) @ seen - seen


def _rig_of(bones: Collection[str]) -> str | None:
    return next(
        (rig for rig, needed in _RIGS.items() if all(bone in bones for bone in needed)), None
    )


@cache
def built_in(rig: str) -> ExpressionMap:
    """Return a built-in map: ``rigify``, ``rigify_skin`` or ``mpfb``.

    :raises InputError: its file is damaged.
    """
    return load_expression_map(FOLDER / f"{rig}.json")


@dataclass(frozen=True)
class RestBone:
    """A bone at rest, in the armature's space."""

    head: Float64Array  # (3,)
    rotation: Float64Array  # (3, 3) bone to armature
    # (3, 3) axes of its location as columns, in the armature's space; None: its own
    location_axes: Float64Array | None = None


@dataclass(frozen=True)
class FaceFrame:
    """A face at rest. ``axes`` (3, 3) has the directions left, up and forward, of the person, as
    columns.
    """

    axes: Float64Array
    mouth: float  # width, from corner to corner
    eyes: float  # distance between both eyes
    lids: float  # gap between the lids of an eye

    def length(self, control: str) -> float:
        """Return the length of which the amounts of a control are shares."""
        if control.startswith(_BY_LIDS):
            return self.lids
        return self.eyes if control.startswith(_BY_EYES) else self.mouth


def measure_face(bones: Mapping[str, RestBone]) -> FaceFrame:
    """Measure a face by its bones at rest.

    Left points from the right eye to the left one, up from the mouth to the eyes, and forward is
    left × up.

    :raises InputError: a bone of the eyes or the mouth is missing, or they are in one place.
    """
    eye_left, eye_right = _pair(bones, _EYES, "eyes")
    mouth_left, mouth_right = _pair(bones, _MOUTH, "corners of the mouth")
    left, eyes = _direction(eye_left - eye_right)
    up = (eye_left + eye_right - mouth_left - mouth_right) / 2
    up, _ = _direction(up - left * (left @ up))
    _, mouth = _direction(mouth_left - mouth_right)
    lids = next((pair for pair in _LIDS if set(pair) <= bones.keys()), None)
    gap = float(np.linalg.norm(bones[lids[0]].head - bones[lids[1]].head)) if lids else 0.0
    return FaceFrame(np.stack([left, up, np.cross(left, up)], axis=1), mouth, eyes, gap)


def pivot(bones: Mapping[str, RestBone], control: str) -> Float64Array | None:
    """Return the center (3,) of the eye that looks at a control; None for other controls."""
    eye = bones.get(f"ORG-{control}") if control in ("eye.L", "eye.R") else None
    return eye.head if eye else None


def _pair(
    bones: Mapping[str, RestBone], pairs: tuple[tuple[str, str], ...], what: str
) -> tuple[Float64Array, Float64Array]:
    for left, right in pairs:
        if left in bones and right in bones:
            return bones[left].head, bones[right].head
    known = " or ".join(f"'{left}' and '{right}'" for left, right in pairs)
    raise InputError(f"the rig has no bones for the {what} of its face; it needs {known}")


def _direction(along: Float64Array) -> tuple[Float64Array, float]:
    length = float(np.linalg.norm(along))
    if not length > _MIN_LENGTH:
        raise InputError(
            "the bones of the rig's eyes and mouth are in one place; place them in Edit Mode"
        )
    return along / length, length
