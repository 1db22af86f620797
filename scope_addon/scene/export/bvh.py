# SPDX-License-Identifier: GPL-3.0-or-later
"""Biovision hierarchy files (.bvh): y up, metres, the T-pose at zero rotation facing +z.

Every joint's frame has the model's axes at rest, so offsets are differences of rest joints and rotations are SMPL's.
The root's channels are its position and rotation in the y-up world; its OFFSET is zero because readers disagree
whether position channels add to it. Blender's own exporter writes z up, which other tools show lying down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..axes import R_GLTF_WORLD


@dataclass(frozen=True)
class SampledPose:
    """An armature and its motion at a constant frame rate, world frame (z up), metres. N bones, T frames."""

    names: list[str]
    parents: list[int]  # −1 for roots, parents before children
    heads: np.ndarray  # (N, 3) at rest
    tails: np.ndarray  # (N, 3) at rest
    rotations: np.ndarray  # (T, N, 3, 3) from the rest pose to the pose, both in the world frame
    joints: np.ndarray  # (T, N, 3)
    rate: float  # frames a second


def bvh_text(pose: SampledPose) -> str:
    """The file's text."""
    children: list[list[int]] = [[] for _ in pose.names]
    for i, parent in enumerate(pose.parents):
        if parent >= 0:
            children[parent].append(i)
    order: list[int] = []
    lines = ["HIERARCHY"]
    for root in (i for i, parent in enumerate(pose.parents) if parent < 0):
        _write_joint(lines, order, children, pose, root, depth=0)
    values = _channel_values(pose, order)
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1.0 / pose.rate:.9f}"]
    lines += [" ".join(f"{v:.6f}" for v in row) for row in values.tolist()]
    return "\n".join(lines) + "\n"


def _write_joint(
    lines: list[str], order: list[int], children: list[list[int]], pose: SampledPose, i: int, depth: int
) -> None:
    order.append(i)
    pad, parent = "\t" * depth, pose.parents[i]
    offset = np.zeros(3) if parent < 0 else R_GLTF_WORLD @ (pose.heads[i] - pose.heads[parent])
    position = "6 Xposition Yposition Zposition" if parent < 0 else "3"
    lines += [f"{pad}{'ROOT' if parent < 0 else 'JOINT'} {pose.names[i]}", f"{pad}{{"]
    lines += [f"{pad}\tOFFSET {_triple(offset)}", f"{pad}\tCHANNELS {position} Zrotation Yrotation Xrotation"]
    for child in children[i]:
        _write_joint(lines, order, children, pose, child, depth + 1)
    if not children[i]:
        end = R_GLTF_WORLD @ (pose.tails[i] - pose.heads[i])
        lines += [f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET {_triple(end)}", f"{pad}\t}}"]
    lines.append(f"{pad}}}")


def _triple(v: np.ndarray) -> str:
    return f"{v[0]:.6f} {v[1]:.6f} {v[2]:.6f}"


def _channel_values(pose: SampledPose, order: list[int]) -> np.ndarray:
    """(T, channels) in the order of the hierarchy: metres and degrees."""
    turned = R_GLTF_WORLD @ pose.rotations @ R_GLTF_WORLD.T
    columns = []
    for i in order:
        parent = pose.parents[i]
        if parent < 0:
            columns.append(pose.joints[:, i] @ R_GLTF_WORLD.T)
            columns.append(euler_zyx_degrees(turned[:, i]))
        else:
            columns.append(euler_zyx_degrees(np.swapaxes(turned[:, parent], 1, 2) @ turned[:, i]))
    return np.concatenate(columns, axis=1)


def euler_zyx_degrees(R: np.ndarray) -> np.ndarray:
    """(T, 3) angles z, y, x with ``R = Rz Ry Rx``, continuous in time where the decomposition is.

    At gimbal lock (y = ±90°) x is set to zero; elsewhere the equal triple nearest the frame before is chosen.
    """
    sin_y = np.clip(-R[:, 2, 0], -1.0, 1.0)
    locked = np.abs(sin_y) > 1.0 - 1e-9
    z = np.where(locked, np.arctan2(-R[:, 0, 1], R[:, 1, 1]), np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    x = np.where(locked, 0.0, np.arctan2(R[:, 2, 1], R[:, 2, 2]))
    direct = np.degrees(np.stack([z, np.arcsin(sin_y), x], axis=1))
    other = direct * [1, -1, 1] + [180.0, 180.0, 180.0]  # the same rotation, the long way round
    out = direct.copy()
    for t in range(1, len(out)):
        candidates = np.stack([direct[t], other[t]])
        candidates += 360.0 * np.round((out[t - 1] - candidates) / 360.0)
        out[t] = candidates[np.abs(candidates - out[t - 1]).sum(axis=1).argmin()]
    return out
