# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces with small pictures, which Cycles samples in half the time of procedural noise. Needs
bpy.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...tools.render_sample.stage import Triple, add_box
from .patterns import SIDE, Picture

CORNERS = 4  # of a face


@dataclass(frozen=True)
class Surface:
    """A matt material, and the width and height in metres after which its picture repeats."""

    material: bpy.types.Material
    period_m: tuple[float, float] = (1.0, 1.0)


def plain(name: str, color: NDArray[np.float64]) -> Surface:
    """Return a surface of one linear colour (3,)."""
    material, diffuse = _diffuse(name)
    diffuse.inputs["Color"].default_value = (*color.tolist(), 1.0)
    return Surface(material)


def pictured(name: str, picture: Picture, width_m: float, height_m: float | None = None) -> Surface:
    """Return a surface with a picture that repeats."""
    image = bpy.data.images.new(name, SIDE, SIDE, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(
        np.concatenate([picture, np.ones((SIDE, SIDE, 1))], axis=2).astype(np.float32).ravel()
    )
    material, diffuse = _diffuse(name)
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    material.node_tree.links.new(texture.outputs["Color"], diffuse.inputs["Color"])
    return Surface(material, (width_m, height_m or width_m))


def add_surfaced_box(name: str, center: Triple, size: Triple, surface: Surface) -> None:
    """Add a box with edges along the axes of the world; pictures are upright on its sides."""
    mesh = add_box(name, center, size, surface.material).data
    points = np.zeros((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    corners = np.zeros(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    low = points.min(axis=0)
    uv = []
    for face in points[corners].reshape(-1, CORNERS, 3):
        along = np.delete(np.arange(3), np.ptp(face, axis=0).argmin())
        uv.append((face - low)[:, along] / surface.period_m)
    mesh.uv_layers.new().data.foreach_set("uv", np.concatenate(uv).astype(np.float32).ravel())


def _diffuse(name: str) -> tuple[bpy.types.Material, bpy.types.Node]:
    """Return a new material, and the node that scatters its light."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    links = material.node_tree.links
    nodes.remove(nodes["Principled BSDF"])
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    links.new(diffuse.outputs["BSDF"], nodes["Material Output"].inputs["Surface"])
    return material, diffuse
