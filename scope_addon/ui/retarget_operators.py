# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that retarget a captured motion to the user's rig and captured expressions to a face,
and that guess, edit, save and load the bone map and the expression map.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import StringProperty

from ..errors import UsageError
from ..scene.datablocks import enter_object_mode
from .captured_person import PERSON, betas_of, body_of, captured_armature, captured_people
from .reporting import ReportingOperator, refuse, rpt_
from .retarget_maps import (
    EditListOperator,
    LoadMapOperator,
    SaveMapOperator,
    bones_move,
    fill_expressions,
    fill_list,
    guessed_map,
    has_targets,
    is_in_view_layer,
    listed_expressions,
    listed_map,
    listed_or_guessed,
)

if TYPE_CHECKING:
    from ..notices import Notice
    from ..retarget.expression_map import ExpressionMap
    from ..scene.rig_retarget import RetargetOptions, RetargetResult

_SIDE_OFFSET_M = (1.5, 0.0, 0.0)  # to the left of a person who faces the front view


class _RigOperator(ReportingOperator):
    """An operator on the chosen rig. Not registered"""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require a rig in the view layer."""
        rig = context.scene.scope_retarget.rig
        if rig is None:
            return refuse(cls, "Choose your rig first")
        return is_in_view_layer(cls, context, rig)


class SCOPE_OT_guess_bones(_RigOperator):
    """Assign the rig's bones to body parts by their names and rest pose"""

    bl_idname = "scope.guess_bones"
    bl_label = "Guess Bones"

    def work(self, context: bpy.types.Context) -> str:
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
    def poll(cls, context: bpy.types.Context) -> bool:
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

    def work(self, context: bpy.types.Context) -> str:
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


def retarget_to_chosen_rig(context: bpy.types.Context, source: bpy.types.Object) -> RetargetResult:
    """Retarget a captured armature to the rig of the settings, and show both as the settings say.

    :raises ScopeError: the rig or its bones cannot be used; nothing is changed.
    """
    from ..scene.rig_retarget import retarget, usable_guess
    from ..scene.timing import keyed_rate
    from ..scene.visibility import hide, select_only, show, world_matrix

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


def face_map(settings: bpy.types.PropertyGroup) -> ExpressionMap | None:
    """Return the expression map if the chosen face is the rig's own, which its bones move;
    otherwise None.
    """
    if settings.face is None or settings.face != settings.rig or not bones_move(settings.face):
        return None
    return listed_or_guessed(settings)


def retarget_options(
    settings: bpy.types.PropertyGroup, face: ExpressionMap | None = None, metre: float = 1.0
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

    def save(self, settings: bpy.types.PropertyGroup, path: str) -> None:
        """Write the list."""
        from ..retarget.bone_map import save_bone_map

        save_bone_map(listed_map(settings), path)


class SCOPE_OT_load_bone_map(_RigOperator, LoadMapOperator):
    """Load a bone map from a JSON file"""

    bl_idname = "scope.load_bone_map"
    bl_label = "Load Bone Map"

    def load(self, settings: bpy.types.PropertyGroup, path: str) -> None:
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
    def poll(cls, context: bpy.types.Context) -> bool:
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

    def work(self, context: bpy.types.Context) -> str:
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
    def poll(cls, context: bpy.types.Context) -> bool:
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

    def work(self, context: bpy.types.Context) -> str:
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

    def save(self, settings: bpy.types.PropertyGroup, path: str) -> None:
        """Write the list."""
        from ..retarget.expression_map import save_expression_map

        save_expression_map(listed_expressions(settings), path)


class SCOPE_OT_load_expression_map(_FaceOperator, LoadMapOperator):
    """Load an expression map from a JSON file"""

    bl_idname = "scope.load_expression_map"
    bl_label = "Load Expression Map"

    def load(self, settings: bpy.types.PropertyGroup, path: str) -> None:
        """Read the list."""
        from ..retarget.expression_map import load_expression_map

        fill_expressions(settings, load_expression_map(path))


class SCOPE_OT_edit_expression_pair(_FaceOperator, EditListOperator):
    """Add an entry to the expression map, or remove the selected one"""

    bl_idname = "scope.edit_expression_pair"
    bl_label = "Edit Expression Map"
    entries = "face_pairs"
    active = "face_active"

    def add(self, settings: bpy.types.PropertyGroup) -> bpy.types.PropertyGroup:
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
