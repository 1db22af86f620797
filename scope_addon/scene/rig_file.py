# SPDX-License-Identifier: GPL-3.0-or-later
"""Loading the user's rig from a .blend, .fbx or glTF file: one armature and the meshes that it
deforms; and exporting it, in place of the captured body, or the animated rig of the scene.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import bpy
from bpy.types import Collection, Key, Object
from mathutils import Matrix

from ...solver.body import Body
from ...solver.errors import InputError
from ..errors import UsageError
from ..motion import Motion
from ..notices import Notice, notice
from ..output_paths import check_output
from ..retarget.bone_map import PHALANGES, BoneMap, check_bone_count
from ..retarget.expression_map import ExpressionMap
from ..retarget.guess import from_humanoid
from ..retarget.rig_source import RigSource, files_beside_gltf
from .actions import fcurves_of, shape_key_path
from .build import BuildOptions, build_scene
from .datablocks import action_of, is_deformed_by, temporary_datablocks, with_data
from .export import formats
from .export.export import ExportOptions, export
from .export.export_states import temporary_scene
from .face_retarget import (
    captured_expressions,
    driven_keys,
    faces_of,
    guess_face_bones,
    only_bones_move,
    retarget_expressions,
)
from .rig_probe import at_rest, probe
from .rig_retarget import RetargetOptions, common_travel, retarget, usable_guess
from .timing import played_actions


def load_rig(source: RigSource, collection: Collection) -> Object:
    """Load the rig into ``collection`` of the active scene, without animation; return its armature.

    :raises InputError: when the file cannot be read, has no armature, or one of too many bones.
    :raises UsageError: when the choice of armature is ambiguous, or none has the given name.
    """
    path = source.path
    unit = 1.0  # Importers convert to metres.
    if path.suffix.lower() == ".blend":
        loaded, unit = _append(path)
    else:
        loaded = _import(path)
    rig = _choose(path, [obj for obj in loaded if obj.type == "ARMATURE"], source.armature)
    check_bone_count(str(path), len(rig.data.bones))
    _check_finite(path, rig)
    keep = with_meshes(rig, loaded)
    for obj in loaded:
        for other in obj.users_collection:
            other.objects.unlink(obj)
    rig.data.pose_position = "POSE"
    for obj in keep:
        if obj.parent is None:
            obj.matrix_basis = Matrix.Scale(unit, 4) @ obj.matrix_basis
        collection.objects.link(obj)
        obj.hide_viewport = obj.hide_render = False
        _remove_animation(obj)
    bpy.context.view_layer.update()
    return rig


def _check_finite(path: Path, rig: Object) -> None:
    matrices = [rig.matrix_world, *(bone.matrix_local for bone in rig.data.bones)]
    if not all(math.isfinite(value) for matrix in matrices for row in matrix for value in row):
        raise InputError(
            f"{path}: bones of '{rig.name}' have positions that are not numbers; "
            "export the rig again"
        )


def with_meshes(rig: Object, objects: Iterable[Object]) -> list[Object]:
    """Return the rig, those of the objects that are meshes deformed by it, and the parents of
    these.
    """
    widgets = {bone.custom_shape for bone in rig.pose.bones}
    keep = [
        rig,
        *(
            obj
            for obj in objects
            if obj.type == "MESH" and obj not in widgets and _moved_by(obj, rig)
        ),
    ]
    for obj in keep:
        while obj.parent is not None and obj.parent not in keep:
            keep.append(obj.parent)
            obj = obj.parent
    return keep


def check_rig(source: RigSource, *, fingers: bool = True) -> list[Path]:
    """Check, before a capture, that a motion can be retargeted to the rig.

    :param fingers: whether the motion will include fingers; otherwise, those of the rig are not
        checked.
    :return: the existing files that the rig's file refers to, such as its textures.
    :raises InputError: when the rig cannot be loaded, or its bones cannot be mapped or rotated.
    :raises UsageError: when the choice of armature is ambiguous, or none has the given name.
    """
    with temporary_datablocks(), temporary_scene("Checking a rig") as scene:
        rig = load_rig(source, scene.collection)
        bones = rig_bone_map(source, rig)
        moved = {
            b: part
            for b, part in bones.parts.items()
            if fingers or part.partition("_")[2] not in PHALANGES
        }
        with at_rest(rig):
            probe(rig, moved)
        return _files_referred_to(source.path)


def _files_referred_to(rig: Path) -> list[Path]:
    """Return the existing files of the session's images and libraries, and of a glTF file."""
    files = files_beside_gltf(rig) if rig.suffix.lower() == ".gltf" else []
    for block in (*bpy.data.images, *bpy.data.libraries):
        path = Path(bpy.path.abspath(block.filepath, library=block.library))
        if path.is_file():
            files.append(path)
    return files


def rig_bone_map(source: RigSource, rig: Object) -> BoneMap:
    """Return the given bone map, or else guess one.

    :raises InputError: when it does not match the rig, or a required part could not be guessed.
    """
    found = source.bone_map
    if found is None and source.humanoid:
        found = from_humanoid(source.humanoid, [bone.name for bone in rig.data.bones])
    try:
        if found is None or source.bone_map is None and not found.parts:
            found = usable_guess(rig)
        missing = [name for name in found.parts if name not in rig.data.bones]
        if missing:
            raise InputError(
                f"the bone map's '{missing[0]}' is not a bone of '{rig.name}'; correct the map"
            )
        found.check()
    except InputError as error:
        advice = "" if source.bone_map else "; give a map with --bone-map"
        raise InputError(f"{source.path}: {error}{advice}") from error
    return found


def _append(path: Path) -> tuple[list[Object], float]:
    """Return the objects of a .blend file, and the metres that a length of 1 stands for in it.

    :raises InputError: when Blender cannot read the file.
    """
    try:
        with formats.quiet(), bpy.data.libraries.load(str(path), link=False) as (there, here):
            here.objects = list(there.objects)
            here.scenes = list(there.scenes)
    except (OSError, RuntimeError) as error:
        raise InputError(
            f"{path}: Blender cannot read this file; save it again or choose another"
        ) from error
    scenes = [scene for scene in here.scenes if scene is not None]
    # A file has one unit as a rule; of several, none is known to be the rig's.
    units = {scene.unit_settings.scale_length for scene in scenes}
    for scene in scenes:
        bpy.data.scenes.remove(scene)
    unit = units.pop() if len(units) == 1 else 1.0
    return [obj for obj in here.objects if obj is not None], unit


def _import(path: Path) -> list[Object]:
    before = {obj.session_uid for obj in bpy.data.objects}
    try:
        with formats.quiet():
            if path.suffix.lower() == ".fbx":
                formats.enable_addon("io_scene_fbx")
                formats.call_operator(
                    bpy.ops.import_scene.fbx,
                    filepath=str(path),
                    use_anim=False,
                    ignore_leaf_bones=False,
                )
            else:
                formats.enable_addon("io_scene_gltf2")
                formats.call_operator(
                    bpy.ops.import_scene.gltf, filepath=str(path), disable_bone_shape=True
                )
    except Exception as error:  # importers written in Python raise any exception on a damaged file
        raise InputError(
            f"{path}: Blender cannot import this file; export it again or choose another"
        ) from error
    return [obj for obj in bpy.data.objects if obj.session_uid not in before]


def _choose(path: Path, rigs: list[Object], name: str) -> Object:
    """Choose the armature of a file.

    :param name: may be empty if there is only one.
    :raises InputError: when there is none, or it is linked from another file.
    :raises UsageError: when there are several, or none has that name.
    """
    rigs = sorted(rigs, key=lambda rig: rig.name)
    for rig in rigs:
        if rig.name == name:
            return rig
    linked = [
        obj
        for obj in bpy.data.objects
        if obj.type == "ARMATURE" and obj.library is not None and name in ("", obj.name)
    ]
    if linked and (name or not rigs):
        raise InputError(
            f"{path}: '{linked[0].name}' is linked from {linked[0].library.filepath}; choose that "
            "file, or make an override of it (Object > Library Override > Make) in this one"
        )
    if not rigs:
        raise InputError(
            f"{path}: there is no armature in this file; choose the file that holds your rig"
        )
    names = ", ".join(f"'{rig.name}'" for rig in rigs)
    if name:
        raise UsageError(
            f"{path} has no armature '{name}', only {names}; give one of them with --rig-object"
        )
    if len(rigs) > 1:
        raise UsageError(
            f"{path} has {len(rigs)} armatures, {names}; choose one with --rig-object NAME"
        )
    return rigs[0]


def _moved_by(obj: Object, rig: Object) -> bool:
    if is_deformed_by(obj, rig):
        return True
    while obj is not None and obj != rig:
        obj = obj.parent
    return obj is not None


def _remove_animation(obj: Object) -> None:
    """Remove the actions and NLA of an object, its data and its shape keys, of which those that
    moved go back to 0; drivers are kept.
    """
    for datablock in with_data(obj):
        animation = datablock.animation_data
        if animation is None:
            continue
        played = played_actions(datablock)
        animation.action = None
        for track in list(animation.nla_tracks):
            animation.nla_tracks.remove(track)
        if isinstance(datablock, Key):
            moved = {curve.data_path for action in played for curve in fcurves_of(action)}
            for block in datablock.key_blocks:
                if shape_key_path(block.name) in moved:
                    block.value = 0.0


def export_on_rig(
    motions: list[Motion],
    body: Body,
    paths: Sequence[Path],
    source: RigSource,
    build_options: BuildOptions,
    footage: Path | None = None,
    *,
    root: str = "bone",
    export_options: ExportOptions | None = None,
) -> tuple[list[Path], list[Notice]]:
    """Retarget every person's motion to a copy of the rig, write one or more files, and leave the
    session as it was.

    :param root: where the root motion goes, see ``RetargetOptions``.
    :return: the files written, and the warnings.
    :raises InputError: when the rig cannot be used; see ``load_rig``.
    :raises UsageError: when the choice of armature is ambiguous, a suffix unknown, or the
        expression map is not for the rig's meshes.
    :raises OutputError: when a file cannot be written.
    """
    for path in paths:
        check_output(path)
    written: list[Path] = []
    with temporary_datablocks(), temporary_scene("Retargeting"):
        result = build_scene(motions, body, footage, build_options)
        warnings = list(result.warnings)
        travel: float | None = None  # of one person: their own
        for number, person in enumerate(result.people, 1):
            rig = load_rig(source, result.collection)
            bones = rig_bone_map(source, rig)
            if len(motions) > 1:
                if travel is None:
                    travel = common_travel(
                        body, [each.motion.betas for each in result.people], rig, bones
                    )
                rig.name = f"{rig.name}_person{number}"
            betas = person.motion.betas
            rate = result.frame_rate
            faces = faces_of(with_meshes(rig, bpy.context.scene.objects))
            retargeting = RetargetOptions(
                root=root, face=_face_of_bones(rig, faces, source), travel=travel
            )
            warnings += retarget(
                person.armature, body, betas, rig, bones, rate, retargeting
            ).warnings
            warnings += _retarget_face(
                person.armature, faces, source, bones_move_it=retargeting.face is not None
            )
        bpy.data.batch_remove(
            [obj for person in result.people for obj in (person.armature, person.mesh)]
        )
        options = replace(export_options or ExportOptions(), warn=warnings.append)
        for path in paths:
            written += export(path, [result.collection], options=options)
    return written, warnings


def _face_of_bones(rig: Object, faces: Sequence[Object], source: RigSource) -> ExpressionMap | None:
    """Return the expression map if bones move the rig's face; a guess is made only where no shape
    keys do.
    """
    if source.expression_map is not None:
        return source.expression_map if source.expression_map.controls else None
    return guess_face_bones(rig) if only_bones_move(rig, faces) else None


def _retarget_face(
    armature: Object, faces: Sequence[Object], source: RigSource, *, bones_move_it: bool
) -> list[Notice]:
    """Retarget the captured expressions, if there are any, to the rig's meshes; return warnings.

    :param bones_move_it: whether bones show the expressions, so that there may be no shape keys.
    :raises UsageError: when an expression map was given, and no mesh has any of its shape keys.
    """
    captured = captured_expressions(armature)
    given = source.expression_map
    if captured is None or (bones_move_it and not (given and given.keys)):
        return []
    try:
        retarget_expressions(captured, faces, given, armature.name)
    except UsageError as error:
        if given is not None:
            raise
        return [notice("face_not_retargeted", reason=str(error))]
    return driven_keys(faces, given)


def export_rig(path: Path, rig: Object, options: ExportOptions) -> list[Path]:
    """Write an animated rig of the scene with the meshes that it deforms; return the files written.

    Its size is the one that it has in the unit of the scene.

    :param options: without a ``take``, the animation is named after the rig's action.
    :raises UsageError: when the suffix is unknown.
    :raises OutputError: when a file cannot be written.
    """
    action = action_of(rig)
    unit = bpy.context.scene.unit_settings.scale_length
    options = replace(
        options, take=options.take or (action.name if action else rig.name), unit=unit
    )
    collection = bpy.data.collections.new(rig.name)
    parts = with_meshes(rig, bpy.context.scene.objects)
    try:
        for obj in parts:
            below = obj.children_recursive
            # a parent of other objects would export them as well
            if rig not in below or set(below) <= set(parts):
                collection.objects.link(obj)
        return export(path, [collection], options=options)
    finally:
        bpy.data.collections.remove(collection)
