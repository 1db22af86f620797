# SPDX-License-Identifier: GPL-3.0-or-later
"""The build from source data to the arrays of the body files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..pinned_wheel import DOWNLOADS
from .geometry.materials import MATERIALS, face_materials
from .geometry.mesh import (
    Mesh,
    body_and_eyes,
    keep_visible,
    smooth_nipples,
    smooth_perineum,
    vertex_areas,
)
from .geometry.weights import pack, skin_weights
from .joints import Skeleton, make_skeleton
from .keypoints import make_keypoints, pose_keypoints
from .pose import part_rotations, pose_joints, pose_vertices
from .shape_space import build_shape_space
from .source import SourceMesh, fetch_wheel, read_source
from .write import LICENSE, lengths


@dataclass(frozen=True)
class ShapedMesh:
    """The mesh in the source pose: ``basis`` (1 + P, N, 3), the mean and the components over all
    vertices.
    """

    source: SourceMesh
    mesh: Mesh
    basis: NDArray[np.float64]


def build_bodies(shaped: ShapedMesh) -> dict[str, dict[str, NDArray[Any]]]:
    """Return the arrays of both bodies, ``scope`` (24 joints) and ``scope_h`` (52), by file key."""
    skeletons = (make_skeleton(shaped.source, with_hands) for with_hands in (False, True))
    return {skeleton.name: rig_body(shaped, skeleton) for skeleton in skeletons}


def shape_mesh(downloads: Path = DOWNLOADS) -> ShapedMesh:
    """Read the source, find its shape space, keep and smooth what is seen."""
    wheel = fetch_wheel(downloads)
    source = read_source(wheel)
    skin, eyes = body_and_eyes(source)
    body_faces = source.faces[skin | eyes]
    body = np.unique(body_faces)
    area = vertex_areas(source.vertices, body_faces)[body]
    space = build_shape_space(source, body, area)
    basis = smooth_nipples(source, space.basis)
    mesh = keep_visible(source, basis[0])
    return ShapedMesh(source, mesh, smooth_perineum(mesh, basis))


def rig_body(shaped: ShapedMesh, skeleton: Skeleton) -> dict[str, NDArray[Any]]:
    """Place the joints, weight the skin, turn everything into the T-pose; the arrays of the body
    file.
    """
    source = shaped.source
    mesh = shaped.mesh
    basis = shaped.basis
    J, posed_J, R = rest_joints(shaped, skeleton)
    W = skin_weights(source, mesh, skeleton, basis[0])
    vertices = pose_vertices(skeleton, R, W, J, posed_J, basis[:, mesh.kept])
    keypoints = make_keypoints(source, skeleton)
    points = pose_keypoints(keypoints, R, J, posed_J, basis)
    material = face_materials(mesh, skeleton, vertices[0], posed_J[0])
    skin_joints, weights = pack(W)
    return {
        "name": np.array(skeleton.name),
        "joint_names": np.array(skeleton.joint_names),
        "kintree_table": np.array([skeleton.parents, range(len(skeleton.parents))], np.int32),
        **_shaped("v_template", "shapedirs", vertices),
        **_shaped("J_template", "J_shapedirs", posed_J),
        "skin_joints": skin_joints.astype(np.uint8),
        "skin_weights": weights.astype(np.float32),
        "faces": mesh.faces.astype(np.int32),
        "uv": mesh.uv.astype(np.float32),
        "uv_faces": mesh.uv_faces.astype(np.int32),
        "face_material": material.astype(np.uint8),
        "material_names": np.array(list(MATERIALS)),
        "material_colors": np.array(list(MATERIALS.values()), np.float32),
        "keypoint_names": np.array([keypoint.name for keypoint in keypoints]),
        "keypoint_part": np.array([keypoint.part for keypoint in keypoints], np.int32),
        **_shaped("keypoint_template", "keypoint_shapedirs", points),
        "license": np.array(LICENSE),
    }


def rest_joints(
    shaped: ShapedMesh, skeleton: Skeleton
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the joints (1 + P, K+1, 3) in the source pose and in the T-pose, and each part's
    rotation (K+1, 3, 3).
    """
    source = shaped.source
    basis = shaped.basis
    J = skeleton.regressor @ basis
    index, little = (basis[0, source.cubes[f"l-finger-{k}-1"]].mean(axis=0) for k in (2, 5))
    R = part_rotations(skeleton, J[0], index - little)
    return J, pose_joints(skeleton, R, J), R


def _shaped(template: str, shapedirs: str, basis: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    return {template: lengths(basis[0]), shapedirs: lengths(basis[1:].transpose(1, 2, 0))}
