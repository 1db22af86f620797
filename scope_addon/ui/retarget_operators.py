# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that retarget a captured motion to the user's rig and captured expressions to a face,
and that guess, edit, save and load the bone map and the expression map, which the panel lists.

The chosen face is a mesh with shape keys, or a rig whose bones move the face.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, ClassVar

import bpy
from bpy.props import EnumProperty, StringProperty
from bpy.types import Context, Event, Object, Operator, PropertyGroup

from ...solver.errors import ScopeError
from ..errors import UsageError
from ..scene.datablocks import enter_object_mode, is_in_layer, is_person
from ..scene.visibility import hide, select_only, show, world_matrix
from .captured_person import PERSON, betas_of, body_of, captured_armature, captured_people
from .file_field import SavingOperator, output_file
from .reporting import ReportingOperator, refuse, rpt_

if TYPE_CHECKING:
    from ..notices import Notice
    from ..retarget.bone_map import BoneMap
    from ..retarget.expression_map import ExpressionMap
    from ..scene.rig_retarget import RetargetOptions, RetargetResult

SHAPE_KEY = "key"  # the channel of entries of shape keys
_SIDE_OFFSET_M = (1.5, 0.0, 0.0)  # to the left of a person who faces the front view


def is_in_view_layer(cls: type[Operator], context: Context, chosen: Object) -> bool:
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

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for the file."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SaveMapOperator(SavingOperator, MapFileOperator):
    """Writes a map; a subclass has ``save``, and the file's usual name. Not registered."""

    def suffix(self) -> str:
        """Return that of maps."""
        return ".json"

    def work(self, context: Context) -> str:
        """Write the file.

        :raises UsageError: the file has no name, or is beside a .blend file that was never saved.
        """
        path = str(output_file(self.filepath, ".json"))
        self.save(context.scene.scope_retarget, path)
        return rpt_("Saved {file}", file=path)

    if TYPE_CHECKING:  # implemented by each operator

        def save(self, settings: PropertyGroup, path: str) -> None:
            """Write the map of the settings to a path.

            :raises InputError: it could not be loaded again.
            """


class LoadMapOperator(MapFileOperator):
    """Reads a map; a subclass has ``load``. Not registered."""

    def work(self, context: Context) -> str:
        """Fill the list."""
        self.load(context.scene.scope_retarget, bpy.path.abspath(self.filepath))
        return rpt_("Loaded {file}", file=self.filepath)

    if TYPE_CHECKING:  # implemented by each operator

        def load(self, settings: PropertyGroup, path: str) -> None:
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

    def work(self, context: Context) -> str:
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

    def add(self, settings: PropertyGroup) -> PropertyGroup:
        """Add an entry, and return it."""
        return getattr(settings, self.entries).add()


def guess_into_list(settings: PropertyGroup) -> None:
    """Fill the list with a guess for the chosen rig; leave it empty if nothing can be guessed.

    :param settings: of retargeting, with a rig.
    """
    from ..scene.rig_retarget import guess_bone_map

    settings.pairs.clear()
    try:
        fill_list(settings, guess_bone_map(settings.rig))
    except ScopeError:
        return  # the operators report why


def fill_list(settings: PropertyGroup, bone_map: BoneMap) -> None:
    """Fill the list with a map, in the order of the body's parts."""
    from ..retarget.bone_map import PARTS

    settings.pairs.clear()
    for bone, part in sorted(bone_map.parts.items(), key=lambda pair: PARTS.index(pair[1])):
        pair = settings.pairs.add()
        pair.bone = bone
        pair.part = part
        pair.confidence = bone_map.confidence.get(bone, 1.0)
    settings.active = 0


def listed_map(settings: PropertyGroup) -> BoneMap:
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


def bones_move(face: Object | None) -> bool:
    """Return whether a face is a rig whose bones move it, and Scope knows which."""
    from ..scene.face_retarget import has_bone_face

    return face is not None and not is_person(face) and has_bone_face(face)


def has_targets(face: Object | None) -> bool:
    """Return whether an object is a face: it has shape keys, or bones move it."""
    if face is not None and face.type == "MESH":
        return face.data.shape_keys is not None
    return bones_move(face)


def targets_of(face: Object) -> bpy.types.bpy_prop_collection:
    """Return a face's bones or shape keys."""
    return face.data.bones if face.type == "ARMATURE" else face.data.shape_keys.key_blocks


def face_of_rig(rig: Object) -> Object | None:
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


def guessed_map(face: Object) -> ExpressionMap:
    """Return the map that the names of a face's shape keys or bones suggest."""
    from ..retarget.expression_map import guess_expression_map
    from ..scene.face_retarget import guess_face_bones, key_names

    return guess_face_bones(face) if bones_move(face) else guess_expression_map(key_names([face]))


def listed_or_guessed(settings: PropertyGroup) -> ExpressionMap:
    """Return the list as a map or, if it is empty, the map that the names of the chosen face
    suggest.
    """
    return listed_expressions(settings) if len(settings.face_pairs) else guessed_map(settings.face)


def fill_expressions(settings: PropertyGroup, expression_map: ExpressionMap) -> None:
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


def listed_expressions(settings: PropertyGroup) -> ExpressionMap:
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


class _RigOperator(ReportingOperator):
    """An operator on the chosen rig. Not registered"""

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a rig in the view layer."""
        rig = context.scene.scope_retarget.rig
        if rig is None:
            return refuse(cls, "Choose your rig first")
        return is_in_view_layer(cls, context, rig)


class SCOPE_OT_guess_bones(_RigOperator):
    """Assign the rig's bones to body parts by their names and rest pose"""

    bl_idname = "scope.guess_bones"
    bl_label = "Guess Bones"

    def work(self, context: Context) -> str:
        """Fill the list."""
        from ..scene.rig_retarget import guess_bone_map, map_notices

        settings = context.scene.scope_retarget
        found = guess_bone_map(settings.rig)
        fill_list(settings, found)
        count = len(found.parts)
        message = rpt_(
            "Found {count} bone; check the list"
            if count == 1
            else "Found {count} bones; check the list",
            count=count,
        )
        return self.report_all(message, map_notices(settings.rig, found))


class SCOPE_OT_retarget(_RigOperator):
    """Transfer the captured motion to your rig"""

    bl_description = (
        "Transfer the captured motion to your rig, as a new action. One of the same capture is "
        "replaced if unchanged"
    )
    bl_idname = "scope.retarget"
    bl_label = "Retarget"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a rig that can be animated in this file, and a captured person."""
        if not super().poll(context):
            return False
        rig = context.scene.scope_retarget.rig
        if rig.library is not None:
            return refuse(
                cls,
                "'{rig}' is linked from {file}, so its motion would not be saved in this file: "
                "make an override of "
                "it (Object > Library Override > Make)",
                rig=rig.name,
                file=rig.library.filepath,
            )
        if captured_armature(context) is None:
            return refuse(
                cls,
                "Several people are captured: select the armature of the one whose motion to "
                "retarget"
                if captured_people(context)
                else "The scene contains no capture yet",
            )
        return True

    def work(self, context: Context) -> str:
        """Write the rig's keys."""
        settings = context.scene.scope_retarget
        source = captured_armature(context)
        assert source is not None  # checked by poll
        result = retarget_to_chosen_rig(context, source)
        message = rpt_(
            "'{rig}' is now animated by the action '{action}'"
            if settings.root == "in-place"  # where it has no path to scale
            else "'{rig}' is now animated by the action '{action}', with positions on the floor "
            "scaled by {scale:.3f}",
            rig=settings.rig.name,
            action=result.action.name,
            scale=result.travel,
        )
        return self.report_all(message, result.warnings)


def retarget_to_chosen_rig(context: Context, source: Object) -> RetargetResult:
    """Retarget a captured armature to the rig of the settings, and show both as the settings say.

    :raises ScopeError: the rig or its bones cannot be used; nothing is changed.
    """
    from ..scene.rig_retarget import retarget, usable_guess
    from ..scene.timing import keyed_rate

    settings = context.scene.scope_retarget
    body = body_of(source)
    face = face_map(settings)
    guessed = None if len(settings.pairs) else usable_guess(settings.rig)
    result = retarget(
        source,
        body,
        betas_of(source, body),
        settings.rig,
        guessed or listed_map(settings),
        keyed_rate(source, context.scene),
        retarget_options(settings, face, world_matrix(source).median_scale),
    )
    if guessed is not None:  # not before: what fails changes nothing
        fill_list(settings, guessed)
    if face is not None and not len(settings.face_pairs):
        fill_expressions(settings, face)
    settings.rig[PERSON] = source
    if settings.captured == "hide":
        # A hidden object cannot be selected.
        enter_object_mode(context.view_layer)
        select_only(context.view_layer, settings.rig)
        hide(source, context.view_layer)
    else:
        show(source, context.view_layer)
    return result


def face_map(settings: PropertyGroup) -> ExpressionMap | None:
    """Return the expression map if the chosen face is the rig's own, which its bones move;
    otherwise None.
    """
    if settings.face is None or settings.face != settings.rig or not bones_move(settings.face):
        return None
    return listed_or_guessed(settings)


def retarget_options(
    settings: PropertyGroup, face: ExpressionMap | None = None, metre: float = 1.0
) -> RetargetOptions:
    """Return the options of the settings.

    :param face: the expression map of the bones that move the rig's face, if any.
    :param metre: of the captured person, in units of the scene, in which they may be scaled.
    """
    from ..scene.rig_retarget import RetargetOptions

    offset = (0.0, 0.0, 0.0)
    if settings.captured == "beside":
        x, y, z = _SIDE_OFFSET_M
        offset = metre * x, metre * y, metre * z
    travel = settings.travel or None
    return RetargetOptions(
        feet=settings.feet, root=settings.root, offset=offset, face=face, travel=travel
    )


class SCOPE_OT_save_bone_map(_RigOperator, SaveMapOperator):
    """Save the bone map as a JSON file for similar rigs"""

    bl_idname = "scope.save_bone_map"
    bl_label = "Save Bone Map"

    filepath: StringProperty(subtype="FILE_PATH", default="bones.json")

    def save(self, settings: PropertyGroup, path: str) -> None:
        """Write the list."""
        from ..retarget.bone_map import save_bone_map

        save_bone_map(listed_map(settings), path)


class SCOPE_OT_load_bone_map(_RigOperator, LoadMapOperator):
    """Load a bone map from a JSON file"""

    bl_idname = "scope.load_bone_map"
    bl_label = "Load Bone Map"

    def load(self, settings: PropertyGroup, path: str) -> None:
        """Read the list."""
        from ..retarget.bone_map import load_bone_map

        fill_list(settings, load_bone_map(path))


class SCOPE_OT_edit_bone_pair(_RigOperator, EditListOperator):
    """Add an entry to the bone map, or remove the selected one"""

    bl_idname = "scope.edit_bone_pair"
    bl_label = "Edit Bone Map"
    entries = "pairs"
    active = "active"

    def message(self, count: int) -> str:
        """Return how many bones are listed."""
        return rpt_("{count} bone" if count == 1 else "{count} bones", count=count)


class _FaceOperator(ReportingOperator):
    """An operator on the chosen face. Not registered"""

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a mesh with shape keys, or a rig whose face is known, in the view layer."""
        face = context.scene.scope_retarget.face
        if not has_targets(face):
            return refuse(cls, "Choose a mesh with shape keys, or a rig with face controls, first")
        return is_in_view_layer(cls, context, face)


class SCOPE_OT_guess_expressions(_FaceOperator):
    """Assign the face's shape keys"""

    bl_description = (
        "Assign the face's shape keys, named as by ARKit, Oculus or VRM, or the controls of a "
        "known rig to expressions"
    )
    bl_idname = "scope.guess_expressions"
    bl_label = "Guess Expressions"

    def work(self, context: Context) -> str:
        """Fill the list.

        :raises UsageError: no name is known; the list stays as it is.
        """
        settings = context.scene.scope_retarget
        found = guessed_map(settings.face)
        if not found.keys and not found.controls:
            raise UsageError(
                f"no shape key of '{settings.face.name}' has a name of ARKit, Oculus or VRM; add "
                "entries to the list"
            )
        fill_expressions(settings, found)
        if found.controls:
            return rpt_("Found {count} controls; check the list", count=len(found.controls))
        count = len(found.keys)
        return rpt_(
            "Found {count} shape key; check the list"
            if count == 1
            else "Found {count} shape keys; check the list",
            count=count,
        )


class SCOPE_OT_retarget_face(_FaceOperator):
    """Transfer the captured expressions to the mesh's shape keys or the rig's face"""

    bl_description = (
        "Transfer the captured expressions to the mesh's shape keys or the rig's face, as a new "
        "action"
    )
    bl_idname = "scope.retarget_face"
    bl_label = "Retarget Face"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a face that can be animated in this file, and a captured person."""
        if not super().poll(context):
            return False
        face = context.scene.scope_retarget.face
        # of what is animated
        library = face.library if face.type == "ARMATURE" else face.data.library
        if library is not None:
            return refuse(
                cls,
                "'{mesh}' is linked from {file}, so its keyframes would not be saved in this "
                "file: make it local",
                mesh=face.name,
                file=library.filepath,
            )
        if captured_armature(context) is None:
            return refuse(cls, "Select the captured person whose face to retarget")
        return True

    def work(self, context: Context) -> str:
        """Write the keys.

        :raises UsageError: the person's face was not captured, or no shape key or control is
            mapped.
        """
        from ..scene.face_retarget import (
            captured_expressions,
            driven_keys,
            retarget_expressions,
            retarget_face_bones,
        )

        settings = context.scene.scope_retarget
        source = captured_armature(context)
        assert source is not None  # checked by poll
        captured = captured_expressions(source)
        if captured is None:
            raise UsageError(
                f"the face of '{source.name}' was not captured; capture again with Face"
            )
        chosen = listed_or_guessed(settings)
        warnings: list[Notice] = []
        if bones_move(settings.face):
            action = retarget_face_bones(captured, settings.face, chosen, source.name)
        else:
            (action,) = retarget_expressions(captured, [settings.face], chosen, source.name)
            warnings = driven_keys([settings.face], chosen)
        if not len(settings.face_pairs):
            fill_expressions(settings, chosen)
        message = rpt_(
            "'{mesh}' is now animated by the action '{action}'",
            mesh=settings.face.name,
            action=action.name,
        )
        return self.report_all(message, warnings)


class SCOPE_OT_save_expression_map(_FaceOperator, SaveMapOperator):
    """Save the expression map as a JSON file for similar faces"""

    bl_idname = "scope.save_expression_map"
    bl_label = "Save Expression Map"

    filepath: StringProperty(subtype="FILE_PATH", default="expressions.json")

    def save(self, settings: PropertyGroup, path: str) -> None:
        """Write the list."""
        from ..retarget.expression_map import save_expression_map

        save_expression_map(listed_expressions(settings), path)


class SCOPE_OT_load_expression_map(_FaceOperator, LoadMapOperator):
    """Load an expression map from a JSON file"""

    bl_idname = "scope.load_expression_map"
    bl_label = "Load Expression Map"

    def load(self, settings: PropertyGroup, path: str) -> None:
        """Read the list."""
        from ..retarget.expression_map import load_expression_map

        fill_expressions(settings, load_expression_map(path))


class SCOPE_OT_edit_expression_pair(_FaceOperator, EditListOperator):
    """Add an entry to the expression map, or remove the selected one"""

    bl_idname = "scope.edit_expression_pair"
    bl_label = "Edit Expression Map"
    entries = "face_pairs"
    active = "face_active"

    def add(self, settings: PropertyGroup) -> PropertyGroup:
        """Add an entry of the kind that the face has."""
        entry = super().add(settings)
        if bones_move(settings.face):
            entry.channel = "up"
        return entry

    def message(self, count: int) -> str:
        """Return how many entries there are."""
        return rpt_("{count} entry" if count == 1 else "{count} entries", count=count)


CLASSES = (
    SCOPE_OT_guess_bones,
    SCOPE_OT_retarget,
    SCOPE_OT_save_bone_map,
    SCOPE_OT_load_bone_map,
    SCOPE_OT_edit_bone_pair,
    SCOPE_OT_guess_expressions,
    SCOPE_OT_retarget_face,
    SCOPE_OT_save_expression_map,
    SCOPE_OT_load_expression_map,
    SCOPE_OT_edit_expression_pair,
)
