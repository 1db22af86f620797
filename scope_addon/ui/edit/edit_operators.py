# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that edit the motion of a capture: smoothing and root motion.

Both rewrite the keys of the active capture's armature; smoothing starts from the captured motion,
which the .blend file stores. Neither uses the footage. Edits that the motion keeps are in
``pins/kept_edits.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from ...scene.datablocks import holds
from ..capture.captures import captures_of, people_of
from ..captured_person import library_of, motion_of, set_motion_of
from ..preferences import keep_machine_code
from .edit_base import EditOperator

if TYPE_CHECKING:
    from ....solver.body import Body


class SCOPE_OT_smooth(EditOperator):
    """Smooth the captured motion again"""

    bl_description = (
        "Smooth the captured motion again, more or less strongly. Keeps corrections, discards "
        "other changes"
    )
    bl_idname = "scope.smooth"
    bl_label = "Smooth Motion"

    strength: FloatProperty(
        name="Strength",
        default=1.0,
        min=0.0,
        soft_max=4.0,
        max=20.0,
        description="0 keeps every frame as captured, 1 is the default of a capture, higher values "
        "smooth more",
    )
    everyone: BoolProperty(
        name="All People",
        description="Smooth everybody of the capture, and not only the selected person",
    )

    def people(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        """Return the active captured armature, or all local ones of its capture."""
        (active,) = super().people(context)
        capture = next((c for c in captures_of(context.scene) if holds(c, active)), None)
        if not self.everyone or capture is None:
            return [active]
        return [person for person in people_of(capture) if library_of(person) is None]

    def edit(
        self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float
    ) -> str:
        """Replace the keys by those of the captured motion, smoothed."""
        from ...edit.pins.corrected_motion import uncorrected
        from ...edit.smooth import smoothed
        from ...scene.animation_data.actions import animated_together, remove_cycles
        from ...scene.animation_data.stored_values import start_frame
        from ...scene.animation_data.timing import (
            is_cycle,
            key_frames,
            restore_scene_range,
            store_rate,
        )
        from ...scene.character.keys import bake_whole_frames, write_clip
        from ...scene.character.other_curves import restore_whole_motion
        from ...scene.character.root_object import remove_root_object
        from ...scene.character.uncorrected_keys import write_both

        motion = motion_of(armature)
        if motion.corrections:  # which are solved again
            keep_machine_code()
        frames = key_frames(motion.timestamps, rate, start_frame(armature))
        clip = smoothed(body, motion, self.strength)
        if motion.corrections:
            clips = smoothed(body, uncorrected(motion), self.strength), clip
            keys = write_both(armature, body, clips, frames, rate)
            set_motion_of(armature, motion, keys.to_bytes())
        else:
            write_clip(armature, body, clip, frames)
        armature["scope_smoothing"] = self.strength
        store_rate(armature, rate)
        if is_cycle(armature):  # a loop becomes the whole motion again
            restore_whole_motion(armature, body, motion, frames)
        for block in animated_together(armature, None):
            remove_cycles(block)
        if armature.get("scope_resampled"):
            bake_whole_frames(armature, body, rate)
        restore_scene_range(context.scene, armature)
        remove_root_object(armature)
        return ""


class SCOPE_OT_root_motion(EditOperator):
    """Choose where the person's root motion is stored"""

    bl_idname = "scope.root_motion"
    bl_label = "Root Motion"

    mode: EnumProperty(
        name="Root Motion",
        items=(
            ("BONES", "In the Bones", "The pelvis moves through the scene, as captured", 0),
            ("OBJECT", "On an Object", "An empty on the floor carries the root motion", 1),
            ("IN_PLACE", "In Place", "No root motion: the person stays in place", 2),
        ),
        default="OBJECT",
        description="Where the root motion is stored",
    )
    heading: BoolProperty(
        name="With Heading",
        default=True,
        description="Include the rotation about the vertical axis in the root motion",
    )

    def edit(
        self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float
    ) -> str:
        """Change all keys."""
        from ...scene.character.root_object import (
            move_root_motion_to_bones,
            move_root_motion_to_object,
        )

        if self.mode == "BONES":
            move_root_motion_to_bones(armature, body, rate)
        else:
            move_root_motion_to_object(
                armature, body, rate, in_place=self.mode == "IN_PLACE", heading=self.heading
            )
        return ""


CLASSES = (SCOPE_OT_smooth, SCOPE_OT_root_motion)
