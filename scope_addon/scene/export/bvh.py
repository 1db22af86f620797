# SPDX-License-Identifier: GPL-3.0-or-later
"""Biovision hierarchy files (.bvh): y up, centimetres or metres, the T-pose at zero rotation facing
+z.

Every joint's axes are those of the model at rest, so offsets are differences of rest joints and
rotations are SMPL's. The root's channels are its position and rotation in the y-up world; its
OFFSET is zero because readers disagree on whether position channels are added to it. A joint that
moves relative to its parent, such as the pelvis under a bone on the ground, has position channels
too, which replace its OFFSET. Blender's own exporter writes z up, which other tools display lying
down.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import BoolArray, Float64Array
from ...kinematics.axes import R_WORLD_MODEL, rotated, transposed

# the format states no unit; most tools expect centimetres
UNITS_PER_METRE = {"cm": 100.0, "m": 1.0}
# The axes of the file are those of glTF and SMPL: y up, the model faces +z.
R_FILE_WORLD = R_WORLD_MODEL.T
# how far a joint may be from its place at its parent without position channels
_IN_PLACE_M = 5e-4


@dataclass(frozen=True)
class SampledPose:
    """An armature and its motion at a constant frame rate, world frame (z up), metres. N bones, T
    frames.
    """

    names: list[str]
    parents: list[int]  # −1 for roots, parents before children
    heads: Float64Array  # (N, 3) at rest
    tails: Float64Array  # (N, 3) at rest
    # (T, N, 3, 3) from the rest pose to the pose, both in the world frame
    rotations: Float64Array
    joints: Float64Array  # (T, N, 3)
    rate: float  # frames per second


def bvh_text(pose: SampledPose, unit: str) -> str:
    """Return the content of the file; names are without spaces, at which readers would cut them
    off.

    :param unit: of its lengths, a key of ``UNITS_PER_METRE``.
    """
    scale = UNITS_PER_METRE[unit]
    pose = replace(
        pose,
        names=_words(pose.names),
        heads=scale * pose.heads,
        tails=scale * pose.tails,
        joints=scale * pose.joints,
    )
    children: list[list[int]] = [[] for _ in pose.names]
    for i, parent in enumerate(pose.parents):
        if parent >= 0:
            children[parent].append(i)
    order: list[int] = []
    places, angles = _at_parents(pose)
    apart = np.linalg.norm(places - _offsets(pose), axis=-1).max(axis=0)
    has_position = (apart > scale * _IN_PLACE_M) | (np.array(pose.parents) < 0)
    lines = ["HIERARCHY"]
    for root in (i for i, parent in enumerate(pose.parents) if parent < 0):
        order += _subtree(children, root)
        lines += _joint_lines(children, pose, has_position, root, depth=0)
    columns = [
        part[:, i] for i in order for part in ((places, angles) if has_position[i] else (angles,))
    ]
    values = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1.0 / pose.rate:.9f}"]
    lines += [" ".join(f"{v:.6f}" for v in row) for row in values.tolist()]
    return "\n".join(lines) + "\n"


def _words(names: list[str]) -> list[str]:
    """Return names as single words, all different."""
    found: list[str] = []
    for name in names:
        word = "_".join(name.split())
        while word in found or (word != name and word in names):
            word += "_"
        found.append(word)
    return found


def _subtree(children: list[list[int]], i: int) -> list[int]:
    """Return a joint and its descendants, depth first."""
    return [i, *(j for child in children[i] for j in _subtree(children, child))]


def _joint_lines(
    children: list[list[int]],
    pose: SampledPose,
    has_position: BoolArray,
    i: int,
    depth: int,
) -> list[str]:
    """Return the lines of a joint and its descendants."""
    pad = "\t" * depth
    position = "6 Xposition Yposition Zposition" if has_position[i] else "3"
    lines = [f"{pad}{'ROOT' if pose.parents[i] < 0 else 'JOINT'} {pose.names[i]}", f"{pad}{{"]
    lines += [
        f"{pad}\tOFFSET {_triple(_offsets(pose)[i])}",
        f"{pad}\tCHANNELS {position} Zrotation Yrotation Xrotation",
    ]
    for child in children[i]:
        lines += _joint_lines(children, pose, has_position, child, depth + 1)
    if not children[i]:
        end = R_FILE_WORLD @ (pose.tails[i] - pose.heads[i])
        lines += [f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET {_triple(end)}", f"{pad}\t}}"]
    return [*lines, f"{pad}}}"]


def _triple(v: Float64Array) -> str:
    return f"{v[0]:.6f} {v[1]:.6f} {v[2]:.6f}"


def _offsets(pose: SampledPose) -> Float64Array:
    """Return where each joint is at rest (N, 3), relative to its parent, in the file's axes; zero
    for roots.
    """
    parents = np.array(pose.parents)
    offsets: Float64Array = (pose.heads - pose.heads[parents]) @ R_FILE_WORLD.T
    offsets[parents < 0] = 0.0
    return offsets


def _at_parents(pose: SampledPose) -> tuple[Float64Array, Float64Array]:
    """Return where each joint is in its parent's axes (T, N, 3), and its angles z, y and x relative
    to them (T, N, 3), degrees; of roots, in the file's axes.
    """
    parents = np.array(pose.parents)
    child = parents >= 0
    joints = pose.joints @ R_FILE_WORLD.T
    turned = R_FILE_WORLD @ pose.rotations @ R_FILE_WORLD.T
    R_parent_file = transposed(turned[:, parents[child]])
    apart = joints[:, child] - joints[:, parents[child]]
    places = joints.copy()
    places[:, child] = rotated(R_parent_file, apart)
    local = turned.copy()
    local[:, child] = R_parent_file @ turned[:, child]
    return places, euler_zyx_degrees(local)


def euler_zyx_degrees(R: Float64Array) -> Float64Array:
    """Decompose ``R = Rz Ry Rx``, continuously in time where possible.

    Of the equivalent angles, those nearest to the previous frame are chosen; at gimbal lock
    (y = ±90°) x is that of the previous frame, in the first frame zero.

    :param R: (T, N, 3, 3) rotations of N joints.
    :return: (T, N, 3) angles z, y, x, degrees.
    """
    sin_y = np.clip(-R[..., 2, 0], -1.0, 1.0)
    locked = np.abs(sin_y) > 1.0 - 1e-9
    z = np.where(
        locked, np.arctan2(-R[..., 0, 1], R[..., 1, 1]), np.arctan2(R[..., 1, 0], R[..., 0, 0])
    )
    x = np.where(locked, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    direct = np.degrees(np.stack([z, np.arcsin(sin_y), x], axis=-1))
    # the other decomposition of the same rotation
    other = direct * [1, -1, 1] + [180.0, 180.0, 180.0]
    both = np.stack([direct, other], axis=2)
    out: Float64Array = direct.copy()
    for t in range(1, len(out)):
        before = out[t - 1][:, None]
        # At gimbal lock, only z - x is known, or where y is negative, z + x.
        x_before = np.where(locked[t], before[:, 0, 2], 0.0)
        both[t, :, 0, 0] += np.sign(sin_y[t]) * x_before
        both[t, :, 0, 2] += x_before
        both[t] += 360.0 * np.round((before - both[t]) / 360.0)
        nearer = np.abs(both[t] - before).sum(axis=-1).argmin(axis=-1)
        out[t] = both[t, np.arange(len(nearer)), nearer]
    return out
