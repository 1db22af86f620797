# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's rig, posed as poses come: the retargeting of ``rig_retarget.py`` for one frame,
without keys.

What does not depend on the pose is measured once, by posing the rig at rest. IK controls of a
Rigify rig are not posed: its limbs are switched to FK.
"""

from __future__ import annotations

import time

import numpy as np
from bpy.types import Object
from mathutils import Matrix

from ...solver.body import Body
from ...solver.rotations import matrix_from_quaternion, quaternion_from_matrix
from ..arrays import Float64Array, FloatArray
from ..edit.clip import Clip
from ..kinematics.axes import transform_points
from ..retarget.bone_map import BoneMap
from ..retarget.rest_pose import basis
from ..retarget.transfer import Transfer
from .character.root_object import parent_transform, topmost
from .datablocks import found
from .rig_action import root_locations
from .rig_probe import SWITCHES, at_rest, probe
from .rig_retarget import RetargetOptions, usable_map

# The proportions are compared again for such a change of a shape coefficient, but not at every pose
# while these settle.
_MIN_CHANGE = 0.05
_MIN_PAUSE_S = 0.25


class LiveRig:
    """A rig that follows one live capture."""

    def __init__(
        self, rig: Object, body: Body, bone_map: BoneMap, options: RetargetOptions | None = None
    ) -> None:
        """Measure the rig at rest.

        :param options: of root motion, ``object`` counts as ``bone``.
        :raises UsageError: when the rig lacks a mapped bone.
        :raises InputError: when the map cannot be used, or a mapped bone does not move.
        """
        self._rig = (rig.name, rig.session_uid)
        self._body = body
        self._options = options or RetargetOptions()
        self._map = usable_map(None, body, rig, bone_map)
        self._before = [
            (
                bone.name,
                bone.matrix_basis.copy(),
                {name: bone[name] for name in SWITCHES if name in bone},
            )
            for bone in rig.pose.bones
        ]
        self._position = rig.data.pose_position
        try:
            with at_rest(rig):
                self._skeleton = probe(rig, self._map.parts)
                place = np.array(rig.matrix_world, float)
        except BaseException:
            self.restore()
            raise
        rig.data.pose_position = "POSE"
        self._root = self._skeleton.names.index(self._map.bone("pelvis") or "")
        # The pose is one in the world, so the parent's transform is cancelled.
        self._inverse = np.array(parent_transform(topmost(rig)).inverted_safe(), float)
        self._turn = self._inverse[:3, :3] / np.cbrt(np.linalg.det(self._inverse[:3, :3]))
        # The location channel is linear in the head's offset. Nothing is inverted for each pose:
        # LAPACK's threads wait.
        self._rest = self._skeleton.heads[self._root]
        self._location = root_locations(
            rig, place, self._skeleton, self._root, self._rest + np.eye(3)
        )
        # of all the rig's bones
        self._names = list[str]()
        self._places = dict[str, int]()
        self._transfer: Transfer | None = None
        self._betas = np.zeros(body.P)
        self._due_s = 0.0

    @property
    def rig(self) -> Object | None:
        """The rig; None if it was removed."""
        return found("objects", *self._rig)

    def show(self, rotations: Float64Array, pelvis: Float64Array, betas: FloatArray) -> None:
        """Pose the rig.

        :param rotations: (K+1, 4) w, x, y, z; the root relative to the world, the others to their
            parents.
        :param pelvis: (3,) metres, world.
        :param betas: (P,) shape coefficients.
        """
        rig = self.rig
        if rig is None:
            return
        clip = Clip(np.zeros(1), matrix_from_quaternion(rotations)[None], pelvis[None])
        pose = self._transfer_of(betas).pose(clip)
        heads = pose.heads[:, self._root] + self._options.offset
        if self._options.root == "in-place":
            heads[:, :2] = self._rest[:2]
        heads = transform_points(self._inverse, heads)
        turns = basis(self._skeleton, self._turn @ pose.rotations)[0]
        self._write(rig, turns, (heads[0] - self._rest) @ self._location)

    def _write(self, rig: Object, turns: Float64Array, location: Float64Array) -> None:
        """Set the channels of the mapped bones that still exist, each in its own rotation mode;
        their scale is 1.

        All at once where possible: setting a property of a single bone has every editor that shows
        it drawn again.

        :param turns: (B, 3, 3) of the mapped bones.
        :param location: (3,) of the root bone.
        """
        bones = rig.pose.bones
        values = quaternion_from_matrix(turns)
        if (names := bones.keys()) != self._names:
            self._names = names
            self._places = {name: place for place, name in enumerate(names)}
        quaternions = np.empty((len(names), 4), np.float32)
        locations, scales = np.empty((2, len(names), 3), np.float32)
        bones.foreach_get("rotation_quaternion", quaternions.ravel())
        bones.foreach_get("location", locations.ravel())
        bones.foreach_get("scale", scales.ravel())
        for b, name in enumerate(self._skeleton.names):
            place = self._places.get(name)
            if place is None:
                continue
            locations[place] = location if b == self._root else 0.0
            scales[place] = 1.0
            if (bone := bones[name]).rotation_mode == "QUATERNION":
                quaternions[place] = values[b]
            else:
                # in the bone's own rotation mode
                bone.matrix_basis = Matrix(turns[b].tolist()).to_4x4()
        bones.foreach_set("rotation_quaternion", quaternions.ravel())
        bones.foreach_set("location", locations.ravel())
        bones.foreach_set("scale", scales.ravel())
        rig.update_tag(refresh={"DATA"})

    def _transfer_of(self, betas: FloatArray) -> Transfer:
        """Return the transfer for a shape, or for a slightly older one."""
        now_s = time.monotonic()
        is_due = np.abs(betas - self._betas).max(initial=0.0) > _MIN_CHANGE and now_s > self._due_s
        if self._transfer is None or is_due:
            self._betas = np.array(betas, float)
            self._due_s = now_s + _MIN_PAUSE_S
            feet = self._options.feet
            travel = self._options.travel
            self._transfer = Transfer(
                self._body, self._betas, self._skeleton, self._map, feet=feet, travel=travel
            )
        return self._transfer

    def restore(self) -> None:
        """Give the rig the pose from before."""
        rig = self.rig
        if rig is None:
            return
        rig.data.pose_position = self._position
        for name, matrix, switches in self._before:
            bone = rig.pose.bones.get(name)
            if bone is not None:
                bone.matrix_basis = matrix
                for switch, value in switches.items():
                    bone[switch] = value
        rig.update_tag(refresh={"DATA"})
