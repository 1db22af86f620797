# SPDX-License-Identifier: GPL-3.0-or-later
"""The room, the light, the camera and the person of the sample clip, in Blender."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.scene.camera import blender_camera_matrix
from ...solver.body import Body

LAMPS = {  # name: position (metres, world), power in watts, side in metres
    "skylight": ((-0.7, -1.9, 5.0), 230.0, 1.6),
}
_SAMPLES_ROOM = 32
_SAMPLES_PERSON = 8
Triple = tuple[float, float, float]  # metres, or linear RGB


def build_stage(
    body: Body,
    intrinsics: NDArray[np.float64],
    size: tuple[int, int],
    world_from_camera: NDArray[np.float64],
) -> bpy.types.Object:
    """Build the scene, ready to render; return the person's mesh object, whose vertices are in the
    world frame.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    set_up_rendering(scene, size)
    add_camera(scene, intrinsics, size, world_from_camera)
    _light(scene)
    _room()
    return add_person(body)


def pose_person(person: bpy.types.Object, vertices_world: NDArray[np.float64]) -> None:
    """Give the mesh its vertices for the next frame."""
    person.data.vertices.foreach_set("co", np.ascontiguousarray(vertices_world, np.float32).ravel())
    person.data.update()


def render_room(person: bpy.types.Object, path: Path) -> None:
    """Render the empty room to a .png, once and well: nothing in it moves."""
    scene = bpy.context.scene
    person.hide_render = True
    scene.cycles.samples = _SAMPLES_ROOM
    render_to(path)
    person.hide_render = False
    scene.cycles.samples = _SAMPLES_PERSON


def render_part(box: tuple[float, float, float, float], path: Path) -> None:
    """Render only (left, right, bottom, top), shares of the picture counted from its lower left, to
    a .png.
    """
    render = bpy.context.scene.render
    render.use_border = True
    render.use_crop_to_border = False
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = box
    render_to(path)


def render_to(path: Path) -> None:
    """Render the frame, or what was chosen of it, to a .png."""
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def encode(
    frames: list[Path], path: Path, size: tuple[int, int], fps: int, kbit_per_s: int
) -> None:
    """Join pictures into an H.264 .mp4 with Blender's sequencer."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.view_settings.view_transform = "Standard"
    scene.frame_start = 1
    scene.frame_end = len(frames)
    editor = scene.sequence_editor_create()
    strip = editor.strips.new_image("frames", str(frames[0]), channel=1, frame_start=1)
    for frame in frames[1:]:
        strip.elements.append(frame.name)
    render = scene.render
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.fps = fps
    render.fps_base = 1.0
    render.filepath = str(path)
    render.use_file_extension = False
    settings = render.image_settings
    if hasattr(settings, "media_type"):  # since Blender 5.0
        settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    render.ffmpeg.format = "MPEG4"
    render.ffmpeg.codec = "H264"
    render.ffmpeg.constant_rate_factor = "NONE"
    render.ffmpeg.video_bitrate = kbit_per_s
    render.ffmpeg.maxrate = 2 * kbit_per_s
    render.ffmpeg.minrate = 0
    render.ffmpeg.gopsize = 30
    bpy.ops.render.render(animation=True)


def set_up_rendering(scene: bpy.types.Scene, size: tuple[int, int]) -> None:
    """Choose Cycles with few samples, denoised, and the size of the pictures in pixels."""
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.use_persistent_data = True
    scene.render.image_settings.file_format = "PNG"
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Medium High Contrast"
    cycles = scene.cycles
    cycles.samples = _SAMPLES_PERSON
    cycles.use_adaptive_sampling = False
    cycles.max_bounces = 1
    cycles.diffuse_bounces = 1
    cycles.glossy_bounces = 1
    cycles.use_denoising = True
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_quality = "FAST"
    cycles.denoising_prefilter = "NONE"
    cycles.seed = 1


def add_camera(
    scene: bpy.types.Scene,
    K: NDArray[np.float64],
    size: tuple[int, int],
    world_from_camera: NDArray[np.float64],
) -> None:
    """Add a camera of the given pinhole intrinsics; pixel (u, v) is the centre of a pixel, as in
    OpenCV.
    """
    data = bpy.data.cameras.new("camera")
    camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    width, height = size
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = 36.0
    data.lens = K[0, 0] / width * 36.0
    data.shift_x = -((K[0, 2] + 0.5) - width / 2) / width
    data.shift_y = ((K[1, 2] + 0.5) - height / 2) / width
    camera.matrix_world = blender_camera_matrix(world_from_camera).T.tolist()


def _light(scene: bpy.types.Scene) -> None:
    world = bpy.data.worlds.new("sky")
    scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.75, 0.85, 1.0, 1)
    background.inputs["Strength"].default_value = 0.42
    for name, (place, watts, width) in LAMPS.items():
        data = bpy.data.lights.new(name, "AREA")
        data.energy = watts
        data.size = width
        lamp = bpy.data.objects.new(name, data)
        scene.collection.objects.link(lamp)
        lamp.location = place
        toward = lamp.constraints.new("TRACK_TO")
        toward.target = scene.objects.get("aim") or _aim(scene)
        toward.track_axis = "TRACK_NEGATIVE_Z"
        toward.up_axis = "UP_Y"


def _aim(scene: bpy.types.Scene) -> bpy.types.Object:
    aim = bpy.data.objects.new("aim", None)
    scene.collection.objects.link(aim)
    aim.location = (0.0, 0.0, 1.0)
    return aim


def _room() -> None:
    boards = make_material(
        "boards", (0.34, 0.21, 0.12), (0.24, 0.14, 0.075), stretch=(1.2, 14.0, 1.0)
    )
    wall = make_material("wall", (0.62, 0.60, 0.55), (0.55, 0.54, 0.50), stretch=(3.0, 3.0, 3.0))
    dark = make_material("skirting", (0.20, 0.19, 0.18))
    add_box("floor", (0, 0, -0.05), (12, 12, 0.1), boards)
    add_box("back wall", (0, 2.45, 2), (12, 0.1, 4), wall)
    add_box("skirting board", (0, 2.39, 0.06), (12, 0.03, 0.12), dark)
    add_box("picture frame", (-1.45, 2.38, 1.75), (0.95, 0.03, 0.7), dark)
    add_box(
        "picture",
        (-1.45, 2.36, 1.75),
        (0.85, 0.02, 0.6),
        make_material("canvas", (0.13, 0.30, 0.38), (0.62, 0.42, 0.18)),
    )
    add_box(
        "bench",
        (1.75, 2.05, 0.22),
        (1.1, 0.4, 0.44),
        make_material("bench", (0.45, 0.30, 0.16), (0.38, 0.25, 0.13)),
    )
    add_box(
        "mat",
        (0.05, -0.1, 0.004),
        (2.4, 1.5, 0.008),
        make_material("mat", (0.22, 0.26, 0.30), (0.19, 0.22, 0.26)),
    )


def add_box(
    name: str, center: Triple, size: Triple, material: bpy.types.Material
) -> bpy.types.Object:
    """Add a box with edges along the axes of the world, and return it."""
    corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(
        [[c + s * k for c, s, k in zip(center, size, q, strict=True)] for q in corners], [], faces
    )
    mesh.materials.append(material)
    box = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(box)
    return box


def make_material(
    name: str,
    color: Triple,
    second: Triple | None = None,
    stretch: Triple = (2.0, 2.0, 2.0),
) -> bpy.types.Material:
    """Return a matt material of one linear colour, or mottled between two."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    links = material.node_tree.links
    surface = nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (*color, 1)
    surface.inputs["Roughness"].default_value = 0.7
    if second is None:
        return material
    place = nodes.new("ShaderNodeNewGeometry")
    mapping = nodes.new("ShaderNodeMapping")
    noise = nodes.new("ShaderNodeTexNoise")
    ramp = nodes.new("ShaderNodeValToRGB")
    mapping.inputs["Scale"].default_value = stretch
    noise.inputs["Scale"].default_value = 2.0
    noise.inputs["Detail"].default_value = 2.0
    ramp.color_ramp.elements[0].position = 0.4
    ramp.color_ramp.elements[1].position = 0.6
    ramp.color_ramp.elements[0].color = (*color, 1)
    ramp.color_ramp.elements[1].color = (*second, 1)
    links.new(place.outputs["Position"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], noise.inputs["Vector"])
    links.new(noise.outputs["Fac"], ramp.inputs["Fac"])
    links.new(ramp.outputs["Color"], surface.inputs["Base Color"])
    return material


def add_person(body: Body) -> bpy.types.Object:
    """Add the body's mesh, in the colours of its materials."""
    if body.face_material is None or body.material_colors is None:
        raise ValueError(f"body '{body.name}' has no materials")
    mesh = bpy.data.meshes.new("person")
    mesh.from_pydata(body.v_template.tolist(), [], body.faces.tolist())
    for name, color in zip(body.material_names, body.material_colors, strict=True):
        material = make_material(name, tuple(color[:3]))
        material.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = (
            0.25 if "eye" in name else 0.6
        )
        mesh.materials.append(material)
    mesh.polygons.foreach_set("material_index", body.face_material.astype(np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ones(len(body.faces), bool))
    person = bpy.data.objects.new("person", mesh)
    bpy.context.scene.collection.objects.link(person)
    return person
