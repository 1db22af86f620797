# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that puts captured motion in the asset browser."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, StringProperty

from ..captured_person import PERSON, motion_of
from ..reporting import rpt_
from .action_operators import ActionOperator, animated_armature


def _offered_catalogs(
    _operator: bpy.types.Operator, _context: bpy.types.Context, typed: str
) -> list[str]:
    """Return the asset catalogs whose paths contain what was typed so far, for Blender to
    suggest.
    """
    from ...scene.action_asset import catalogs

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

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the details; suggest those of the action if it is an asset."""
        armature = animated_armature(context)
        assert armature is not None  # checked by poll
        data = armature.animation_data.action.asset_data
        if data is not None:
            self.author = data.author
            self.description_text = data.description
        else:
            self.description_text = self.catalog = ""
        outcome: set[str] = context.window_manager.invoke_props_dialog(self)
        return outcome

    def work(self, context: bpy.types.Context) -> str:
        """Mark the action and draw its picture.

        :raises UsageError: the action is linked, or the catalog does not exist.
        """
        from ...scene.action_asset import AssetDetails, mark_action, set_preview

        armature = animated_armature(context)
        assert armature is not None  # checked by poll
        action = armature.animation_data.action
        description = self.description_text or _described(context, armature)
        mark_action(action, AssetDetails(self.author.strip(), description, self.catalog.strip()))
        set_preview(action, armature, self._frame(context, armature))
        if not bpy.data.filepath:
            return rpt_(
                "'{action}' is an asset of this file; save the file in an asset library",
                action=action.name,
            )
        return rpt_("'{action}' is now an asset", action=action.name)

    def _frame(self, context: bpy.types.Context, armature: bpy.types.Object) -> float:
        """Return the scene frame of the picture, within the action."""
        from ....solver.errors import ScopeError
        from ...scene.action_asset import first_reliable_frame
        from ...scene.animation_data.stored_values import start_frame
        from ...scene.animation_data.timing import keyed_rate

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


def _captured(armature: bpy.types.Object) -> bpy.types.Object:
    """Return the captured armature whose motion an armature has; the armature itself if that is
    unknown.
    """
    person = armature.get(PERSON)
    return person if isinstance(person, bpy.types.Object) else armature


def _described(context: bpy.types.Context, armature: bpy.types.Object) -> str:
    """Return the description of an asset that the user has given none"""
    from ...scene.animation_data.stored_values import stored_text

    first, last = armature.animation_data.action.frame_range
    seconds = (last - first) * context.scene.render.fps_base / context.scene.render.fps
    source = stored_text(_captured(armature), "scope_source") or armature.name
    return rpt_("Captured from {source}, {seconds:.1f} s", source=source, seconds=seconds)


CLASSES = (SCOPE_OT_mark_asset,)
