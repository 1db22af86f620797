# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading exported files with Blender's importers."""

import json
import struct
from pathlib import Path

import bpy
import numpy as np
from mathutils.kdtree import KDTree
from scope.scope_addon.scene import actions

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


def glb_json(path: Path) -> dict:
    """Return the JSON of a binary glTF."""
    data = path.read_bytes()
    assert data[:4] == b"glTF"
    length = struct.unpack("<I", data[12:16])[0]
    return json.loads(data[20 : 20 + length])
