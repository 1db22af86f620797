# SPDX-License-Identifier: GPL-3.0-or-later
"""A flared skirt and an open coat around the body at rest, and what says how fat a body is: girths
and mass.

A garment is a surface of elliptic arcs about the vertical axis of the trunk, rigid to the pelvis.
Each arc is as wide as the trunk at the hips or the waist, whichever is nearer to its height, and
farther out by a distance that grows towards the hem. Around standing legs it stays where it would
hang; knees that are raised pass through it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...solver import Body
from .people import DENSITY, Points

COLUMNS = 48
ROWS = 12
BAND_M = 0.015  # half of the height of the slice of skin whose girth is measured
# left out of the trunk
LIMBS = ("shoulder", "elbow", "wrist", "hand", "thumb", "index", "middle", "ring", "pinky")
COAT_OPEN_DEG = 60.0  # to either side of the front
# off the body at the upper edge and at the hem
SKIRT_M = (0.01, 0.15)
COAT_M = (0.03, 0.12)


@dataclass(frozen=True)
class Garment:
    """A surface at rest: points (n, 3), metres, in the axes of the rest pose, and triangles (m,
    3).
    """

    points: Points
    triangles: NDArray[np.int32]

    def placed(self, body: Body, betas: Points, R_pelvis: Points, t_pelvis: Points) -> Points:
        """Return the points (n, 3) where the pelvis has this pose."""
        points: Points = (self.points - body.rest_joints(betas)[0]) @ R_pelvis.T + t_pelvis
        return points


def skirt(body: Body, betas: Points, off_m: tuple[float, float] = SKIRT_M) -> Garment:
    """Return a skirt from the waist to the knees.

    :param off_m: how far it stands off the body at the waist and at the hem, metres.
    """
    return _around(body, betas, _waist(body, betas), 0.0, off_m)


def coat(body: Body, betas: Points, off_m: tuple[float, float] = COAT_M) -> Garment:
    """Return a coat that is open in front, from the collar bones to the knees.

    :param off_m: how far it stands off the body at the shoulders and at the hem, metres.
    """
    top = body.rest_joints(betas)[body.joint_names.index("left_collar"), 1]
    return _around(body, betas, float(top), np.radians(COAT_OPEN_DEG), off_m)


def girths_m(body: Body, betas: Points) -> tuple[float, float]:
    """Return the girths of waist and hips, metres: of the hull of a slice of the trunk at rest."""
    found = []
    for height in (_waist(body, betas), _hips(body, betas)):
        hull = cv2.convexHull(_slice(body, betas, height).astype(np.float32))[:, 0]
        found.append(float(np.linalg.norm(hull - np.roll(hull, 1, axis=0), axis=1).sum()))
    return found[0], found[1]


def mass_kg(body: Body, betas: Points) -> float:
    """Return the mass of a body of this shape, of the skin's volume."""
    a, b, c = np.moveaxis(body.rest_vertices(betas)[body.triangles()], 1, 0)
    return DENSITY * abs(float(np.einsum("fi,fi->", a, np.cross(b, c)))) / 6.0


def _around(
    body: Body, betas: Points, top: float, opening: float, off_m: tuple[float, float]
) -> Garment:
    """Return a surface from a height down to the knees, open by an angle to either side of the
    front.
    """
    knees = body.rest_joints(betas)[
        [body.joint_names.index(f"{side}_knee") for side in ("left", "right")], 1
    ].mean()
    waist = _waist(body, betas)
    hips = _hips(body, betas)
    angles = np.linspace(opening, 2 * np.pi - opening, COLUMNS)  # from the front, which is z
    rows = []
    for share in np.linspace(0.0, 1.0, ROWS):
        height = top + share * (float(knees) - top)
        level = _slice(body, betas, float(np.clip(height, hips, max(waist, top - 0.1))))
        low = level.min(axis=0)
        high = level.max(axis=0)
        radius = (high - low) / 2 + off_m[0] + share * (off_m[1] - off_m[0])
        middle = (high + low) / 2
        x = middle[0] + radius[0] * np.sin(angles)
        z = middle[1] + radius[1] * np.cos(angles)
        rows.append(np.column_stack([x, np.full(COLUMNS, height), z]))
    first = (np.arange(ROWS - 1)[:, None] * COLUMNS + np.arange(COLUMNS - 1)).ravel()
    corners = [first, first + 1, first + COLUMNS], [first + 1, first + COLUMNS + 1, first + COLUMNS]
    return Garment(
        np.concatenate(rows), np.concatenate([np.column_stack(c) for c in corners]).astype(np.int32)
    )


def _waist(body: Body, betas: Points) -> float:
    joints = body.rest_joints(betas)
    names = body.joint_names
    return float(joints[names.index("spine1"), 1])


def _hips(body: Body, betas: Points) -> float:
    joints = body.rest_joints(betas)
    names = body.joint_names
    return float(joints[[names.index("left_hip"), names.index("right_hip")], 1].mean())


def _slice(body: Body, betas: Points, height: float) -> NDArray[Any]:
    """Return x and z (n, 2) of the skin at a height, without the arms, metres."""
    part = body.strongest_joints
    trunk = np.array([not any(limb in name for limb in LIMBS) for name in body.joint_names])[part]
    skin = body.rest_vertices(betas)
    near: NDArray[Any] = skin[trunk & (np.abs(skin[:, 1] - height) < BAND_M)][:, [0, 2]]
    return near
