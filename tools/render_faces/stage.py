# SPDX-License-Identifier: GPL-3.0-or-later
"""The head, its colours, the light and the camera in Blender. The world is the camera's frame: x
right, y down.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.scene.camera import blender_camera_matrix
from ...solver.body import Body
from ..render_sample.stage import render_to, set_up_rendering
from .looks import Look
from .truth import SIZE, head_faces
from .worn import WORN

SAMPLES = 4
SAMPLES_OF_LENSES = 8


class Stage:
    """A scene with one head, rendered frame by frame."""

    def __init__(self, body: Body) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        set_up_rendering(bpy.context.scene, (SIZE, SIZE))
        bpy.context.scene.cycles.samples = SAMPLES
        self._worn: dict[str, bpy.types.Mesh] = {}
        self._camera()
        self._lamps()
        self._head(body)

    def dress(self, look: Look, rng: np.random.Generator) -> None:
        """Take a person's colours, and draw light and background."""
        rgba = np.concatenate(
            [look.skin[self._kept], np.ones((len(self._kept), 1))], axis=1
        ).astype(np.float32)
        self._mesh.color_attributes["tint"].data.foreach_set("color", rgba.ravel())
        for name, color in (("hair", look.hair), ("eye_iris", look.iris)):
            surface = self._mesh.materials[name].node_tree.nodes["Principled BSDF"]
            surface.inputs["Base Color"].default_value = (*color, 1)
        for lamp, watts in zip(self._lights, (rng.uniform(4, 14), rng.uniform(0, 4)), strict=True):
            lamp.data.energy = watts
            lamp.data.size = rng.uniform(0.2, 1.0)
            lamp.location = (rng.uniform(-0.9, 0.9), rng.uniform(-1.0, 0.2), rng.uniform(-0.4, 0.2))
        background = bpy.context.scene.world.node_tree.nodes["Background"]
        background.inputs["Color"].default_value = (*rng.uniform(0.5, 1.0, 3), 1)
        background.inputs["Strength"].default_value = rng.uniform(0.3, 0.8)

    def wear(self, things: dict[str, list[tuple[int, ...]]]) -> None:
        """Put on things, by the names of `WORN`, with these faces; what was worn is taken off."""
        for mesh in self._worn.values():
            bpy.data.meshes.remove(mesh)  # and its object
        self._worn = {}
        bpy.context.scene.cycles.samples = (
            SAMPLES_OF_LENSES if "clear lenses" in things else SAMPLES
        )
        for name, faces in things.items():
            mesh = bpy.data.meshes.new(name)
            count = 1 + max(max(face) for face in faces)
            mesh.from_pydata(np.zeros((count, 3)).tolist(), [], faces)
            mesh.materials.append(_worn_material(name))
            if name == "beard":
                hair = (
                    self._mesh.materials["hair"]
                    .node_tree.nodes["Principled BSDF"]
                    .inputs["Base Color"]
                )
                surface = mesh.materials[0].node_tree.nodes["Principled BSDF"]
                surface.inputs["Base Color"].default_value = hair.default_value
            bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))
            self._worn[name] = mesh

    def render(
        self,
        vertices_camera: NDArray[np.float64],
        focal_px: float,
        path: Path,
        worn: dict[str, NDArray[np.float64]] | None = None,
    ) -> None:
        """Render a picture of SIZE × SIZE pixels.

        :param vertices_camera: (V, 3) of the body, metres in the camera frame.
        :param worn: vertices (N, 3) of what is worn, likewise.
        """
        points = np.ascontiguousarray(vertices_camera[self._kept], np.float32)
        self._mesh.vertices.foreach_set("co", points.ravel())
        self._mesh.update()
        for name, places in (worn or {}).items():
            self._worn[name].vertices.foreach_set(
                "co", np.ascontiguousarray(places, np.float32).ravel()
            )
            self._worn[name].update()
        bpy.context.scene.camera.data.lens = focal_px / SIZE * 36.0
        for lamp in self._lights:
            direction = np.array([0.0, 0.0, 1.0]) * points[:, 2].mean() - np.array(lamp.location)
            lamp.rotation_mode = "QUATERNION"
            lamp.rotation_quaternion = _facing(direction)
        render_to(path)

    @staticmethod
    def _camera() -> None:
        scene = bpy.context.scene
        data = bpy.data.cameras.new("camera")
        scene.camera = bpy.data.objects.new("camera", data)
        scene.collection.objects.link(scene.camera)
        data.sensor_fit = "HORIZONTAL"
        data.sensor_width = 36.0
        data.clip_start = 0.01
        scene.camera.matrix_world = blender_camera_matrix(np.eye(4)).T.tolist()

    def _lamps(self) -> None:
        scene = bpy.context.scene
        scene.world = bpy.data.worlds.new("sky")
        scene.world.use_nodes = True
        self._lights = []
        for name in ("key", "fill"):
            lamp = bpy.data.objects.new(name, bpy.data.lights.new(name, "AREA"))
            scene.collection.objects.link(lamp)
            self._lights.append(lamp)

    def _head(self, body: Body) -> None:
        kept = head_faces(body)
        assert body.face_material is not None  # checked by `head_faces`
        assert body.material_colors is not None
        self._kept, local = np.unique(body.faces[kept], return_inverse=True)
        material = body.face_material[kept]
        self._mesh = bpy.data.meshes.new("head")
        self._mesh.from_pydata(
            body.v_template[self._kept].tolist(), [], local.reshape(-1, 4).tolist()
        )
        for name, color in zip(body.material_names, body.material_colors, strict=True):
            self._mesh.materials.append(_material(str(name), tuple(color)))
        self._mesh.polygons.foreach_set("material_index", material.astype(np.int32))
        self._mesh.polygons.foreach_set("use_smooth", np.ones(len(material), bool))
        self._mesh.color_attributes.new("tint", "FLOAT_COLOR", "POINT")
        head = bpy.data.objects.new("head", self._mesh)
        bpy.context.scene.collection.objects.link(head)
        subdivision = head.modifiers.new("smooth", "SUBSURF")
        subdivision.levels = subdivision.render_levels = 1


def _material(name: str, color: tuple[float, ...]) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    surface = nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = color
    surface.inputs["Roughness"].default_value = 0.2 if "eye" in name else 0.5
    if name in ("skin", "suit", "suit_accent"):
        tint = nodes.new("ShaderNodeVertexColor")
        tint.layer_name = "tint"
        material.node_tree.links.new(tint.outputs["Color"], surface.inputs["Base Color"])
    return material


def _worn_material(name: str) -> bpy.types.Material:
    color, stopped, roughness, metal = WORN[name]
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    links = material.node_tree.links
    surface = nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (*color, 1)
    surface.inputs["Roughness"].default_value = roughness
    surface.inputs["Metallic"].default_value = float(metal)
    mix = nodes.new("ShaderNodeMixShader")
    mix.inputs["Fac"].default_value = stopped
    links.new(nodes.new("ShaderNodeBsdfTransparent").outputs["BSDF"], mix.inputs[1])
    links.new(surface.outputs["BSDF"], mix.inputs[2])
    links.new(mix.outputs["Shader"], nodes["Material Output"].inputs["Surface"])
    return material


def _facing(direction: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return the quaternion that turns −z, along which a lamp shines, to a direction."""
    from mathutils import Vector

    return tuple(Vector(direction).to_track_quat("-Z", "Y"))
