# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators on the action of a captured person, or of a rig with their motion: take name,
NLA, asset browser.
"""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy.types import Collection, Context, Event, Object, Operator

from ...solver.errors import ScopeError
from ..errors import UsageError
from ..scene.datablocks import NAME_TAG, SOURCE_TAG, action_of, short_name, with_data
from ..scene.stored_values import start_frame, stored_text
from . import comparison
from .captured_person import captured_armature, motion_of, stored_person
from .captures import show_again, shown_capture
from .reporting import ReportingOperator, refuse, rpt_


def animated_armature(context: Context) -> Object | None:
    """Return the active rig with captured motion, or else the active captured armature; None
    without one.
    """
    active = context.view_layer.objects.active if context.view_layer else None
    is_rig = active is not None and bool(stored_person(active))
    return active if is_rig else captured_armature(context)


class ActionOperator(ReportingOperator):
    """An operator on the action of an armature with captured motion. Not registered"""

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require an armature with captured motion, which is stored in this file and has an
        action.
        """
        armature = animated_armature(context)
        if armature is None:
            return refuse(cls, "Select the armature of a capture first")
        if armature.library is not None:
            file = armature.library.filepath
            return refuse(
                cls,
                "'{name}' is linked from {file}: make it local",
                name=armature.name,
                file=file,
            )
        if action_of(armature) is None:
            name = armature.name
            return refuse(cls, "'{name}' has no action; choose one in the Action Editor", name=name)
        return True


class SCOPE_OT_push_to_nla(ActionOperator):
    """Move the motion to a new track of the Nonlinear Animation editor"""

    bl_description = (
        "Move the motion to a new track of the Nonlinear Animation editor, where takes are mixed "
        "and repeated"
    )
    bl_idname = "scope.push_to_nla"
    bl_label = "Push to NLA"

    def work(self, context: Context) -> str:
        """Add the track, and those of the root object and of the face, which the motion's strips
        are moved with.

        :raises UsageError: the armature is in Tweak Mode.
        """
        from ..scene.actions import animated_together, push_to_nla
        from ..scene.character.root_object import root_object

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
    def poll(cls, context: Context) -> bool:
        """Require a capture that is stored in this file."""
        collection = context.scene.scope.result.collection
        if collection is None:
            return refuse(cls, "The scene contains no capture yet")
        if collection.library is not None:
            file = collection.library.filepath
            return refuse(cls, "The capture is linked from {file}: make it local", file=file)
        return True


class SCOPE_OT_rename_take(CaptureOperator):
    """Rename the capture with its objects and actions; exported animation has the same name"""

    bl_idname = "scope.rename_take"
    bl_label = "Rename Take"

    name: StringProperty(name="Name", description="New name of the take")

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for the name."""
        self.name = context.scene.scope.result.collection.name
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, _context: Context) -> None:
        """Draw the name, which is typed over at once."""
        self.layout.activate_init = True
        self.layout.prop(self, "name", text="")

    def work(self, context: Context) -> str:
        """Rename everything whose name begins with the take's.

        :raises UsageError: the name is empty.
        """
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

    def work(self, context: Context) -> str:
        """Remove it, and show the capture before it."""
        from ..scene.build import delete_capture

        collection = context.scene.scope.result.collection
        name = collection.name
        comparison.end_of(collection)
        delete_capture(context.scene, collection)
        if (before := shown_capture(context.scene)) is not None:
            show_again(before)
        return rpt_("Removed '{name}'", name=name)


def _rename(collection: Collection, name: str) -> None:
    """Rename a capture, and its objects, their data and actions whose names begin with its name, or
    with the one that it was built or renamed with: in the Outliner, its collection alone is
    renamed.
    """
    from ..scene.rig_action import follow_renaming

    former = [collection.name, stored_text(collection, NAME_TAG) or collection.name]
    collection.name = name
    collection[NAME_TAG] = name = collection.name  # numbered if there is one of that name
    armatures = {
        obj.name: obj
        for obj in collection.all_objects
        if obj.type == "ARMATURE" and obj.library is None
    }
    blocks = [block for obj in collection.all_objects for block in with_data(obj)]
    for block in dict.fromkeys([*blocks, *filter(None, map(action_of, blocks))]):
        begins = next((each for each in former if block.name.startswith(each)), None)
        if block.library is None and begins is not None:
            block.name = name + block.name.removeprefix(begins)
    follow_renaming({before: obj.name for before, obj in armatures.items()})


def _offered_catalogs(_operator: Operator, _context: Context, typed: str) -> list[str]:
    """Return the asset catalogs whose paths contain what was typed so far, for Blender to
    suggest.
    """
    from ..scene.action_asset import catalogs

    return sorted(path for path in catalogs() if typed.lower() in path.lower())


class SCOPE_OT_mark_asset(ActionOperator):
    """Mark the captured motion as an asset with a preview image of its pose"""

    bl_description = (
        "Mark the captured motion as an asset with a preview image of its pose, for other files' "
        "Asset Browser"
    )
    bl_idname = "scope.mark_asset"
    bl_label = "Mark as Asset"

    author: StringProperty(name="Author", description="Who made this asset")
    description_text: StringProperty(
        name="Description",
        description="Description of the asset; the footage and its duration if left empty",
    )
    catalog: StringProperty(
        name="Catalog",
        search=_offered_catalogs,
        description="Catalog of the Asset Browser, such as Motions/Walks; unassigned if left empty",
    )
    current_pose: BoolProperty(
        name="Preview of Current Frame",
        default=False,
        description="Show the pose of the current frame in the preview image, instead of the first "
        "one that needs no "
        "review",
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for the details; suggest those of the action if it is an asset."""
        from ..scene.action_asset import catalogs

        armature = animated_armature(context)
        assert armature is not None  # checked by poll
        data = armature.animation_data.action.asset_data
        self.description_text = self.catalog = ""  # not those of the last action
        if data is not None:
            self.author = data.author
            self.description_text = data.description
            paths = {uid: path for path, uid in catalogs().items()}
            self.catalog = paths.get(data.catalog_id, "")
        return context.window_manager.invoke_props_dialog(self)

    def work(self, context: Context) -> str:
        """Mark the action and draw its picture.

        :raises UsageError: the action is linked, or the catalog does not exist.
        """
        from ..scene.action_asset import mark_action, set_preview

        armature = animated_armature(context)
        assert armature is not None  # checked by poll
        action = armature.animation_data.action
        description = self.description_text or _described(context, armature)
        mark_action(action, self.author.strip(), description, self.catalog.strip())
        set_preview(action, armature, self._frame(context, armature))
        if not bpy.data.filepath:
            return rpt_(
                "'{action}' is an asset of this file; save the file in an asset library",
                action=action.name,
            )
        return rpt_("'{action}' is now an asset", action=action.name)

    def _frame(self, context: Context, armature: Object) -> float:
        """Return the scene frame of the picture, within the action."""
        from ..scene.action_asset import first_reliable_frame
        from ..scene.timing import keyed_rate

        first, last = armature.animation_data.action.frame_range
        frame = float(context.scene.frame_current)
        person = _captured(armature)
        if not self.current_pose:
            frame = first
            try:
                motion = motion_of(person)
                seconds = float(motion.timestamps[first_reliable_frame(motion)])
                frame = start_frame(person) + seconds * keyed_rate(person, context.scene)
            except ScopeError:
                pass  # the motion is lost, but the keys are not
        return float(min(max(frame, first), last))


def _captured(armature: Object) -> Object:
    """Return the captured armature whose motion an armature has; the armature itself if that is
    unknown.
    """
    return stored_person(armature) or armature


def _described(context: Context, armature: Object) -> str:
    """Return the description of an asset that the user has given none"""
    first, last = armature.animation_data.action.frame_range
    seconds = (last - first) * context.scene.render.fps_base / context.scene.render.fps
    source = stored_text(_captured(armature), SOURCE_TAG) or armature.name
    return rpt_("Captured from {source}, {seconds:.1f} s", source=source, seconds=seconds)


CLASSES = (
    SCOPE_OT_push_to_nla,
    SCOPE_OT_rename_take,
    SCOPE_OT_delete_capture,
    SCOPE_OT_mark_asset,
)
