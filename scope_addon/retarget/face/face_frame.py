# SPDX-License-Identifier: GPL-3.0-or-later
"""The face of a rig at rest: its axes, and the lengths in which its controls are moved. In the
armature's space.

A face that is scaled or turned therefore moves alike: amounts are shares of its own lengths, along
its own axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....solver.errors import InputError

# Bones at the same place of a face, by rig: Rigify's older face, its newer one, MPFB's default rig.
_EYES = (("ORG-eye.L", "ORG-eye.R"), ("eye.L", "eye.R"))
_MOUTH = (("lips.L", "lips.R"), ("lip_end.L.001", "lip_end.R.001"), ("levator05.L", "levator05.R"))
_LIDS = (("lid.T.L.002", "lid.B.L.002"),)
_MIN_LENGTH = 1e-9
# What a control's name begins with, and the length in which it is moved; all others by the width of
# the mouth.
_BY_LIDS = ("lid",)
_BY_EYES = ("brow", "nose", "cheek.T", "oculi", "levator06")


@dataclass(frozen=True)
class RestBone:
    """A bone at rest, in the armature's space."""

    head: NDArray[np.float64]  # (3,)
    rotation: NDArray[np.float64]  # (3, 3) bone to armature
    local_location: bool = True  # whether its location is in its own axes, not the armature's


@dataclass(frozen=True)
class FaceFrame:
    """A face at rest. ``axes`` (3, 3) has the directions left, up and forward, of the person, as
    columns.
    """

    axes: NDArray[np.float64]
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


def pivot(bones: Mapping[str, RestBone], control: str) -> NDArray[np.float64] | None:
    """Return the center (3,) of the eye that looks at a control; None for other controls."""
    eye = bones.get(f"ORG-{control}") if control in ("eye.L", "eye.R") else None
    return eye.head if eye else None


def _pair(
    bones: Mapping[str, RestBone], pairs: tuple[tuple[str, str], ...], what: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    for left, right in pairs:
        if left in bones and right in bones:
            return bones[left].head, bones[right].head
    known = " or ".join(f"'{left}' and '{right}'" for left, right in pairs)
    raise InputError(f"the rig has no bones for the {what} of its face; it needs {known}")


def _direction(along: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    length = float(np.linalg.norm(along))
    if not length > _MIN_LENGTH:
        raise InputError(
            "the bones of the rig's eyes and mouth are in one place; place them in Edit Mode"
        )
    return along / length, length
