# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions on the bones that move a face: which maps are built in, and what a map makes of
weights.

Each control is moved and turned along the axes of the face, from rest, by sums over the expressions
k:

    t = length · Σ_k w_k (left, up, forward)_k        ω = Σ_k w_k (pitch, yaw, roll)_k

with lengths as in `FaceFrame`. With R_0 the control's rest rotation and A the face's axes, its
channels are location R_0ᵀ A t and rotation R_0ᵀ A exp(ω) Aᵀ R_0. A control that an eye looks at is
moved instead of turned, about that eye.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.rotations import exp
from ...expression_names import EXPRESSIONS
from ..expression_map import MOVED, TURNED, ExpressionMap, load_expression_map
from .face_frame import FaceFrame, RestBone, measure_face, pivot

FOLDER = Path(__file__).resolve().parents[3] / "assets" / "face" / "controls"
# The built-in maps, and bones that only the rig of each has.
_RIGS = {
    "rigify": ("jaw_master", "lips.L", "lips.R", "ORG-eye.L"),
    "rigify_skin": ("jaw_master", "lip_end.L.001", "lip_end.R.001", "ORG-eye.L"),
    "mpfb": ("jaw", "levator05.L", "orbicularis03.L", "eye.L"),
}


@dataclass(frozen=True)
class ControlMotion:
    """The channels of one control, T frames; None for those that it does not have."""

    bone: str
    locations: NDArray[np.float64] | None  # (T, 3) in the axes of its location channel
    rotations: NDArray[np.float64] | None  # (T, 3, 3) relative to rest


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
    expression_map: ExpressionMap, weights: NDArray[np.floating[Any]], bones: Mapping[str, RestBone]
) -> list[ControlMotion]:
    """Return the channels of the controls that the map and the rig have.

    :param weights: (T, 52) in the order of `EXPRESSIONS`.
    :param bones: all bones of the rig at rest.
    :raises InputError: the rig's face cannot be measured.
    """
    frame = measure_face(bones)
    place = {name: k for k, name in enumerate(EXPRESSIONS)}
    motions = []
    for bone, channels in expression_map.controls.items():
        if bone not in bones or not any(channels.values()):
            continue
        sums = {
            channel: np.sum(
                [f * weights[:, place[name]].astype(float) for name, f in factors.items()], axis=0
            )
            for channel, factors in channels.items()
            if factors
        }
        motions.append(_motion(bone, sums, frame, bones))
    return motions


def _motion(
    bone: str, sums: dict[str, NDArray[np.float64]], frame: FaceFrame, bones: Mapping[str, RestBone]
) -> ControlMotion:
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
    moves = not sums.keys().isdisjoint(MOVED)
    turns = not sums.keys().isdisjoint(TURNED)
    eye = pivot(bones, bone)
    if eye is not None and turns:
        moved = moved + _around(eye, rest.head, turned, frame)
        moves = True
        turns = False
    location_axes = to_face if rest.local_location else frame.axes
    return ControlMotion(
        bone,
        moved @ location_axes.T if moves else None,
        to_face @ exp(np.radians(turned)) @ to_face.T if turns else None,
    )


def _around(
    eye: NDArray[np.float64],
    target: NDArray[np.float64],
    turned: NDArray[np.float64],
    frame: FaceFrame,
) -> NDArray[np.float64]:
    """Return how far (T, 3), in the face's axes, a target moves so that an eye turns; from where it
    looks at rest.

    :param turned: (T, 3) degrees about left, up and forward.
    """
    seen = frame.axes.T @ (target - eye)
    ahead = seen / max(float(np.linalg.norm(seen)), 1e-12)
    left = np.array([1.0, 0.0, 0.0]) - ahead[0] * ahead
    axes = np.stack([left, np.cross(ahead, left), ahead], axis=1)
    moved: NDArray[np.float64] = exp(np.radians(turned) @ axes.T) @ seen - seen
    return moved


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
