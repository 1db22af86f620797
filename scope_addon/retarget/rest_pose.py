# SPDX-License-Identifier: GPL-3.0-or-later
"""All bones of a rig in its rest pose: where they begin, where they really end, and what skin they
carry.

The tails of imported bones may mean nothing: glTF stores none, and other formats only where a bone
has a child. A bone therefore ends where its children begin, or else where its skin does; its tail
is the last resort, and only if it is plausible.

Where they lie at rest also tells whether bones can be the body parts that they were taken for. The
mapped ones are a `Skeleton`, whose world rotations are converted to the channels of its bones.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..arrays import Float64Array, IndexArray
from ..kinematics.axes import rotated, transposed
from .bone_map import BoneMap

# Below this share of the rig's size, two ends of bones are at the same place.
SAME_PLACE = 0.002
# A tail further off the line from the parent's head than this, or longer than these multiples of
# its length, means nothing.
_MAX_TAIL_TURN = np.radians(60)
_TAIL_LENGTHS = (0.05, 1.5)
# Without any evidence, a bone goes straight on by this share of the one before: as a hand does.
_CONTINUATION = 0.4
# Of the way from the ankle to the tip of the foot, where toes begin.
_BALL = 0.7
_SIDES = ("left", "right")
# Both segments of a limb are about equally long: the longer one at most this many times.
_MAX_SEGMENT_RATIO = 4.0
# The same segment of both sides.
_MAX_SIDE_RATIO = 1.5
# Of the line from the hips to the head, from the vertical.
_MAX_LEAN = np.radians(50)
# Hips that are less than this share of their legs' length above the ankles sit or squat: their feet
# may be off the floor. Digitigrade legs stand at nine tenths.
_MIN_STANDING = 0.65


@dataclass(frozen=True)
class RestPose:
    """The B bones of a rig at rest in world axes, z up, metres; parents come before children."""

    names: list[str]
    parents: IndexArray  # (B,) indices, -1 for none
    heads: Float64Array  # (B, 3)
    # (B, 3); empty if unknown
    tails: Float64Array = field(default_factory=lambda: np.empty((0, 3)))
    # (V, 3) vertices of the skin
    points: Float64Array = field(default_factory=lambda: np.empty((0, 3)))
    # (V,) the bone that moves each of them
    owners: IndexArray = field(default_factory=lambda: np.empty(0, np.intp))

    @cached_property
    def size(self) -> float:
        """The largest extent of the heads, metres."""
        return max(float(np.ptp(self.heads, axis=0).max(initial=0.0)), 1e-9)

    @cached_property
    def children(self) -> list[list[int]]:
        """The children of each bone."""
        out: list[list[int]] = [[] for _ in self.names]
        for bone, parent in enumerate(self.parents.tolist()):
            if parent >= 0:
                out[parent].append(bone)
        return out

    @cached_property
    def chains(self) -> list[list[int]]:
        """The bones from the root down to each bone, which is the last."""
        out: list[list[int]] = []
        for bone, parent in enumerate(self.parents.tolist()):
            out.append([*(out[parent] if parent >= 0 else ()), bone])
        return out

    def below(self, bone: int) -> list[int]:
        """Return all descendants of a bone."""
        found: list[int] = []
        left = list(self.children[bone])
        while left:
            found.append(left.pop())
            left += self.children[found[-1]]
        return sorted(found)

    @cached_property
    def _rows_by_owner(self) -> dict[int, IndexArray]:
        """The rows of the points that each bone moves, if it moves any."""
        rows = np.argsort(self.owners, kind="stable")
        owners, starts = np.unique(self.owners[rows], return_index=True)
        groups = np.split(rows, starts[1:]) if len(rows) else []
        return dict(zip(owners.tolist(), groups, strict=True))

    def points_of(self, bones: Iterable[int]) -> Float64Array:
        """Return the points that these bones move (V', 3), in the order of all points."""
        rows = [self._rows_by_owner[bone] for bone in bones if bone in self._rows_by_owner]
        return self.points[np.sort(np.concatenate(rows))] if rows else self.points[:0]

    def is_below(self, bone: int, ancestor: int) -> bool:
        """Return whether a bone descends from another."""
        return bone != ancestor and ancestor in self.chains[bone]

    def shared(self, bones: Iterable[int]) -> int | None:
        """Return the deepest bone that all of these descend from or are; None without any."""
        chains = [self.chains[bone] for bone in bones]
        last = None
        for level in zip(*chains, strict=False):
            if len(set(level)) > 1:
                break
            last = level[0]
        return last

    def end(
        self,
        bone: int,
        knuckles: Iterable[int] = (),
        forward: Float64Array | None = None,
    ) -> Float64Array:
        """Return where a bone ends (3,).

        :param knuckles: the first bones of the long fingers, if it is a hand; the thumb tells
            nothing of its direction.
        :param forward: where the person looks (3,), a unit vector, if it is a foot; other bones go
            on in the direction of the one before.
        """
        head = self.heads[bone]
        known = [self.heads[k] for k in knuckles] or [
            self.heads[child]
            for child in self.children[bone]
            if np.linalg.norm(self.heads[child] - head) > SAME_PLACE * self.size
        ]
        if known:
            return np.asarray(np.mean(known, axis=0))
        owned = self.points_of([bone, *self.below(bone)])
        if len(owned) and forward is not None:
            return _ball(owned, head, forward)
        if len(owned):
            away = 2.0 * (owned.mean(axis=0) - head)
            if np.linalg.norm(away) > SAME_PLACE * self.size:
                return np.asarray(head + away)
        return self._end_without_skin(bone, forward)

    def _end_without_skin(self, bone: int, forward: Float64Array | None) -> Float64Array:
        """Return the tail (3,) if it is plausible, or else a point straight on."""
        head = self.heads[bone]
        tail = self.tails[bone] if len(self.tails) else head
        before = next(
            (
                head - self.heads[ancestor]
                for ancestor in reversed(self.chains[bone][:-1])
                if np.linalg.norm(head - self.heads[ancestor]) > SAME_PLACE * self.size
            ),
            None,
        )
        if before is None:
            return np.asarray(tail)
        length = float(np.linalg.norm(before))
        if forward is not None:
            before = length * forward
        along = tail - head
        size = float(np.linalg.norm(along))
        is_plausible = (
            _TAIL_LENGTHS[0] * length < size < _TAIL_LENGTHS[1] * length
            and along @ before > np.cos(_MAX_TAIL_TURN) * size * length
        )
        return np.asarray(tail if is_plausible else head + _CONTINUATION * before)

    def lowest_skin(self, bones: Iterable[int]) -> float | None:
        """Return the height of the lowest vertex of these bones and those below them, metres; None
        without skin.
        """
        moved = {other for bone in bones for other in (bone, *self.below(bone))}
        owned = self.points_of(moved)[:, 2]
        return float(owned.min()) if len(owned) else None


def _ball(skin: Float64Array, ankle: Float64Array, forward: Float64Array) -> Float64Array:
    """Return the ball of a foot (3,), at the height of its sole.

    :param skin: (V, 3) of the whole foot, from heel to toes.
    :param forward: (3,) where the person looks; the foot may point aside.
    """
    along = skin @ forward
    near, far = np.quantile(along, (1 / 3, 2 / 3))
    direction = skin[along >= far].mean(axis=0) - skin[along <= near].mean(axis=0)
    direction[2] = 0.0
    direction /= max(float(np.linalg.norm(direction)), 1e-9)
    reach = float(((skin - ankle) @ direction).max())
    ball: Float64Array = ankle + _BALL * reach * direction
    ball[2] = skin[:, 2].min()
    return ball


@dataclass(frozen=True)
class Fault:
    """Body parts whose bones cannot be right, and why."""

    parts: tuple[str, ...]
    reason: str  # a key of the phrases of ``notices.py``


def rest_faults(heads: Mapping[str, Float64Array]) -> list[Fault]:
    """Return what is impossible about a map, by the heads (3,) of the parts at rest, z up."""
    faults: list[Fault] = []
    lengths: dict[tuple[str, str, str], float] = {}
    for side in _SIDES:
        for limb in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")):
            parts = tuple(f"{side}_{part}" for part in limb)
            if not all(part in heads for part in parts):
                continue
            upper, lower = (
                float(np.linalg.norm(heads[b] - heads[a]))
                for a, b in zip(parts, parts[1:], strict=False)
            )
            lengths[side, limb[0], limb[1]] = upper
            lengths[side, limb[1], limb[2]] = lower
            if max(upper, lower) > _MAX_SEGMENT_RATIO * min(upper, lower):
                faults.append(Fault(parts, "segments"))
            elif limb[0] == "hip" and heads[parts[2]][2] > heads[parts[0]][2]:
                faults.append(Fault(parts, "upwards"))
    for (side, first, second), length in lengths.items():
        other = lengths.get(("right", first, second))
        if side == "left" and other is not None:
            longer, shorter = max(length, other), min(length, other)
            if longer > _MAX_SIDE_RATIO * shorter:
                parts = tuple(f"{each}_{part}" for part in (first, second) for each in _SIDES)
                faults.append(Fault(parts, "sides"))
    hips = [heads[f"{side}_hip"] for side in _SIDES if f"{side}_hip" in heads]
    if len(hips) == 2 and "head" in heads:
        up = heads["head"] - (hips[0] + hips[1]) / 2
        if up[2] < np.cos(_MAX_LEAN) * np.linalg.norm(up):
            faults.append(Fault(("head", "left_hip", "right_hip"), "lying"))
            return faults
    legs = [key for key in lengths if key[1:] == ("hip", "knee")]
    bent = [
        f"{side}_{part}"
        for side, hip, knee in legs
        for part in (hip, knee)
        if heads[f"{side}_hip"][2] - heads[f"{side}_ankle"][2]
        < _MIN_STANDING * (lengths[side, hip, knee] + lengths[side, knee, "ankle"])
    ]
    if bent and not faults:
        faults.append(Fault(tuple(bent), "lying"))
    return faults


def faces_backwards(heads: Mapping[str, Float64Array]) -> bool | None:
    """Return whether the toes of both feet point to where the back should be: then the sides are
    confused. None without toes.

    :param heads: (3,) of each part at rest, z up.
    """
    needed = [f"{side}_{part}" for side in _SIDES for part in ("hip", "ankle", "foot")]
    if not all(part in heads for part in needed):
        return None
    left = heads["left_hip"] - heads["right_hip"]
    forward = np.cross(left, [0.0, 0.0, 1.0])
    toes = [heads[f"{side}_foot"] - heads[f"{side}_ankle"] for side in _SIDES]
    return all(toe @ forward < -0.3 * np.linalg.norm(toe) * np.linalg.norm(forward) for toe in toes)


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

    def rows(self, bone_map: BoneMap) -> dict[str, int]:
        """Return the row of each part that has a bone here, of several bones the last."""
        return {p: self.names.index(b) for b, p in bone_map.parts.items() if b in self.names}

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
