# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig's mapped bones at rest, their motion, and the conversion between world rotations and bone
channels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ..arrays import Float64Array, IndexArray
from ..kinematics.axes import rotated, transposed


@dataclass(frozen=True)
class Skeleton:
    """The B mapped bones of a rig in its rest pose, in the world frame (z up, metres), parents
    before children.

    ``parents`` are the mapped bones whose rotation each bone inherits, -1 for none. ``carriers``
    are those that its head moves with; they differ where a bone does not inherit rotation.
    """

    names: list[str]
    parents: IndexArray  # (B,)
    carriers: IndexArray  # (B,)
    heads: Float64Array  # (B, 3) metres
    ends: Float64Array  # (B, 3) metres, where each bone ends; see `RestPose.end`
    rotations: Float64Array  # (B, 3, 3) bone to world
    floor: float = 0.0  # height of the floor under the rig at rest, metres

    @cached_property
    def offsets(self) -> Float64Array:
        """From the head of each bone's carrier to its own (B, 3), metres, in its axes; undefined
        for roots.
        """
        return rotated(
            transposed(self.rotations[self.carriers]), self.heads - self.heads[self.carriers]
        )

    @cached_property
    def rested(self) -> Float64Array:
        """R_parent0ᵀ R_b0 of each bone (B, 3, 3); undefined without a parent."""
        return transposed(self.rotations[self.parents]) @ self.rotations


@dataclass(frozen=True)
class Pose:
    """A skeleton's motion in the world frame."""

    rotations: Float64Array  # (T, B, 3, 3) bone to world
    heads: Float64Array  # (T, B, 3) metres
    # Rotation about the vertical from the heading of the rig at rest to that of the body, radians.
    facing: float


@dataclass(frozen=True)
class BoneMotion:
    """The channels of one bone, T frames."""

    bone: str
    rotations: Float64Array  # (T, 3, 3) relative to parent and rest pose
    # (T, 3) in the axes of the location channel; None: not keyed
    locations: Float64Array | None = None


def basis(rig: Skeleton, world: Float64Array) -> Float64Array:
    """Convert world rotations to the bones' channels: ``B = (R_parent R_parent0ᵀ R_b0)ᵀ R_b``.

    :param world: (T, B, 3, 3) bone to world.
    :return: (T, B, 3, 3) rotations relative to parent and rest pose.
    """
    rested = world[:, rig.parents] @ rig.rested
    roots = rig.parents < 0
    rested[:, roots] = rig.rotations[roots]
    return transposed(rested) @ world


def head_positions(rig: Skeleton, world: Float64Array) -> Float64Array:
    """Return the bones' heads without any translation of the root bone.

    :param world: (T, B, 3, 3) bone to world.
    :return: (T, B, 3) metres.
    """
    heads = rotated(world[:, rig.carriers], rig.offsets)
    for b, carrier in enumerate(rig.carriers.tolist()):
        if carrier < 0:
            heads[:, b] = rig.heads[b]
        else:
            heads[:, b] += heads[:, carrier]
    return heads
