# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh that is kept: the visible skin and the eyeballs, its quads, texture coordinates and
smoothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..source import SourceMesh
from .diffusion import bump, diffuse, perineum
from .visibility import seen_from_outside

NIPPLE_RINGS = (range(1794, 1810), range(8466, 8482))  # vertex loops around what is smoothed away
# metres, times
PERINEUM_RADIUS = 0.08
PERINEUM_ROUNDS = 6


@dataclass(frozen=True)
class Mesh:
    """The kept part of the source mesh. V vertices, F quads counter-clockwise from outside."""

    kept: NDArray[np.intp]  # (V,) source vertex of each vertex
    faces: NDArray[np.intp]  # (F, 4)
    uv: NDArray[np.float64]  # (U, 2)
    uv_faces: NDArray[np.intp]  # (F, 4)
    is_eye: NDArray[np.bool_]  # (F,) bool
    mirror: NDArray[np.intp]  # (V,) vertex on the other side


def body_and_eyes(source: SourceMesh) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return (F,) masks over the source faces: the skin, and the eyeballs."""
    return source.face_group == "body", np.isin(source.face_group, ("helper-l-eye", "helper-r-eye"))


def keep_visible(source: SourceMesh, vertices: NDArray[np.float64]) -> Mesh:
    """Remove helpers and the inside of the head (mouth, eye sockets, nostrils) and renumber the
    rest.

    :param vertices: (N, 3) the mean shape.
    """
    skin, eyes = body_and_eyes(source)
    neck = vertices[source.cubes["neck"], 1].mean()
    in_head = skin & (vertices[source.faces][:, :, 1].min(axis=1) > neck)
    head = source.faces[in_head]
    hidden_by = source.faces[eyes]
    seen = (
        seen_from_outside(vertices, split_quads(head), split_quads(hidden_by))
        .reshape(2, -1)
        .any(axis=0)
    )
    # One ring more than is visible, so that no border shows when the shape changes; the same on
    # both sides.
    touched = np.zeros(len(vertices), bool)
    touched[head[seen]] = True
    touched |= touched[source.mirror]
    keep = (skin & ~in_head) | eyes
    keep[in_head] = touched[head].any(axis=1)

    faces = source.faces[keep]
    uv_faces = source.uv_faces[keep]
    kept, faces = np.unique(faces, return_inverse=True)
    used_uv, uv_faces = np.unique(uv_faces, return_inverse=True)
    mirror = np.searchsorted(kept, source.mirror[kept])
    return Mesh(
        kept, faces.reshape(-1, 4), source.uv[used_uv], uv_faces.reshape(-1, 4), eyes[keep], mirror
    )


def split_quads(quads: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return (2F, 3) triangles: first halves of all quads, then second halves."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def vertex_areas(vertices: NDArray[np.float64], quads: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return (N,) a third of the area of the triangles around each vertex."""
    a, b, c = vertices[split_quads(quads)].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
    return np.bincount(split_quads(quads).ravel(), np.repeat(area, 3), len(vertices)).astype(
        float, copy=False
    )


def edges(quads: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return (E, 2) undirected edges, each once."""
    sides = np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)])
    return np.unique(np.sort(sides, axis=1), axis=0)


def smooth_nipples(source: SourceMesh, basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Refill the inside of the two rings as a thin plate, in the mean and in every component
    (linear in both).

    :param basis: (1 + P, N, 3).
    """
    out = basis.copy()
    skin, _ = body_and_eyes(source)
    links = edges(source.faces[skin])
    for ring in NIPPLE_RINGS:
        inside = _enclosed(links, np.array(ring), len(source.vertices))
        out[:, inside] = thin_plate(links, inside, basis)
    return out


def smooth_perineum(mesh: Mesh, basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smooth the mesh between the legs like a suit, in the mean and in every component (linear in
    both).

    :param basis: (1 + P, N, 3).
    """
    out = basis.copy()
    mean = basis[0, mesh.kept]
    strength = bump(mean, perineum(mesh.mirror, mean), PERINEUM_RADIUS)
    rows = basis[:, mesh.kept].transpose(1, 0, 2).reshape(len(mesh.kept), -1)
    smooth = diffuse(edges(mesh.faces), rows, strength, PERINEUM_ROUNDS)
    out[:, mesh.kept] = smooth.reshape(len(mesh.kept), -1, 3).transpose(1, 0, 2)
    return out


def thin_plate(
    links: NDArray[np.intp], unknown: NDArray[np.intp], basis: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return positions (1 + P, n, 3) of ``unknown`` (ascending indices) on a thin plate through
    their surroundings.

    They minimize the squared umbrella Laplacian, summed over them and their rim.
    """
    near = np.zeros(basis.shape[1], bool)
    near[unknown] = True
    rows = np.unique(links[near[links].any(axis=1)])  # the unknown vertices and their rim
    local = links[np.isin(links, rows).any(axis=1)]
    columns = np.unique(local)
    place = np.full(basis.shape[1], -1)
    place[columns] = np.arange(len(columns))
    laplacian = np.zeros((len(columns), len(columns)))
    a, b = place[local].T
    laplacian[a, b] = laplacian[b, a] = 1.0
    laplacian /= laplacian.sum(axis=1, keepdims=True)
    laplacian -= np.eye(len(columns))
    laplacian = laplacian[place[rows]]
    free = np.isin(columns, unknown)
    known = basis[:, columns[~free]].transpose(1, 0, 2).reshape((~free).sum(), -1)
    solution = np.linalg.lstsq(laplacian[:, free], -laplacian[:, ~free] @ known, rcond=None)[0]
    return solution.reshape(-1, len(basis), 3).transpose(1, 0, 2)


def _enclosed(links: NDArray[np.intp], ring: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Return the vertices cut off from the rest of the mesh by a closed loop of vertices."""
    open_links = links[~np.isin(links, ring).any(axis=1)]
    label = np.arange(count)
    while True:  # the lowest index reachable labels a component
        low = label.copy()
        np.minimum.at(low, open_links[:, 0], label[open_links[:, 1]])
        np.minimum.at(low, open_links[:, 1], label[open_links[:, 0]])
        low = low[low]
        if np.array_equal(low, label):
            break
        label = low
    neighbours = np.setdiff1d(np.unique(links[np.isin(links, ring).any(axis=1)]), ring)
    labels = np.unique(label[neighbours])
    totals = np.array([(label == each).sum() for each in labels])
    small = labels[totals < totals.max()]
    return np.flatnonzero(np.isin(label, small))
