# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that retarget captured expressions to a face, and that guess, edit, save and load the
expression map.
"""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty, StringProperty

from ..captured_person import captured_armature
from ..reporting import ReportingOperator, rpt_, tip_
from .face_list import (
    bones_move,
    fill_expressions,
    guessed_map,
    has_targets,
    listed_expressions,
    listed_or_guessed,
)
from .map_operators import LoadMapOperator, SaveMapOperator, edit_list, is_in_view_layer


class _FaceOperator(ReportingOperator):
    """An operator on the chosen face. Not registered"""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require a mesh with shape keys, or a rig whose face is known, in the view layer."""
        face = context.scene.scope_retarget.face
        if not has_targets(face):
            cls.poll_message_set(
                tip_("Choose a mesh with shape keys, or a rig with face controls, first")
            )
            return False
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
        from ...errors import UsageError

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
            cls.poll_message_set(
                tip_(
                    "'{mesh}' is linked from {file}, so its keyframes would not be saved in this "
                    "file: make it local",
                    mesh=face.name,
                    file=library.filepath,
                )
            )
            return False
        if captured_armature(context) is None:
            cls.poll_message_set(tip_("Select the captured person whose face to retarget"))
            return False
        return True

    def work(self, context: bpy.types.Context) -> str:
        """Write the keys.

        :raises UsageError: the person's face was not captured, or no shape key or control is
            mapped.
        """
        from ...errors import UsageError
        from ...scene.rigs.face_bones import retarget_face_bones
        from ...scene.rigs.face_retarget import captured_expressions, retarget_expressions

        settings = context.scene.scope_retarget
        source = captured_armature(context)
        assert source is not None  # checked by poll
        captured = captured_expressions(source)
        if captured is None:
            raise UsageError(
                f"the face of '{source.name}' was not captured; capture again with Face"
            )
        chosen = listed_or_guessed(settings)
        if bones_move(settings.face):
            action = retarget_face_bones(captured, settings.face, chosen, source.name)
        else:
            (action,) = retarget_expressions(captured, [settings.face], chosen, source.name)
        if not len(settings.face_pairs):
            fill_expressions(settings, chosen)
        return rpt_(
            "'{mesh}' is now animated by the action '{action}'",
            mesh=settings.face.name,
            action=action.name,
        )


class SCOPE_OT_save_expression_map(_FaceOperator, SaveMapOperator):
    """Save the expression map as a JSON file for similar faces"""

    bl_idname = "scope.save_expression_map"
    bl_label = "Save Expression Map"

    filepath: StringProperty(subtype="FILE_PATH", default="expressions.json")

    def save(self, settings: bpy.types.PropertyGroup, path: str) -> None:
        """Write the list."""
        from ...retarget.expression_map import save_expression_map

        save_expression_map(listed_expressions(settings), path)


class SCOPE_OT_load_expression_map(_FaceOperator, LoadMapOperator):
    """Load an expression map from a JSON file"""

    bl_idname = "scope.load_expression_map"
    bl_label = "Load Expression Map"

    def load(self, settings: bpy.types.PropertyGroup, path: str) -> None:
        """Read the list."""
        from ...retarget.expression_map import load_expression_map

        fill_expressions(settings, load_expression_map(path))


class SCOPE_OT_edit_expression_pair(_FaceOperator):
    """Add an entry to the expression map, or remove the selected one"""

    bl_idname = "scope.edit_expression_pair"
    bl_label = "Edit Expression Map"

    action: EnumProperty(
        items=(("ADD", "Add", "Add an entry"), ("REMOVE", "Remove", "Remove the selected entry"))
    )

    def work(self, context: bpy.types.Context) -> str:
        """Change the list."""
        settings = context.scene.scope_retarget
        settings.face_active = edit_list(self.action, settings.face_pairs, settings.face_active)
        if self.action == "ADD" and bones_move(settings.face):
            settings.face_pairs[settings.face_active].channel = "up"
        count = len(settings.face_pairs)
        return rpt_("{count} entry" if count == 1 else "{count} entries", count=count)


CLASSES = (
    SCOPE_OT_guess_expressions,
    SCOPE_OT_retarget_face,
    SCOPE_OT_save_expression_map,
    SCOPE_OT_load_expression_map,
    SCOPE_OT_edit_expression_pair,
)
