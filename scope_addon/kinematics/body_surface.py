# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface of trunk, legs and head, and the points of the arms that may not enter it.

Depth is what one camera measures worst, so a hand that lies on a thigh or hangs beside the hips
easily ends up some centimetres inside of them. That two parts do not overlap depends on the poses
of both, which does not have the form r(T_i, Omega_i, beta) of section 3 of the paper. In a motion
that is nearly right, though, the surface is where it will be: the tangent plane n^T p = d next to a
point p of an arm is constant, and p stays above it as above a floor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ..arrays import BoolArray, Float64Array, FloatArray, IndexArray, unit_vectors
from .contact_points import PALMS, with_keypoints
from .frame_blocks import by_blocks

SPACING_M = 0.05  # Distance between the sampled vertices.
REACH_M = 0.15  # Radius within which a vertex's tangent plane stands for the surface.
# Points higher than this need no plane: one more fit does not move them so far.
AHEAD_M = 0.05
_FRAMES = 256  # Frames whose distances are computed at once, in some 20 MB.
_TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
_LEGS = ("hip", "knee", "ankle")
_ON_ARMS = ("elbow", "wrist", "index", "pinky", "thumb_tip", "middle_finger_tip")
_FOREARMS = tuple(
    f"forearm/{side}_{which}" for side in ("left", "right") for which in ("upper", "lower")
)


def with_arm_points(body: Body) -> Body:
    """Add four keypoints to a body: on each forearm, at a third and two thirds of the way from
    elbow to wrist.
    """
    parts = []
    template = []
    shapedirs = []
    for side in ("left", "right"):
        elbow, wrist = (body.joint_names.index(f"{side}_{joint}") for joint in ("elbow", "wrist"))
        for share in (1 / 3, 2 / 3):
            parts.append(elbow)
            template.append((1 - share) * body.J_template[elbow] + share * body.J_template[wrist])
            shapedirs.append(
                (1 - share) * body.J_shapedirs[elbow] + share * body.J_shapedirs[wrist]
            )
    return with_keypoints(body, _FOREARMS, parts, np.array(template), np.array(shapedirs))


@dataclass(frozen=True)
class TangentPlanes:
    """For each of C points of the arms in T frames: the plane normal^T p = offset that it stays
    above.
    """

    normal: Float64Array  # (T, C, 3) unit, outwards
    # (T, C) metres, with the room that the arm needs around the point.
    offset: Float64Array
    # (T, C) height of the point above the plane, metres; negative inside the body.
    height: Float64Array
    near: BoolArray  # (T, C) whether the surface is so near that the plane matters


class BodySurface:
    """Vertices of trunk, legs and head, spread evenly, and the keypoints on the arms, for one shape
    of a body.
    """

    def __init__(self, body: Body, betas: FloatArray) -> None:
        """Choose the vertices, and measure the room that the arm needs around each keypoint.

        :param body: whose keypoints on the arms are used, those of `with_arm_points` and the palms
            if it has them.
        :param betas: (P,) shape coefficients.
        """
        v = body.rest_vertices(betas)
        J = body.rest_joints(betas)
        normals = _vertex_normals(body, betas)
        sampled = [
            k for k, name in enumerate(body.joint_names) if name in _TRUNK or name.endswith(_LEGS)
        ]
        rows = np.flatnonzero(np.isin(body.strongest_joints, sampled) & normals.any(axis=1))
        rows = rows[one_per_cell(v[rows], SPACING_M)]
        arms = v[np.isin(body.strongest_joints, _arm_parts(body))]
        self._body = body
        self._betas = betas
        self._count = len(rows)
        self._skin = list(_skin(body, rows, v[rows], J, normals[rows]))
        self.indices = _points_on_arms(body) if len(rows) and len(arms) else np.zeros(0, np.intp)
        points = (body.keypoint_template + body.keypoint_shapedirs @ betas)[self.indices]
        self._room = np.linalg.norm(points[:, None] - arms, axis=-1).min(axis=1, initial=np.inf)

    def planes(self, R: FloatArray, t: FloatArray) -> TangentPlanes:
        """Return the tangent planes next to the points `indices` of a posed body.

        :param R, t: (T, K+1, 3, 3) and (T, K+1, 3) part poses in any frame; the result is in that
            frame.
        """
        if not len(self.indices):  # The body has no skin on its arms or its trunk.
            none = np.zeros((len(R), 0))
            return TangentPlanes(np.zeros((len(R), 0, 3)), none, none, none.astype(bool))
        return TangentPlanes(*by_blocks(self._planes, R, t, frames=_FRAMES))

    def _planes(self, R: FloatArray, t: FloatArray) -> tuple[NDArray[Any], ...]:
        v, normals = self._posed(R, t)
        points = self._body.keypoints(R, t, self._betas, self.indices.tolist())
        squared = (
            (points**2).sum(-1)[..., None]
            + (v**2).sum(-1)[:, None]
            - 2.0 * points @ np.swapaxes(v, 1, 2)
        )
        nearest = squared.argmin(-1)
        frame = np.arange(len(R))[:, None]
        normal = normals[frame, nearest]
        offset = (normal * v[frame, nearest]).sum(-1) + self._room
        height = (normal * points).sum(-1) - offset
        return normal, offset, height, (squared.min(-1) < REACH_M**2) & (height < AHEAD_M)

    def _posed(self, R: FloatArray, t: FloatArray) -> tuple[Float64Array, Float64Array]:
        """Return the vertices (T, V, 3) by linear blend skinning, and their unit normals (T, V,
        3).
        """
        v, normals = np.zeros((2, len(R), self._count, 3))
        for joint, rows, weights, local, normal in self._skin:
            R_transposed = np.swapaxes(R[:, joint], 1, 2)
            v[:, rows] += local @ R_transposed + weights * t[:, joint, None]
            normals[:, rows] += normal @ R_transposed
        return v, unit_vectors(normals)


def _skin(
    body: Body,
    rows: IndexArray,
    v: FloatArray,
    J: FloatArray,
    normals: FloatArray,
) -> Iterator[tuple[int, IndexArray, FloatArray, Float64Array, Float64Array]]:
    """Yield for each joint the chosen vertices that it moves, and their weights (n, 1), places and
    normals (n, 3).

    Places are from the joint, and both are times the weight.
    """
    for joint in range(len(body.joint_names)):
        total = np.where(body.skin_joints[rows] == joint, body.skin_weights[rows], 0.0).sum(axis=1)
        moved = np.flatnonzero(total)
        if len(moved):
            weights = total[moved, None]
            yield joint, moved, weights, weights * (v[moved] - J[joint]), weights * normals[moved]


def _points_on_arms(body: Body) -> IndexArray:
    """Return the keypoints (C,) on forearms and hands that stay outside: one for each name, of
    whichever set.
    """
    chosen: dict[str, int] = {}
    for k, keypoint in enumerate(body.keypoint_names):
        side, _, name = keypoint.rpartition("/")[2].partition("_")
        if name in _ON_ARMS or keypoint in _FOREARMS or keypoint in PALMS:
            chosen.setdefault(keypoint if name not in _ON_ARMS else f"{side}_{name}", k)
    return np.array(list(chosen.values()), np.intp)


def _arm_parts(body: Body) -> list[int]:
    """Return the forearms and all parts below them."""
    arms: list[int] = []
    for part, parent in enumerate(body.parents):
        if body.joint_names[part].endswith("_elbow") or parent in arms:
            arms.append(part)
    return arms


def _vertex_normals(body: Body, betas: FloatArray) -> Float64Array:
    """Return outward unit normals (V, 3) in the rest pose; zero where a vertex has no area around
    it.

    In plain numpy, unlike the rasterizer's, because motions are also edited where nothing is
    compiled.
    """
    v = body.rest_vertices(betas)
    triangles = body.triangles()
    a, b, c = (v[triangles[:, corner]] for corner in range(3))
    areas = np.cross(b - a, c - a)
    volume = (a * areas).sum()
    normals = np.zeros(v.shape)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], areas if volume > 0.0 else -areas)
    length: Float64Array = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.maximum(length, np.finfo(float).tiny)


def one_per_cell(points: FloatArray, side_m: float) -> IndexArray:
    """Return the rows of points (n, 3), metres, one in each cell of a grid; in order."""
    _, first = np.unique(np.floor(points / side_m).astype(int), axis=0, return_index=True)
    return np.sort(first)
