# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators on the action of a captured person, or of a rig with their motion: take name, NLA."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from ..capture.captures import show_again, shown_capture
from ..captured_person import PERSON, captured_armature
from ..reporting import ReportingOperator, rpt_, tip_
from ..view import comparison


def animated_armature(context: bpy.types.Context) -> bpy.types.Object | None:
    """Return the active rig with captured motion, or else the active captured armature; None
    without one.
    """
    active = context.view_layer.objects.active if context.view_layer else None
    return active if active is not None and active.get(PERSON) else captured_armature(context)


class ActionOperator(ReportingOperator):
    """An operator on the action of an armature with captured motion. Not registered"""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require an armature with captured motion, which is stored in this file and has an
        action.
        """
        armature = animated_armature(context)
        if armature is None:
            cls.poll_message_set(tip_("Select the armature of a capture first"))
            return False
        if armature.library is not None:
            file = armature.library.filepath
            cls.poll_message_set(
                tip_("'{name}' is linked from {file}: make it local", name=armature.name, file=file)
            )
            return False
        if armature.animation_data is None or armature.animation_data.action is None:
            name = armature.name
            cls.poll_message_set(
                tip_("'{name}' has no action; choose one in the Action Editor", name=name)
            )
            return False
        return True


class SCOPE_OT_push_to_nla(ActionOperator):
    """Move the motion to a new track of the Nonlinear Animation editor"""

    bl_description = (
        "Move the motion to a new track of the Nonlinear Animation editor, where takes are mixed "
        "and repeated"
    )
    bl_idname = "scope.push_to_nla"
    bl_label = "Push to NLA"

    def work(self, context: bpy.types.Context) -> str:
        """Add the track, and those of the root object and of the face, which the motion's strips
        are moved with.

        :raises UsageError: the armature is in Tweak Mode.
        """
        from ...errors import UsageError
        from ...scene.animation_data.actions import animated_together, push_to_nla
        from ...scene.character.root_object import root_object

        armature = animated_armature(context)
        assert armature is not None  # checked by poll
        moved = animated_together(armature, root_object(armature))
        for block in moved:
            if block.animation_data.use_tweak_mode:
                raise UsageError(
                    f"'{block.name}' is in the NLA's Tweak Mode; leave it (key Tab) first"
                )
        strip, *_ = [push_to_nla(block) for block in moved]
        return rpt_(
            "'{strip}' is now a strip of {armature}'s NLA; to edit its keys, enter Tweak Mode (key "
            "Tab)",
            strip=strip.name,
            armature=armature.name,
        )


class CaptureOperator(ReportingOperator):
    """An operator on the capture that the panel shows. Not registered"""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require a capture that is stored in this file."""
        collection = context.scene.scope.result.collection
        if collection is None:
            cls.poll_message_set(tip_("The scene contains no capture yet"))
            return False
        if collection.library is not None:
            file = collection.library.filepath
            cls.poll_message_set(
                tip_("The capture is linked from {file}: make it local", file=file)
            )
            return False
        return True


class SCOPE_OT_rename_take(CaptureOperator):
    """Rename the capture with its objects and actions; exported animation has the same name"""

    bl_idname = "scope.rename_take"
    bl_label = "Rename Take"

    name: StringProperty(name="Name", description="New name of the take")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the name."""
        self.name = context.scene.scope.result.collection.name
        outcome: set[str] = context.window_manager.invoke_props_dialog(self)
        return outcome

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw the name, which is typed over at once."""
        self.layout.activate_init = True
        self.layout.prop(self, "name", text="")

    def work(self, context: bpy.types.Context) -> str:
        """Rename everything whose name begins with the take's.

        :raises UsageError: the name is empty.
        """
        from ...errors import UsageError
        from ...scene.datablocks import short_name

        if not self.name.strip():
            raise UsageError("the take has no name; enter one")
        _rename(context.scene.scope.result.collection, short_name(self.name.strip()))
        return ""


class SCOPE_OT_delete_capture(CaptureOperator):
    """Remove the shown capture: its people, their motion, the camera and its footage"""

    bl_description = (
        "Remove the shown capture: its people, their motion, the camera and its footage. Rigs that "
        "it was retargeted to keep their motion"
    )
    bl_idname = "scope.delete_capture"
    bl_label = "Delete Capture"

    def work(self, context: bpy.types.Context) -> str:
        """Remove it, and show the capture before it."""
        from ...scene.delete_capture import delete_capture

        collection = context.scene.scope.result.collection
        name = collection.name
        comparison.end_of(collection)
        delete_capture(context.scene, collection)
        if (before := shown_capture(context.scene)) is not None:
            show_again(before)
        return rpt_("Removed '{name}'", name=name)


def _rename(collection: bpy.types.Collection, name: str) -> None:
    """Rename a capture, and its objects, their data and actions whose names begin with the
    capture's.
    """
    from ...scene.rigs.rig_action import follow_renaming

    former = collection.name
    armatures = {
        obj.name: obj
        for obj in collection.all_objects
        if obj.type == "ARMATURE" and obj.library is None
    }
    blocks: list[bpy.types.ID] = [collection]
    for obj in collection.all_objects:
        data = [obj, obj.data, getattr(obj.data, "shape_keys", None)]
        blocks += [block for block in data if block is not None]
        blocks += [
            block.animation_data.action
            for block in data
            if block is not None and block.animation_data
        ]
    for block in dict.fromkeys(block for block in blocks if block is not None):
        if block.library is None and block.name.startswith(former):
            block.name = name + block.name.removeprefix(former)
    follow_renaming({before: obj.name for before, obj in armatures.items()})


CLASSES = (SCOPE_OT_push_to_nla, SCOPE_OT_rename_take, SCOPE_OT_delete_capture)
