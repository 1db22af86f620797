# SPDX-License-Identifier: GPL-3.0-or-later
"""Context managers that prepare captures for an exporter and restore them afterwards. What they
make stays in the file: use them within ``temporary_datablocks``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import bpy
import numpy as np
from bpy.types import Collection, Mesh, Object, Scene
from mathutils import Matrix

from ...errors import UsageError
from ...kinematics.smoothing import on_one_hemisphere
from .. import actions
from ..camera import set_resolution
from ..character.body_mesh import (
    copy_expressions,
    expression_offsets,
    mixed_vertices,
    shape_key_name,
)
from ..datablocks import changed, is_deformed_by
from ..transaction import RENDER
from ..visibility import window_shows, world_matrix


@contextmanager
def temporary_scene(name: str) -> Iterator[Scene]:
    """Provide an empty scene that is the window's active scene inside the block, and remove it
    afterwards.
    """
    scene = bpy.data.scenes.new(name)
    try:
        with window_shows(scene):
            yield scene
    finally:
        bpy.data.scenes.remove(scene)


@contextmanager
def scene_of(
    collections: Sequence[Collection], rigs: Sequence[Object], with_camera: bool, unit: float = 1.0
) -> Iterator[Scene]:
    """Provide a scene that contains only these collections, with the frame rate and resolution of
    the active scene.

    Its frame range is that of the motion of ``rigs``.

    :param unit: of the scene, metres.
    :param with_camera: use the footage's resolution, from which exporters compute the camera's
        vertical field of view.
    :raises UsageError: when the motion begins before frame 0.
    """
    source = bpy.context.scene
    with temporary_scene("Capture") as scene:
        for collection in collections:
            scene.collection.children.link(collection)
        for name in RENDER:
            setattr(scene.render, name, getattr(source.render, name))
        scene.unit_settings.scale_length = unit
        for marker in source.timeline_markers:
            scene.timeline_markers.new(marker.name, frame=marker.frame)
        cameras = [obj for obj in scene.objects if obj.type == "CAMERA"]
        scene.camera = source.camera if source.camera in cameras else next(iter(cameras), None)
        if with_camera and scene.camera is not None:
            set_resolution(
                scene, next(c for c in collections if scene.camera in c.all_objects.values())
            )
        span = actions.frame_range(list(rigs)) or (source.frame_start, source.frame_end)
        if math.floor(span[0]) < 0:  # a scene starts at 0 or later, so earlier keys would be lost
            raise UsageError(
                f"the motion begins at frame {math.floor(span[0])}, but exports start at frame 0: "
                "move its keys later, "
                "or capture again with a First Frame of 0 or more"
            )
        scene.frame_end = math.ceil(span[1])
        scene.frame_start = math.floor(span[0])
        # Until the view layer is evaluated once, frame changes do not reach the objects that
        # exporters read.
        bpy.context.view_layer.update()
        scene.frame_set(scene.frame_start)
        yield scene
    source.frame_set(source.frame_current, subframe=source.frame_subframe)


def unit_of_captures(rigs: Sequence[Object], unit: float) -> float:
    """Return the metres that a length of 1 stands for in captures, which are built in metres in any
    scene.

    In a scene of another unit, the user may have scaled them to their true size in that unit, as a
    warning suggests.

    :param unit: of the scene, metres.
    """
    size = abs(world_matrix(rigs[0]).median_scale) if rigs else 1.0
    return min((1.0, unit), key=lambda metres: abs(math.log(max(size * metres, 1e-9))))


@contextmanager
def external_parents_replaced(scene: Scene) -> Iterator[None]:
    """Replace parents outside the scene by empties with the same motion.

    Exporting the parents themselves would include all their other children.
    """
    children = [
        obj
        for obj in scene.objects
        if obj.parent is not None and obj.parent not in scene.objects.values()
    ]
    kept = [
        (o, o.parent, o.parent_type, o.parent_bone, o.matrix_parent_inverse.copy())
        for o in children
    ]
    frames = np.arange(scene.frame_start, scene.frame_end + 1)
    trajectories: list[list[Matrix]] = [[] for _ in children]
    for frame in frames if children else ():
        scene.frame_set(int(frame))
        evaluated = bpy.context.evaluated_depsgraph_get()
        for obj, trajectory in zip(children, trajectories, strict=True):
            seen = obj.evaluated_get(evaluated)
            trajectory.append(seen.matrix_world @ seen.matrix_basis.inverted_safe())
    try:
        for obj, trajectory in zip(children, trajectories, strict=True):
            empty = bpy.data.objects.new(f"{obj.parent.name}_carrier", None)
            channels = actions.Channels(empty, bpy.data.actions.new(empty.name))
            empty.rotation_mode = "QUATERNION"
            place, turn, size = (
                np.array(each) for each in zip(*(m.decompose() for m in trajectory), strict=True)
            )
            channels.write("location", frames, place)
            channels.write("rotation_quaternion", frames, on_one_hemisphere(turn))
            channels.write("scale", frames, size)
            scene.collection.objects.link(empty)
            obj.parent = empty
            obj.parent_type = "OBJECT"
            obj.matrix_parent_inverse.identity()
        scene.frame_set(scene.frame_start)
        yield
    finally:
        for obj, parent, kind, bone, inverse in kept:
            obj.parent = parent
            obj.parent_type = kind
            obj.parent_bone = bone
            obj.matrix_parent_inverse = inverse


@contextmanager
def scaled(scene: Scene, size: float) -> Iterator[None]:
    """Parent everything in a scene to an empty of a size inside the block; no object has a parent
    outside the scene.
    """
    tops = [(obj, obj.matrix_parent_inverse.copy()) for obj in scene.objects if obj.parent is None]
    empty = bpy.data.objects.new("Unit", None)
    empty.scale = (size,) * 3
    scene.collection.objects.link(empty)
    try:
        for obj, _ in tops:
            obj.parent = empty
            obj.matrix_parent_inverse.identity()
        bpy.context.view_layer.update()
        yield
    finally:
        for obj, inverse in tops:
            obj.parent = None
            obj.matrix_parent_inverse = inverse


@contextmanager
def out_of_edit_mode(collections: Sequence[Collection]) -> Iterator[None]:
    """Leave Edit Mode inside the block if an object in these collections is edited; the edits would
    not be written.
    """
    edited = any(obj.mode == "EDIT" for collection in collections for obj in collection.all_objects)
    try:
        if edited:
            bpy.ops.object.mode_set(mode="OBJECT")
        yield
    finally:
        if edited:
            bpy.ops.object.mode_set(mode="EDIT")


@contextmanager
def all_evaluated(collections: Sequence[Collection]) -> Iterator[None]:
    """Show all objects in these collections and leave Rest Position inside the block.

    Some exporters ignore the animation of objects hidden in viewports or renders, or in Rest
    Position.
    """
    groups = {
        group
        for collection in collections
        for group in (collection, *collection.children_recursive)
    }
    objects = {obj for collection in collections for obj in collection.all_objects}
    with (
        changed((*groups, *objects), hide_viewport=False, hide_render=False),
        in_position(objects, "POSE"),
    ):
        yield


@contextmanager
def in_position(objects: Iterable[Object], position: str) -> Iterator[None]:
    """Show the armatures among the objects in ``POSE`` or ``REST`` position inside the block."""
    armatures = {obj.data for obj in objects if obj.type == "ARMATURE"}
    with changed(armatures, pose_position=position):
        yield


@contextmanager
def actions_over_scene_range(scene: Scene) -> Iterator[None]:
    """Set the frame range of armatures' actions to that of the scene.

    A person who appears late then does so in a separate file too, and exporters include keys
    between whole frames.
    """
    moving = [
        obj.animation_data for obj in scene.objects if obj.type == "ARMATURE" and obj.animation_data
    ]
    extended = [
        a for a in {data.action for data in moving} if a is not None and not a.use_frame_range
    ]
    first = scene.frame_start
    last = scene.frame_end
    with changed(extended, use_frame_range=True, frame_start=first, frame_end=last):
        yield


@contextmanager
def baked_meshes(scene: Scene) -> Iterator[None]:
    """Replace captured bodies by meshes of their current shape inside the block; expressions stay
    keys.

    Other meshes, those of a user's rig, keep their shape keys: these are not coefficients of a
    shape.
    """
    meshes = [obj for obj in scene.objects if obj.type == "MESH" and obj.data.shape_keys]
    bodies = [obj for obj in meshes if shape_key_name(0) in obj.data.shape_keys.key_blocks]
    baked = {}
    offsets = {obj: expression_offsets(obj) for obj in bodies}
    for obj in bodies:
        vertices = mixed_vertices(obj, without=offsets[obj])
        baked[obj] = bpy.data.meshes.new_from_object(obj)
        baked[obj].vertices.foreach_set("co", vertices.ravel())
        baked[obj].update()
    sources = {obj: obj.data.shape_keys for obj in bodies}
    with replaced_meshes(baked):
        for obj in bodies:
            if offsets[obj]:
                copy_expressions(obj, sources[obj], offsets[obj])
        bpy.context.view_layer.update()
        yield


@contextmanager
def replaced_meshes(new: Mapping[Object, Mesh]) -> Iterator[None]:
    """Give objects new meshes under the names of theirs inside the block, and remove these after
    it.
    """
    before = [(obj, obj.data, obj.data.name) for obj in new]
    try:
        for obj, mesh, name in before:
            if mesh.library is None:  # a linked mesh's name does not conflict with one in this file
                mesh.name = f"{name} replaced"
            new[obj].name = name
            obj.data = new[obj]
        yield
    finally:
        for obj, mesh, _ in before:
            obj.data = mesh
        bpy.data.batch_remove(list(new.values()))
        for _, mesh, name in before:
            if mesh.library is None:
                mesh.name = name


@contextmanager
def one_person(
    rig: Object, rigs: Sequence[Object], collections: Sequence[Collection], name: str
) -> Iterator[list[Collection]]:
    """Provide collections with the objects of one person inside the block: those of ``collections``
    without others'.
    """
    parts = []
    try:
        for collection in collections:
            part = bpy.data.collections.new(f"{collection.name}_{name}")
            parts.append(part)
            for key, value in collection.items():
                part[key] = value
            for obj in collection.all_objects:
                owners = _rigs_of(obj, rigs)
                if rig in owners or not owners:
                    part.objects.link(obj)
        yield parts
    finally:
        bpy.data.batch_remove(parts)


def _rigs_of(obj: Object, rigs: Sequence[Object]) -> list[Object]:
    """Return those of the rigs that deform an object, or else the one that it is or hangs from."""
    deforming = [rig for rig in rigs if is_deformed_by(obj, rig)]
    if deforming:
        return deforming
    while obj is not None and obj not in rigs:
        obj = obj.parent
    return [obj] if obj is not None else []
