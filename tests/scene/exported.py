# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading exported files with Blender's importers."""

import json
import struct
from pathlib import Path

import bpy
import numpy as np
from mathutils.kdtree import KDTree
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.export import fbx_file

from ..required import package
from .conftest import Blender, truth_of

# metres
JOINT_TOLERANCE = 1e-3
SKIN_TOLERANCE = 2e-3


def read_back(path: Path, rate: float = 30.0) -> float:
    """Open the file in an empty scene of this rate; return the scene frame of the motion's first
    frame.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    render = bpy.context.scene.render
    render.fps = round(rate)
    render.fps_base = round(rate) / rate
    if path.suffix == ".glb":
        render.fps_base = rate / round(rate)  # whose inverse the importer takes
        bpy.ops.import_scene.gltf(filepath=str(path))
        render.fps_base = round(rate) / rate
        # The importer adds a ball that displays bones; it is no part of the file.
        for obj in [o for o in bpy.data.objects if o.name.startswith("Icosphere")]:
            bpy.data.objects.remove(obj)
        return 0.0
    if path.suffix == ".fbx":
        if "fbx_import" in dir(bpy.ops.wm):
            bpy.ops.wm.fbx_import(filepath=str(path))
            return 1.0
        bpy.ops.import_scene.fbx(filepath=str(path), anim_offset=0.0)
        # The older importer counts seconds in whole frame rates: it puts 29.97's keys at 30 a
        # second.
        stretch = rate / round(rate)
        for curve in [c for obj in bpy.data.objects for c in actions.fcurves(obj)]:
            coordinates = actions.read_keys(curve)
            coordinates[:, 0] *= stretch
            curve.keyframe_points.foreach_set("co", coordinates.ravel())
            curve.update()
    elif path.suffix == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(path))
    elif path.suffix == ".usdc":
        bpy.ops.wm.usd_import(filepath=str(path))
        for key in (k for block in bpy.data.shape_keys for k in block.key_blocks):
            # the importer leaves 0..1, which clamps
            key.slider_min = -10.0
            key.slider_max = 10.0
    elif path.suffix == ".bvh":
        bpy.ops.import_anim.bvh(
            filepath=str(path), global_scale=0.01, frame_start=1, update_scene_fps=True
        )
        keyed = actions.frame_range([next(o for o in bpy.data.objects if o.type == "ARMATURE")])
        assert keyed is not None
        return keyed[0]
    return 0.0


def nearest_indices(points: np.ndarray, among: np.ndarray) -> np.ndarray:
    tree = KDTree(len(among))
    for i, p in enumerate(among):
        tree.insert(p, i)
    tree.balance()
    return np.array([tree.find(p)[1] for p in points])


def corresponding(mesh: bpy.types.Object, body, betas: np.ndarray) -> np.ndarray:
    """Return the body's vertex for each vertex of an imported mesh; formats may split or reorder
    them.
    """
    if len(mesh.data.vertices) == len(body.v_template):
        return np.arange(len(body.v_template))
    rest = np.empty(3 * len(mesh.data.vertices), np.float32)
    mesh.data.vertices.foreach_get("co", rest)
    rest = rest.reshape(-1, 3)
    unshaped = body.rest_vertices(None if mesh.data.shape_keys else betas)
    world = np.stack([unshaped[:, 0], -unshaped[:, 2], unshaped[:, 1]], axis=1)
    world[:, 2] += rest[:, 2].min() - world[:, 2].min()
    match = nearest_indices(rest, world)
    assert np.abs(rest - world[match]).max() < 1e-4
    return match


def assert_joints(path: Path, body, motion, row: int, rate: float = 30.0) -> None:
    """Check that a file has the joints of a row of the motion in that row's frame."""
    Blender.go_to(read_back(path, rate) + row)
    joints = Blender.joints(Blender.only("ARMATURE"), body.joint_names)
    np.testing.assert_allclose(joints, truth_of(body, motion).joints[row], atol=JOINT_TOLERANCE)


def read_glb(path: Path) -> tuple[dict, bytearray]:
    """Return the JSON and the binary part of a binary glTF."""
    data = path.read_bytes()
    magic, version, length, json_bytes = struct.unpack_from("<4sIII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    return json.loads(data[20 : 20 + json_bytes]), bytearray(data[28 + json_bytes :])


def write_glb(path: Path, gltf: dict, binary: bytes) -> None:
    """Write a binary glTF."""
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    chunks = ((b"JSON", text), (b"BIN\0", binary))
    whole = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in chunks)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(whole)) + whole)


def glb_values(gltf: dict, binary: bytearray, accessor: int) -> np.ndarray:
    """Return the floats (N,) of an accessor; they can be changed."""
    entry = gltf["accessors"][accessor]
    start = gltf["bufferViews"][entry["bufferView"]].get("byteOffset", 0)
    parts = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[entry["type"]]
    start += entry.get("byteOffset", 0)
    return np.frombuffer(binary, "<f4", parts * entry["count"], start)


def fbx_objects(path: Path) -> dict[bytes, list]:
    """Return the object nodes of an FBX file by their kinds, and under b"" its root."""
    root, version = package("io_scene_fbx.parse_fbx").parse(str(path))
    assert version == 7400
    found: dict[bytes, list] = {b"": [root]}
    for objects in fbx_file.below(root, b"Objects"):
        for node in objects.elems:
            found.setdefault(node.id, []).append(node)
    return found


def fbx_properties(node) -> dict[str, list]:
    """Return the values of an FBX node's properties by name."""
    return {entry.props[0].decode(): entry.props[4:] for entry in fbx_file.properties(node)}


def fbx_models(path: Path) -> dict[str, dict[str, list]]:
    """Return the properties of each model of an FBX file, by its name."""
    return {
        node.props[1].split(b"\0")[0].decode(): fbx_properties(node)
        for node in fbx_objects(path)[b"Model"]
    }
