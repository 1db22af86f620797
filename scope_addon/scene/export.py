# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures to files: .glb .fbx .blend .bvh .usdc by what the scene holds, .npz by what was captured.

Captures are linked into a scene of their own for the time of the export, so that nothing else of the user's file goes
along and nothing depends on selection or visibility. Files are written beside their place and renamed into it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ...solver.body import Body
from ...solver.errors import OutputError, UsageError
from ..motion import Motion
from ..whole_file import reason, written_beside
from . import actions, formats
from .animation import on_one_hemisphere
from .bone_display import remove_if_unused
from .build import CAPTURE_TAG, NEW_SCENE, BuildOptions, BuildResult, Progress, build_scene
from .camera import set_resolution
from .output_paths import check_output, person_paths
from .shape_keys import mixed_vertices

SHAPES = ("auto", "keys", "baked")


@dataclass(frozen=True)
class ExportOptions:
    """What goes into the files."""

    camera: bool = False  # the footage's camera, in .glb, .fbx and .usdc; .blend always has it
    # "keys": morph targets whose value is the coefficient. "baked": a plain mesh of the fitted shape, for engines that
    # clamp morphs to 0..1. "auto": keys, but baked in .usdc, because USD importers (Blender's among them) clamp.
    shape: str = "auto"
    separate: bool = False  # a file for each person, also in the formats that hold several

    def __post_init__(self) -> None:
        """Refuse values that are not offered."""
        if self.shape not in SHAPES:
            raise UsageError(f"shape must be one of {', '.join(SHAPES)}, but is '{self.shape}'")

    def bakes(self, suffix: str) -> bool:
        """Whether a file of this format gets the shape baked into its mesh."""
        return self.shape == "baked" or (self.shape == "auto" and suffix == ".usdc")


def captures(scene: bpy.types.Scene) -> list[bpy.types.Collection]:
    """The collections of a scene that hold captures."""
    return [c for c in scene.collection.children_recursive if CAPTURE_TAG in c]


def export(
    path: str | Path,
    collections: Sequence[bpy.types.Collection] | None = None,
    motions: Sequence[Motion] = (),
    options: ExportOptions | None = None,
) -> list[Path]:
    """Write captures to one file (.bvh and .npz, or where it is wanted: one per person) in the format of its suffix.

    :param collections: the captures; those of the active scene when not given.
    :param motions: needed for .npz, which holds what was captured rather than what the scene has become.
    :return: the files written.
    :raises UsageError: unknown suffix, or nothing to export. :raises OutputError: cannot be written.
    """
    path = check_output(path)
    suffix = path.suffix.lower()
    if suffix == ".npz" and motions:
        targets = person_paths(path, len(motions))
        for target, motion in zip(targets, motions, strict=True):
            motion.save(target)
        return targets
    chosen = list(collections) if collections is not None else captures(bpy.context.scene)
    if not chosen:
        raise UsageError(f"cannot write {path.name}: the scene holds no capture; capture a video first")
    options = options or ExportOptions()
    rigs = list(dict.fromkeys(obj for c in chosen for obj in c.all_objects if obj.type == "ARMATURE"))
    if not rigs:
        raise UsageError(f"cannot write {path.name}: the capture's armature was removed; undo that or capture again")
    if suffix == ".npz":
        raise UsageError(f"cannot write {path.name}: a motion file holds what was captured, so pass the motions")
    targets = person_paths(path, len(rigs), options.separate)
    if len(targets) == 1:
        _write_one(path, chosen, rigs, options)
        return [path]
    for number, (target, rig) in enumerate(zip(targets, rigs, strict=True), 1):
        with _alone(rig, rigs, chosen, f"person{number}") as parts:
            _write_one(target, parts, rigs, options)
    return targets


def _write_one(
    path: Path,
    collections: Sequence[bpy.types.Collection],
    rigs: Sequence[bpy.types.Object],
    options: ExportOptions,
) -> None:
    """Write these collections, as long as all of ``rigs`` move: files of several people begin at the same time."""
    suffix = path.suffix.lower()
    with (
        _out_of_edit_mode(collections),
        nullcontext() if suffix == ".blend" else _all_evaluated(collections),  # a scene keeps what is hidden in it
        _scene_of(collections, rigs, options.camera) as scene,
        _with_carriers(scene) if suffix == ".glb" else nullcontext(),  # that exporter leaves out what hangs on others
        _baked_meshes(scene) if options.bakes(suffix) else nullcontext(),
        actions.nla_as_actions(scene) if suffix == ".glb" else nullcontext(),  # that exporter reads actions alone
        _actions_as_long_as(scene),
    ):
        rig = next((obj for obj in scene.objects if obj.type == "ARMATURE"), None)
        writers = {
            ".bvh": lambda temporary: formats.write_bvh(temporary, scene, rig),
            ".glb": lambda temporary: formats.write_glb(temporary, options.camera),
            ".fbx": lambda temporary: formats.write_fbx(temporary, options.camera),
            ".usdc": lambda temporary: formats.write_usd(temporary, options.camera),
            ".blend": lambda temporary: formats.write_blend(temporary, scene),
        }
        _write(path, writers[suffix])


@contextmanager
def _alone(
    rig: bpy.types.Object,
    rigs: Sequence[bpy.types.Object],
    collections: Sequence[bpy.types.Collection],
    name: str,
) -> Iterator[list[bpy.types.Collection]]:
    """Collections, for a while, of what those hold but for the other people."""
    others = {obj for other in rigs if other != rig for obj in (other, *other.children_recursive)}
    parts = []
    try:
        for collection in collections:
            part = bpy.data.collections.new(f"{collection.name}_{name}")
            parts.append(part)
            for key, value in collection.items():
                part[key] = value
            for obj in collection.all_objects:
                if obj not in others:
                    part.objects.link(obj)
        yield parts
    finally:
        bpy.data.batch_remove(parts)


def export_motions(
    motions: list[Motion],
    body: Body,
    path: str | Path | Sequence[str | Path],
    footage: str | Path | None = None,
    build_options: BuildOptions | None = None,
    export_options: ExportOptions | None = None,
    progress: Progress | None = None,
) -> tuple[list[Path], list[str]]:
    """Build the motions in a scene of their own, write one file or several, and leave the session as it was.

    The scene takes the motion's frame rate and the footage's resolution.

    :return: the files written, and the warnings of the build.
    """
    paths = [path] if isinstance(path, str | Path) else list(path)
    for each in paths:
        check_output(each)
    written: list[Path] = []
    warnings: list[str] = []
    scene_paths = [p for p in paths if Path(p).suffix.lower() != ".npz"]
    for each in (p for p in paths if p not in scene_paths):
        written += export(each, motions=motions)
    if not scene_paths:
        return written, warnings
    build_options = build_options or replace(NEW_SCENE, name=Path(scene_paths[0]).stem)
    with temporary_scene("Capturing"):
        result = build_scene(motions, body, footage, build_options, progress)
        try:
            for each in scene_paths:
                written += export(each, [result.collection], motions, export_options)
        finally:
            _remove(result)
    return written, result.warnings


def _remove(result: BuildResult) -> None:
    """Take what a build made out of the file again."""
    objects = list(result.collection.objects)
    data = {obj.data for obj in objects}
    owners = [*objects, *(obj.data.shape_keys for obj in objects if obj.type == "MESH")]
    owners += [obj.data for obj in objects if obj.type == "CAMERA"]
    used = {owner.animation_data.action for owner in owners if owner and owner.animation_data} - {None}
    materials = {m for block in data for m in getattr(block, "materials", ())}
    shown = {footage for block in data for picture in getattr(block, "background_images", ())
             for footage in (picture.clip, picture.image) if footage}  # fmt: skip
    bpy.data.batch_remove([result.collection, *objects, *data, *used, *materials])
    bpy.data.batch_remove([footage for footage in shown if footage.users == 0])
    remove_if_unused()


@contextmanager
def temporary_scene(name: str) -> Iterator[bpy.types.Scene]:
    """An empty scene that is the window's while the block runs, and gone afterwards."""
    # Edit mode and the exporters work on a window's scene; timers have no window of their own, so they borrow one.
    window = bpy.context.window or bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        before = window.scene
        scene = bpy.data.scenes.new(name)
        try:
            window.scene = scene
            yield scene
        finally:
            window.scene = before
            bpy.data.scenes.remove(scene)


@contextmanager
def _scene_of(
    collections: Sequence[bpy.types.Collection], rigs: Sequence[bpy.types.Object], with_camera: bool
) -> Iterator[bpy.types.Scene]:
    """A scene that holds these collections alone, with the rate and picture of the scene they come from.

    It begins and ends with the motion of ``rigs``.

    :param with_camera: the picture is the footage's, by which exporters tell the camera's vertical field of view.
    :raises UsageError: the motion begins before frame 0.
    """
    source = bpy.context.scene
    with temporary_scene("Capture") as scene:
        for collection in collections:
            scene.collection.children.link(collection)
        for name in ("fps", "fps_base", "resolution_x", "resolution_y", "pixel_aspect_x", "pixel_aspect_y"):
            setattr(scene.render, name, getattr(source.render, name))
        for marker in source.timeline_markers:
            scene.timeline_markers.new(marker.name, frame=marker.frame)
        cameras = [obj for obj in scene.objects if obj.type == "CAMERA"]
        scene.camera = source.camera if source.camera in cameras else next(iter(cameras), None)
        if with_camera and scene.camera is not None:
            set_resolution(scene, next(c for c in collections if scene.camera in c.all_objects.values()))
        span = actions.frame_range(list(rigs)) or (source.frame_start, source.frame_end)
        if math.floor(span[0]) < 0:  # a scene begins at 0 or later, and what lies before would be lost
            raise UsageError(
                f"the motion begins at frame {math.floor(span[0])}, but exports at 0: move its keys later, or capture "
                "again with a First Frame of 0 or more"
            )
        scene.frame_end = math.ceil(span[1])
        scene.frame_start = math.floor(span[0])
        # Until the view layer is evaluated once, frame changes do not reach the objects that exporters read.
        bpy.context.view_layer.update()
        scene.frame_set(scene.frame_start)
        yield scene
    source.frame_set(source.frame_current, subframe=source.frame_subframe)


@contextmanager
def _with_carriers(scene: bpy.types.Scene) -> Iterator[None]:
    """Let what hangs on something outside the scene hang for a while on an empty that goes the same way.

    The carriers themselves would bring along all that hangs on them.
    """
    hanging = [obj for obj in scene.objects if obj.parent is not None and obj.parent not in scene.objects.values()]
    kept = [(o, o.parent, o.parent_type, o.parent_bone, o.matrix_parent_inverse.copy()) for o in hanging]
    frames = np.arange(scene.frame_start, scene.frame_end + 1)
    ways: list[list[Matrix]] = [[] for _ in hanging]
    for frame in frames if hanging else ():
        scene.frame_set(int(frame))
        evaluated = bpy.context.evaluated_depsgraph_get()
        for obj, way in zip(hanging, ways, strict=True):
            seen = obj.evaluated_get(evaluated)
            way.append(seen.matrix_world @ seen.matrix_basis.inverted_safe())
    made: list[bpy.types.ID] = []
    try:
        for obj, way in zip(hanging, ways, strict=True):
            empty = bpy.data.objects.new(f"{obj.parent.name}_carrier", None)
            channels = actions.Channels(empty, bpy.data.actions.new(empty.name))
            made += [empty, channels.action]
            empty.rotation_mode = "QUATERNION"
            place, turn, size = (np.array(each) for each in zip(*(m.decompose() for m in way), strict=True))
            channels.write("location", frames, place)
            channels.write("rotation_quaternion", frames, on_one_hemisphere(turn))
            channels.write("scale", frames, size)
            scene.collection.objects.link(empty)
            obj.parent, obj.parent_type = empty, "OBJECT"
            obj.matrix_parent_inverse.identity()
        scene.frame_set(scene.frame_start)
        yield
    finally:
        for obj, parent, kind, bone, inverse in kept:
            obj.parent, obj.parent_type, obj.parent_bone, obj.matrix_parent_inverse = parent, kind, bone, inverse
        bpy.data.batch_remove(made)


@contextmanager
def _out_of_edit_mode(collections: Sequence[bpy.types.Collection]) -> Iterator[None]:
    """Leave Edit Mode for a while if something in these collections is edited: it would be written as it was before."""
    edited = any(obj.mode == "EDIT" for collection in collections for obj in collection.all_objects)
    try:
        if edited:
            bpy.ops.object.mode_set(mode="OBJECT")
        yield
    finally:
        if edited:
            bpy.ops.object.mode_set(mode="EDIT")


@contextmanager
def _all_evaluated(collections: Sequence[bpy.types.Collection]) -> Iterator[None]:
    """Hide nothing in these collections for a while, and let their armatures move.

    Viewports, renders and Rest Position each keep some exporter from what moves.
    """
    groups = {group for collection in collections for group in (collection, *collection.children_recursive)}
    objects = {obj for collection in collections for obj in collection.all_objects}
    hidden = [(each, each.hide_viewport, each.hide_render) for each in (*groups, *objects)]
    positions = [(armature, armature.pose_position) for armature in {o.data for o in objects if o.type == "ARMATURE"}]
    try:
        for each, _, _ in hidden:
            each.hide_viewport = each.hide_render = False
        for armature, _ in positions:
            armature.pose_position = "POSE"
        yield
    finally:
        for armature, position in positions:
            armature.pose_position = position
        for each, in_viewports, in_renders in hidden:
            each.hide_viewport, each.hide_render = in_viewports, in_renders


@contextmanager
def _actions_as_long_as(scene: bpy.types.Scene) -> Iterator[None]:
    """Let the actions of armatures last as long as the scene.

    One who comes late is late in a file of their own too, and exporters do not stop before keys between whole frames.
    """
    moving = [obj.animation_data for obj in scene.objects if obj.type == "ARMATURE" and obj.animation_data]
    stretched = [a for a in {data.action for data in moving} if a is not None and not a.use_frame_range]
    try:
        for action in stretched:
            action.use_frame_range = True
            action.frame_start, action.frame_end = scene.frame_start, scene.frame_end
        yield
    finally:
        for action in stretched:
            action.use_frame_range = False


@contextmanager
def _baked_meshes(scene: bpy.types.Scene) -> Iterator[None]:
    """Give the scene's objects with shape keys plain meshes for a while, the current mix in their vertices."""
    shaped = [(obj, obj.data, obj.data.name) for obj in scene.objects if obj.type == "MESH" and obj.data.shape_keys]
    baked = []
    try:
        for obj, mesh, name in shaped:
            vertices = mixed_vertices(obj)
            plain = bpy.data.meshes.new_from_object(obj)
            baked.append(plain)
            if mesh.library is None:  # else the name is another file's, and free in this one
                mesh.name = f"{name} shaped"
            plain.name = name
            plain.vertices.foreach_set("co", vertices.ravel())
            plain.update()
            obj.data = plain
        bpy.context.view_layer.update()
        yield
    finally:
        for obj, mesh, _ in shaped:
            obj.data = mesh
        bpy.data.batch_remove(baked)
        for _, mesh, name in shaped:
            if mesh.library is None:
                mesh.name = name


def _write(path: Path, writer) -> None:
    """Run ``writer(temporary path)`` and move its file into place; on failure nothing is left."""
    try:
        with written_beside(path) as temporary:
            temporary.unlink()  # Blender's writers differ in what they do with an existing file
            with formats.quiet():
                writer(temporary)
            if not temporary.is_file():
                raise OutputError(f"cannot write {path}: Blender wrote nothing")
    except (RuntimeError, OSError) as error:
        raise OutputError(f"cannot write {path}: {_reason(error)}") from error


def _reason(error: RuntimeError | OSError) -> str:
    """One sentence, and what to do. Of an exporter that fails Blender hands on the whole traceback, and its place."""
    if isinstance(error, OSError) and error.strerror:
        return reason(error)
    lines = [line for line in str(error).splitlines() if line and not line[0].isspace() and "Location: " not in line]
    last = lines[-1] if lines else type(error).__name__
    said = re.sub(r"^(?:\w*Error: )*(?:\[Errno \d+\] )?", "", last)
    return f"{said}; {'free some space or choose another folder' if '[Errno ' in last else 'try another format'}"
