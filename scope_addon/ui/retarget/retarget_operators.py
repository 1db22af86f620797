# SPDX-License-Identifier: GPL-3.0-or-later
"""Put a captured motion on the user's own rig: guess the bones, edit and keep the list, retarget."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import EnumProperty, StringProperty

from ..captured_person import PERSON, betas_of, body_of, captured_armature, captured_people
from ..reporting import ReportingOperator, sentence

if TYPE_CHECKING:
    from ...retarget.bone_map import BoneMap


_ASIDE = (1.5, 0.0, 0.0)  # metres: to the left of a person who faces the front view


class _OnRig(ReportingOperator):
    """What the operators share: a rig is chosen."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """A rig is chosen."""
        rig = context.scene.scope_retarget.rig
        if rig is None:
            cls.poll_message_set("Choose your rig first")
            return False
        if rig.name not in context.view_layer.objects:
            cls.poll_message_set(
                f"'{rig.name}' is not in the scene's view layer: put it into the scene, or tick its collection in the "
                "Outliner"
            )
            return False
        return True


class SCOPE_OT_guess_bones(_OnRig):
    """Find out which bone of the rig is which body part, by names and rest pose"""

    bl_idname = "scope.guess_bones"
    bl_label = "Guess Bones"

    def work(self, context: bpy.types.Context) -> str:
        """Fill the list."""
        from ...scene.rigs.rig_retarget import guess_bone_map

        found = guess_bone_map(context.scene.scope_retarget.rig)
        _show(context, found)
        return f"{len(found.parts)} bones found; check the list"


class SCOPE_OT_retarget(_OnRig):
    """Move your rig as the captured person moves, as a new action. The rig's former action stays in the file, but one
    that this button has made and nobody has changed"""

    bl_idname = "scope.retarget"
    bl_label = "Retarget"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """A rig is chosen that this file can animate, and whose motion it takes."""
        if not super().poll(context):
            return False
        rig = context.scene.scope_retarget.rig
        if rig.library is not None:
            cls.poll_message_set(
                f"'{rig.name}' is linked from {rig.library.filepath}, and its motion would be lost when this file is "
                "saved: make an override of it (Object > Library Override > Make)"
            )
            return False
        if captured_armature(context) is None:
            cls.poll_message_set(
                "Several people are captured: select the armature of the one whose motion the rig takes"
                if captured_people(context)
                else "The scene holds no capture yet"
            )
            return False
        return True

    def work(self, context: bpy.types.Context) -> str:
        """Key the rig."""
        from ...scene.animation_data.timing import scene_rate
        from ...scene.rigs.rig_retarget import RetargetOptions, guess_bone_map, retarget
        from ...scene.visibility import hide, show

        settings, source = context.scene.scope_retarget, captured_armature(context)
        assert source is not None  # poll has asked
        if not len(settings.pairs):
            _show(context, guess_bone_map(settings.rig))
        body = body_of(source)
        done = retarget(
            source,
            body,
            betas_of(source, body),
            settings.rig,
            _map_of(context),
            scene_rate(context.scene),
            RetargetOptions(
                feet=settings.feet, root=settings.root, offset=_ASIDE if settings.captured == "beside" else (0, 0, 0)
            ),
        )
        settings.rig[PERSON] = source.name
        if settings.captured == "hide":
            _choose(context, settings.rig)
            hide(source, context.view_layer)
        else:
            show(source, context.view_layer)
        if done.warnings:
            self.report({"WARNING"}, sentence(done.warnings[0]))
            return ""
        return f"'{settings.rig.name}' moves by the action '{done.action.name}'"


class _BoneMapFile(_OnRig):
    """What saving and loading the list share: the file is asked for."""

    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SCOPE_OT_save_bone_map(_BoneMapFile):
    """Save the list of bones as a JSON file for rigs of the same kind"""

    bl_idname = "scope.save_bone_map"
    bl_label = "Save Bone Map"

    filepath: StringProperty(subtype="FILE_PATH", default="bones.json")

    def work(self, context: bpy.types.Context) -> str:
        """Write."""
        from ...retarget.bone_map import save_bone_map

        save_bone_map(_map_of(context), bpy.path.abspath(self.filepath))
        return f"Saved {self.filepath}"


class SCOPE_OT_load_bone_map(_BoneMapFile):
    """Read a list of bones that was saved as JSON"""

    bl_idname = "scope.load_bone_map"
    bl_label = "Load Bone Map"

    filepath: StringProperty(subtype="FILE_PATH")

    def work(self, context: bpy.types.Context) -> str:
        """Fill the list."""
        from ...retarget.bone_map import load_bone_map

        _show(context, load_bone_map(bpy.path.abspath(self.filepath)))
        return f"Read {self.filepath}"


class SCOPE_OT_edit_bone_pair(_OnRig):
    """Add a line to the list of bones, or take the chosen one out"""

    bl_idname = "scope.edit_bone_pair"
    bl_label = "Edit Bone List"

    action: EnumProperty(items=(("ADD", "Add", "Add a line"), ("REMOVE", "Remove", "Remove the chosen line")))

    def work(self, context: bpy.types.Context) -> str:
        """Change the list."""
        settings = context.scene.scope_retarget
        if self.action == "ADD":
            settings.pairs.add()
            settings.active = len(settings.pairs) - 1
        elif len(settings.pairs):
            settings.pairs.remove(settings.active)
            settings.active = max(0, min(settings.active, len(settings.pairs) - 1))
        return f"{len(settings.pairs)} bones"


def _choose(context: bpy.types.Context, rig: bpy.types.Object) -> None:
    """Make the rig active and the only one selected: what is hidden cannot be."""
    active = context.view_layer.objects.active
    if active is not None and active.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for obj in context.view_layer.objects:
        obj.select_set(obj == rig, view_layer=context.view_layer)
    context.view_layer.objects.active = rig


def _show(context: bpy.types.Context, bone_map: BoneMap) -> None:
    """Put a map into the list, in the order of the body's parts."""
    from ...retarget.bone_map import PARTS

    settings = context.scene.scope_retarget
    settings.pairs.clear()
    for bone, part in sorted(bone_map.parts.items(), key=lambda pair: PARTS.index(pair[1])):
        pair = settings.pairs.add()
        pair.bone, pair.part, pair.confidence = bone, part, bone_map.confidence.get(bone, 1.0)
    settings.active = 0


def _map_of(context: bpy.types.Context) -> BoneMap:
    """The list as a map; lines without a bone or a part do not count."""
    from ...retarget.bone_map import BoneMap

    pairs = [pair for pair in context.scene.scope_retarget.pairs if pair.bone and pair.part]
    return BoneMap({pair.bone: pair.part for pair in pairs}, {pair.bone: pair.confidence for pair in pairs})


CLASSES = (
    SCOPE_OT_guess_bones,
    SCOPE_OT_retarget,
    SCOPE_OT_save_bone_map,
    SCOPE_OT_load_bone_map,
    SCOPE_OT_edit_bone_pair,
)
