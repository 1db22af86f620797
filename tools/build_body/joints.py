# SPDX-License-Identifier: GPL-3.0-or-later
"""The two skeletons, SMPL's 24 joints and SMPL+H's 52, and their joints as linear functions of the
vertices.

J = A V with A (K+1, N), whose rows sum to one, so that joints follow every shape exactly.

MakeHuman's cubes are places that look right when a joint bends, not centres of joints: its hips lie
4 cm behind those that Harrington et al. (J. Biomechanics 40, 2007) find from the pelvis's bony
landmarks, so that a person who stands upright has bent knees and leans forward. `CENTRES` moves
hips and shoulders to where anatomy has them:

    J = J_cube + a f + b u + c l,
    f = mean of both feet's (ball − ankle), u = neck − pelvis, l = left hip − right hip

with the cubes' own f, u and l. They measure the skeleton, which fat does not change, and are linear
in the vertices.

In the mean body (stature 1.69 m, standing), hips lie 4.8 cm behind and 9 cm below the front spines
of the pelvis, 19.6 cm apart (Harrington: 4.5, 8.3, and 17 to 18; models of people: 19 to 21), and
shoulders 3 cm below the acromion's skin, 0.812 of the stature high (surveys: 0.812, de Leva:
0.827).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.names import BODY_JOINTS, BODY_PARENTS
from .source import SourceMesh

# SMPL+H's order -> MakeHuman's number
FINGERS = {"index": 2, "middle": 3, "pinky": 5, "ring": 4, "thumb": 1}
# place of each joint between pelvis and neck
SPINE = {"spine1": 0.27, "spine2": 0.41, "spine3": 0.675}
SPINE_CENTRE = 0.4517  # place of the mean of the three spine cubes between pelvis and neck
CUBES = {
    "pelvis": "pelvis", "hip": "upper-leg", "knee": "knee", "ankle": "ankle", "foot": "foot-1",
    "neck": "neck",
    "head": "head", "collar": "clavicle", "shoulder": "shoulder", "elbow": "elbow", "wrist": "hand",
}  # fmt: skip

# Joint -> (a, b, c), the shares of forward, up and to the left by which its centre is displaced
# from its cube.
CENTRES = {
    "hip": (0.357, 0.035, -0.041),
    "shoulder": (-0.095, 0.033, 0.019),
}


@dataclass(frozen=True)
class Skeleton:
    """Names and parents of K+1 joints, and the regressor A (K+1, N) that places them."""

    name: str
    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    regressor: NDArray[np.float64]

    def index(self, joint: str) -> int:
        """Return the index of a joint by its name."""
        return self.joint_names.index(joint)

    @property
    def mirror(self) -> NDArray[np.intp]:
        """Return (K+1,) the index of the joint on the other side."""
        return np.array([self.index(other_side(name)) for name in self.joint_names])


def other_side(name: str) -> str:
    """Return the name with left and right swapped."""
    if "left" in name:
        return name.replace("left", "right")
    return name.replace("right", "left")


def make_skeleton(source: SourceMesh, with_hands: bool) -> Skeleton:
    """Return SMPL's topology (24 joints), or SMPL+H's (52) ``with_hands``."""
    names = list(BODY_JOINTS)
    parents = list(BODY_PARENTS)
    for side in ("left", "right"):
        wrist = names.index(f"{side}_wrist")
        if not with_hands:
            names.append(f"{side}_hand")
            parents.append(wrist)
            continue
        for finger in FINGERS:
            for i in (1, 2, 3):
                parents.append(wrist if i == 1 else len(names) - 1)
                names.append(f"{side}_{finger}{i}")
    regressor = np.stack([_joint_row(source, name) for name in names])
    return Skeleton("scope_h" if with_hands else "scope", tuple(names), tuple(parents), regressor)


def cube_row(source: SourceMesh, *cubes: str) -> NDArray[np.float64]:
    """Return the regressor (N,) of the mean of the named joint cubes."""
    row = np.zeros(len(source.vertices))
    for cube in cubes:
        row[source.cubes[cube]] += 1.0 / (len(source.cubes[cube]) * len(cubes))
    return row


def _joint_row(source: SourceMesh, name: str) -> NDArray[np.float64]:
    if name in SPINE:
        # The three spine cubes move inconsistently between the targets: only their mean is used.
        pelvis = cube_row(source, "pelvis")
        neck = cube_row(source, "neck")
        centre = cube_row(source, "spine-1", "spine-2", "spine-3")
        return centre + (SPINE[name] - SPINE_CENTRE) * (neck - pelvis)
    side, _, joint = name.rpartition("_")
    prefix = f"{side[0]}-" if side else ""
    if joint in CUBES:
        return cube_row(source, prefix + CUBES[joint]) + _displacement(source, joint, side)
    if joint == "hand":
        return cube_row(source, *(f"{prefix}finger-{k}-1" for k in (2, 3, 4, 5)))
    return cube_row(source, f"{prefix}finger-{FINGERS[joint[:-1]]}-{joint[-1]}")


def _displacement(source: SourceMesh, joint: str, side: str) -> NDArray[np.float64]:
    """Return the row (N,), of sum zero, of the vector from a joint's cube to its centre."""
    forward, up, left = CENTRES.get(joint, (0.0, 0.0, 0.0))
    outwards = -left if side == "right" else left
    feet = cube_row(source, "l-foot-1", "r-foot-1") - cube_row(source, "l-ankle", "r-ankle")
    spine = cube_row(source, "neck") - cube_row(source, "pelvis")
    hips = cube_row(source, "l-upper-leg") - cube_row(source, "r-upper-leg")
    return forward * feet + up * spine + outwards * hips
