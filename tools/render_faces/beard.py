# SPDX-License-Identifier: GPL-3.0-or-later
"""A full beard with moustache: hairs on the skin around the mouth, which move with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.fitting.rasterizer import vertex_normals
from ...scope_addon.kinematics.face import mouth_faces_of
from ...solver.body import Body
from .looks import masks
from .truth import head_faces

HAIRS = 9000
_LENGTH_M = (0.006, 0.013)
_HALF_WIDTH_M = 0.00045
_MOUSTACHE_SHORTER = 0.75
_MOUSTACHE_DENSER = 3.0
# In the model frame, metres: the moustache between nose and mouth, and where the beard ends above,
# below and behind.
_NOSE = 0.6495
_MOUTH = 0.6425
_CHIN = 0.6105
_CORNER = 0.024
_CHEEK_SLOPE = 0.75
_MOUSTACHE_HALF = 0.027
_LOWEST = 0.564
_BACK = 0.028
_EARS = 0.069


@dataclass(frozen=True)
class Beard:
    """Hairs, each a thin triangle on the skin: the corners of its skin's triangle, shares in these,
    bend and length.
    """

    triangles: NDArray[np.int32]  # (T, 3) of the body's skin, by which it is turned outwards
    corners: NDArray[np.int32]  # (H, 3) vertices
    shares: NDArray[np.float64]  # (H, 3)
    bend: NDArray[np.float64]  # (H, 3) added to the normal and to the way down, model frame
    length: NDArray[np.float64]  # (H,) metres

    @property
    def faces(self) -> list[tuple[int, ...]]:
        """Return the hairs as faces."""
        return [(3 * h, 3 * h + 1, 3 * h + 2) for h in range(len(self.length))]

    def vertices(self, face: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the hairs' vertices (3 H, 3) on a face (V, 3); metres, model frame."""
        normals = vertex_normals(np.ascontiguousarray(face), self.triangles)
        root = np.einsum("hk,hkx->hx", self.shares, face[self.corners])
        normal = np.einsum("hk,hkx->hx", self.shares, normals[self.corners])
        down = np.array([0.0, -1.0, 0.0])
        along = down - normal * (normal @ down)[:, None] + 0.45 * normal + self.bend
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        beside = np.cross(along, normal)
        beside *= _HALF_WIDTH_M / np.maximum(np.linalg.norm(beside, axis=1, keepdims=True), 1e-9)
        tip = root + along * self.length[:, None]
        return np.stack([root + beside, root - beside, tip], axis=1).reshape(-1, 3)


def grow_beard(body: Body, rng: np.random.Generator) -> Beard:
    """Draw the hairs of a person."""
    quads = body.faces[head_faces(body)]
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    skin = triangles[(bearded(body) > 0.5)[triangles].all(axis=1)]
    a, b, c = (body.v_template[skin[:, k]] for k in range(3))
    moustache = (a[:, 1] > _MOUTH - 0.5 * abs(a[:, 0]) - 0.003) & (abs(a[:, 0]) < _MOUSTACHE_HALF)
    density = np.linalg.norm(np.cross(b - a, c - a), axis=1) * np.where(
        moustache, _MOUSTACHE_DENSER, 1.0
    )
    drawn = rng.choice(len(skin), HAIRS, p=density / density.sum())
    corners = skin[drawn]
    shares = rng.dirichlet(np.ones(3), HAIRS)
    length = rng.uniform(*_LENGTH_M, HAIRS) * np.where(moustache[drawn], _MOUSTACHE_SHORTER, 1.0)
    return Beard(triangles, corners, shares, 0.35 * rng.standard_normal((HAIRS, 3)), length)


def bearded(body: Body) -> NDArray[np.float64]:
    """Return (V,) 1 at the vertices that a beard covers, otherwise 0."""
    V = body.v_template
    x = abs(V[:, 0])
    y = V[:, 1]
    z = V[:, 2]
    moustache = (x < _MOUSTACHE_HALF) & (y > _MOUTH - 0.5 * x) & (y < _NOSE - 0.3 * x) & (z > 0.11)
    edge = np.where(x < _CORNER, _CHIN, 0.641 + _CHEEK_SLOPE * (x - _CORNER))
    beard = (y < edge) & (y > _LOWEST) & (z > _BACK) & (x < _EARS)
    lips, _, _ = masks(body)
    covered = (moustache | beard) & (lips < 0.5)
    covered[np.unique(body.faces[mouth_faces_of(body)])] = False
    assert body.face_material is not None  # checked by `head_faces`
    others = body.face_material != list(body.material_names).index("skin")
    covered[np.unique(body.faces[others])] = False
    return covered.astype(float)
