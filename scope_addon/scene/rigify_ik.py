# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys for the IK controls of a generated Rigify rig, so that its IK limbs show the same pose as
its FK limbs.

Every control of the IK layer gets the transform of its FK counterpart. Blender's IK solver starts
from the keyed pose of the chain, and stretches the chain's bones where it has to move them. The
middle bone, which is no control, is keyed as well: the chain then begins at its goal and stays as
it is. That bone is a hinge about its X axis, so the base is rolled to put both bones of the limb
into the hinge's plane. The pole target lies where the solver does not turn it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np
from bpy.types import Object
from mathutils import Matrix

from ..arrays import unit_vectors
from ..retarget.rest_pose import BoneMotion
from .rig_probe import basis_of

# Limb, middle bone, end and, of legs, toe.
_LIMBS = (("thigh", "shin", "foot", "toe"), ("upper_arm", "forearm", "hand", ""))
# Sine of the bend below which a limb counts as straight: the degree or two that people's legs are
# bent sideways, and noise, would determine the roll of its base. Such a limb hardly rolls, and
# Blender's solver moves its middle joint by up to a centimetre.
_MIN_BEND = 0.1


@dataclass(frozen=True)
class _Limb:
    """The bones of one limb, by name."""

    fk: tuple[str, ...]  # base, middle, end and, of a leg, toe
    ik: tuple[str, ...]  # their counterparts in the IK layer; the middle one is no control
    pole: str
    at_rest: tuple[str, ...]  # further controls below the end's, which stay at rest


def ik_keys(rig: Object, keys: list[BoneMotion]) -> list[BoneMotion]:
    """Return the keys of the IK controls; none for other rigs, and for limbs of which an FK control
    has no keys.

    The rig must be ``at_rest``; it is left posed.

    :param keys: (T,) keys of the FK controls and the trunk.
    """
    keyed = {key.bone: key for key in keys}
    limbs = [limb for limb in _limbs(rig) if set(limb.fk) <= keyed.keys()]
    if not limbs:
        return []
    count = len(keys[0].rotations)
    bases: dict[str, list[Matrix]] = {}
    for limb in limbs:
        for name in limb.at_rest:
            rig.pose.bones[name].matrix_basis = Matrix()
    for t in _shown_at_the_mouse(count):
        for key in keys:
            rig.pose.bones[key.bone].matrix_basis = basis_of(key, t)
        bpy.context.view_layer.update()
        for limb in limbs:  # first, because the parents of the other controls follow it
            _match(rig, limb.ik[2], limb.fk[2], bases)
        bpy.context.view_layer.update()
        for limb in limbs:
            _hinge(rig, limb, bases)
            for toe_ik, toe_fk in zip(limb.ik[3:], limb.fk[3:], strict=True):
                _match(rig, toe_ik, toe_fk, bases)
    found = [_keys_of(bone, matrices) for bone, matrices in bases.items()]
    still = [bone for limb in limbs for bone in limb.at_rest]
    return found + [_keys_of(bone, [Matrix()] * count) for bone in still]


def _shown_at_the_mouse(count: int) -> Iterator[int]:
    """Yield the frames, and show them at the mouse: Blender evaluates the whole rig twice for each,
    seconds in all.
    """
    manager = bpy.context.window_manager
    manager.progress_begin(0, count)
    try:
        for t in range(count):
            manager.progress_update(t)
            yield t
    finally:
        manager.progress_end()


def _limbs(rig: Object) -> list[_Limb]:
    """Return the limbs of a generated rig that switch between FK and IK."""
    bones = rig.pose.bones
    found = []
    for base, middle, end, toe in _LIMBS:
        for side in ("L", "R"):
            names = [base, middle, end, *([toe] if f"{toe}_ik.{side}" in bones else [])]
            limb = _Limb(
                tuple(f"{name}_fk.{side}" for name in names),
                tuple(f"{'MCH-' if name == middle else ''}{name}_ik.{side}" for name in names),
                f"{base}_ik_target.{side}",
                tuple(
                    name
                    for name in (f"{end}_spin_ik.{side}", f"{end}_heel_ik.{side}")
                    if name in bones
                ),
            )
            switch = bones.get(f"{base}_parent.{side}")
            if (
                switch is not None
                and "IK_FK" in switch
                and {*limb.fk, *limb.ik, limb.pole} <= set(bones.keys())
            ):
                found.append(limb)
    return found


def _moved(rig: Object, control: str, fk: str) -> Matrix:
    """Return the pose of a bone that has moved as its FK counterpart has; both may rest in
    different orientations.
    """
    bones = rig.data.bones
    return (
        rig.pose.bones[fk].matrix @ bones[fk].matrix_local.inverted() @ bones[control].matrix_local
    )


def _match(rig: Object, control: str, fk: str, bases: dict[str, list[Matrix]]) -> None:
    """Move a control as its FK counterpart has moved."""
    _set(rig, control, _moved(rig, control, fk), bases)


def _hinge(rig: Object, limb: _Limb, bases: dict[str, list[Matrix]]) -> None:
    """Pose the base and the middle bone so that both point as their FK counterparts do, and place
    the pole target.

    With L the rest pose of the middle bone relative to the base, and y the bones' direction, the
    hinge angle b solves yᵀ L Rx(b) y = cos of the limb's angle. Of both solutions, the one with the
    smaller roll of the base is taken.
    """
    bones = rig.data.bones
    base = _moved(rig, limb.ik[0], limb.fk[0])
    shin = base.inverted() @ _moved(rig, limb.ik[1], limb.fk[1])
    wanted = np.array(shin.to_3x3().normalized().col[1])
    L = np.array(
        (bones[limb.ik[0]].matrix_local.inverted() @ bones[limb.ik[1]].matrix_local).to_3x3()
    )
    middle = np.arctan2(L[1, 2], L[1, 1])
    spread = np.arccos(np.clip(wanted[1] / np.hypot(L[1, 1], L[1, 2]), -1, 1))
    # A straight limb leaves the roll undetermined; of one that is folded, it decides where the
    # middle joint is.
    sine = float(np.hypot(wanted[0], wanted[2]))
    share = np.clip(1.5 - sine / _MIN_BEND, 0.0, 1.0) if wanted[1] > 0 else 0.0
    natural = share * _MIN_BEND
    found = []
    for bend in (middle + spread, middle - spread):
        has = L @ (0.0, np.cos(bend), np.sin(bend))
        across = has[[0, 2]] / max(float(np.hypot(has[0], has[2])), 1e-9)
        x, z = wanted[[0, 2]] + natural * across
        roll = np.arctan2(x, z) - np.arctan2(across[0], across[1])
        found.append((float(np.angle(np.exp(1j * roll))), float(np.angle(np.exp(1j * bend)))))
    roll, bend = min(found, key=lambda pair: abs(pair[0]))
    base = base @ Matrix.Rotation(roll, 4, "Y")
    _set(rig, limb.ik[0], base, bases)
    rig.pose.bones[limb.ik[1]].matrix_basis = Matrix.Rotation(bend, 4, "X")
    bases.setdefault(limb.ik[1], []).append(Matrix.Rotation(bend, 4, "X"))
    _place_pole(rig, limb, base, bases)


def _place_pole(rig: Object, limb: _Limb, base: Matrix, bases: dict[str, list[Matrix]]) -> None:
    """Place the pole target before the middle joint, where the base's axis points that the solver
    turns towards it.
    """
    posed = rig.pose.bones
    angle = next(
        (
            c.pole_angle
            for c in posed[limb.ik[1]].constraints
            if c.type == "IK" and c.pole_subtarget
        ),
        0.0,
    )
    axis = np.array(base.to_3x3()) @ (np.cos(angle), 0.0, np.sin(angle))
    first, middle, last = (np.array(posed[name].head) for name in limb.fk[:3])
    line = last - first
    axis = axis - line * (axis @ line) / max(float(line @ line), 1e-12)
    length = posed[limb.fk[0]].length + posed[limb.fk[1]].length
    place = middle + unit_vectors(axis) * length
    rest = rig.data.bones[limb.pole].matrix_local
    _set(rig, limb.pole, Matrix.LocRotScale(place.tolist(), rest.to_quaternion(), None), bases)


def _set(rig: Object, name: str, matrix: Matrix, bases: dict[str, list[Matrix]]) -> None:
    """Pose a control at a matrix in the armature's space, and append its channels to ``bases``."""
    bone = rig.pose.bones[name]
    above = rig.pose.bones[name].parent
    matrices = (
        {"parent_matrix": above.matrix, "parent_matrix_local": above.bone.matrix_local}
        if above
        else {}
    )
    bone.matrix_basis = bone.bone.convert_local_to_pose(
        matrix, bone.bone.matrix_local, invert=True, **matrices
    )
    bases.setdefault(name, []).append(bone.matrix_basis.copy())


def _keys_of(bone: str, bases: list[Matrix]) -> BoneMotion:
    rotations = np.array([np.array(matrix.to_quaternion().to_matrix()) for matrix in bases])
    return BoneMotion(bone, rotations, np.array([matrix.translation for matrix in bases], float))
