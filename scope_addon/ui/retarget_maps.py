# SPDX-License-Identifier: GPL-3.0-or-later
"""The bone map and the expression map as the panel's lists show them, and what the operators on
them share: their poll, their files, and editing their lists.

The chosen face is a mesh with shape keys, or a rig whose bones move the face.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, ClassVar

import bpy
from bpy.props import EnumProperty, StringProperty

from ...solver.errors import ScopeError
from ..scene.datablocks import is_in_layer, is_person
from .file_field import SavingOperator, output_file
from .reporting import ReportingOperator, refuse, rpt_

if TYPE_CHECKING:
    from ..retarget.bone_map import BoneMap
    from ..retarget.expression_map import ExpressionMap

SHAPE_KEY = "key"  # the channel of entries of shape keys


def is_in_view_layer(
    cls: type[bpy.types.Operator], context: bpy.types.Context, chosen: bpy.types.Object
) -> bool:
    """Return whether an object that was chosen can be animated here: one that is deleted stays
    chosen.
    """
    if is_in_layer(context.view_layer, chosen):
        return True
    return refuse(
        cls,
        "'{rig}' is not in the scene's view layer: add it to the scene, or enable its "
        "collection in the Outliner",
        rig=chosen.name,
    )


class MapFileOperator(ReportingOperator):
    """An operator on the file of a map, which the file browser asks for. Not registered."""

    filepath: StringProperty(subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SaveMapOperator(SavingOperator, MapFileOperator):
    """Writes a map; a subclass has ``save``, and the file's usual name. Not registered."""

    def suffix(self) -> str:
        """Return that of maps."""
        return ".json"

    def work(self, context: bpy.types.Context) -> str:
        """Write the file.

        :raises UsageError: the file has no name, or is beside a .blend file that was never saved.
        """
        path = str(output_file(self.filepath, ".json"))
        self.save(context.scene.scope_retarget, path)
        return rpt_("Saved {file}", file=path)

    if TYPE_CHECKING:  # implemented by each operator

        def save(self, settings: bpy.types.PropertyGroup, path: str) -> None:
            """Write the map of the settings to a path.

            :raises InputError: it could not be loaded again.
            """


class LoadMapOperator(MapFileOperator):
    """Reads a map; a subclass has ``load``. Not registered."""

    def work(self, context: bpy.types.Context) -> str:
        """Fill the list."""
        self.load(context.scene.scope_retarget, bpy.path.abspath(self.filepath))
        return rpt_("Loaded {file}", file=self.filepath)

    if TYPE_CHECKING:  # implemented by each operator

        def load(self, settings: bpy.types.PropertyGroup, path: str) -> None:
            """Fill the list of the settings from a path."""


class EditListOperator(ReportingOperator):
    """Adds an entry to the list of a map, or removes the active one. Not registered."""

    entries: ClassVar[str]  # the list, of the settings
    active: ClassVar[str]  # the number of its active entry, of the settings

    action: EnumProperty(
        items=(("ADD", "Add", "Add an entry"), ("REMOVE", "Remove", "Remove the selected entry"))
    )

    if TYPE_CHECKING:  # implemented by each operator

        def message(self, count: int) -> str:
            """Return how many entries there are now."""

    def work(self, context: bpy.types.Context) -> str:
        """Change the list."""
        settings = context.scene.scope_retarget
        listed = getattr(settings, self.entries)
        active = getattr(settings, self.active)
        if self.action == "ADD":
            self.add(settings)
            active = len(listed) - 1
        elif len(listed):
            listed.remove(active)
            active = max(0, min(active, len(listed) - 1))
        setattr(settings, self.active, active)
        return self.message(len(listed))

    def add(self, settings: bpy.types.PropertyGroup) -> bpy.types.PropertyGroup:
        """Add an entry, and return it."""
        return getattr(settings, self.entries).add()


def guess_into_list(settings: bpy.types.PropertyGroup) -> None:
    """Fill the list with a guess for the chosen rig; leave it empty if nothing can be guessed.

    :param settings: of retargeting, with a rig.
    """
    from ..scene.rig_retarget import guess_bone_map

    settings.pairs.clear()
    try:
        fill_list(settings, guess_bone_map(settings.rig))
    except ScopeError:
        return  # the operators report why


def fill_list(settings: bpy.types.PropertyGroup, bone_map: BoneMap) -> None:
    """Fill the list with a map, in the order of the body's parts."""
    from ..retarget.bone_map import PARTS

    settings.pairs.clear()
    for bone, part in sorted(bone_map.parts.items(), key=lambda pair: PARTS.index(pair[1])):
        pair = settings.pairs.add()
        pair.bone = bone
        pair.part = part
        pair.confidence = bone_map.confidence.get(bone, 1.0)
    settings.active = 0


def listed_map(settings: bpy.types.PropertyGroup) -> BoneMap:
    """Return the list as a map; entries without a bone or a part are left out."""
    from ..retarget.bone_map import BoneMap

    pairs = [pair for pair in settings.pairs if pair.bone and pair.part]
    return BoneMap(
        {pair.bone: pair.part for pair in pairs}, {pair.bone: pair.confidence for pair in pairs}
    )


def common_prefix(bones: list[str]) -> str:
    """Return what all names begin with, up to a separator, such as ``mixamorig:``; empty if there
    is nothing.
    """
    shared = os.path.commonprefix(bones) if len(bones) > 1 else ""
    return shared[: 1 + max(shared.rfind(separator) for separator in ":_. ")]


def bones_move(face: bpy.types.Object | None) -> bool:
    """Return whether a face is a rig whose bones move it, and Scope knows which."""
    from ..scene.face_retarget import has_bone_face

    return face is not None and not is_person(face) and has_bone_face(face)


def has_targets(face: bpy.types.Object | None) -> bool:
    """Return whether an object is a face: it has shape keys, or bones move it."""
    if face is not None and face.type == "MESH":
        return face.data.shape_keys is not None
    return bones_move(face)


def targets_of(face: bpy.types.Object) -> bpy.types.bpy_prop_collection:
    """Return a face's bones or shape keys."""
    return face.data.bones if face.type == "ARMATURE" else face.data.shape_keys.key_blocks


def face_of_rig(rig: bpy.types.Object) -> bpy.types.Object | None:
    """Return the rig if its bones move its face, and no shape keys of its meshes with names that
    are known.
    """
    from ..scene.face_retarget import faces_of, only_bones_move
    from ..scene.rig_file import with_meshes

    if not bones_move(rig):
        return None
    return (
        rig if only_bones_move(rig, faces_of(with_meshes(rig, bpy.context.scene.objects))) else None
    )


def guessed_map(face: bpy.types.Object) -> ExpressionMap:
    """Return the map that the names of a face's shape keys or bones suggest."""
    from ..retarget.expression_map import guess_expression_map
    from ..scene.face_retarget import guess_face_bones, key_names

    return guess_face_bones(face) if bones_move(face) else guess_expression_map(key_names([face]))


def listed_or_guessed(settings: bpy.types.PropertyGroup) -> ExpressionMap:
    """Return the list as a map or, if it is empty, the map that the names of the chosen face
    suggest.
    """
    return listed_expressions(settings) if len(settings.face_pairs) else guessed_map(settings.face)


def fill_expressions(settings: bpy.types.PropertyGroup, expression_map: ExpressionMap) -> None:
    """Fill the list with a map, one entry for each expression of a shape key or of a control's
    channel.
    """
    settings.face_pairs.clear()
    entries = [(key, SHAPE_KEY, factors) for key, factors in expression_map.keys.items()]
    entries += [
        (bone, channel, factors)
        for bone, channels in expression_map.controls.items()
        for channel, factors in channels.items()
    ]
    for key, channel, factors in entries:
        for expression, factor in factors.items():
            pair = settings.face_pairs.add()
            pair.key = key
            pair.channel = channel
            pair.expression = expression
            pair.factor = factor
    settings.face_active = 0


def listed_expressions(settings: bpy.types.PropertyGroup) -> ExpressionMap:
    """Return the list as a map; entries without a shape key or control, or without an expression,
    are left out.
    """
    from ..retarget.expression_map import ExpressionMap

    out = ExpressionMap({})
    for pair in settings.face_pairs:
        if not pair.key or not pair.expression:
            continue
        if pair.channel == SHAPE_KEY:
            factors = out.keys.setdefault(pair.key, {})
        else:
            factors = out.controls.setdefault(pair.key, {}).setdefault(pair.channel, {})
        factors[pair.expression] = round(pair.factor, 6)
    return out
