# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that corrects the floor's height, by a foot that rests on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import EnumProperty

from ..captured_person import motion_of
from ..reporting import rpt_
from .corrected_person import CorrectionOperator, change_world, shown_frame

if TYPE_CHECKING:
    from ....solver.body import Body
    from ...motion import Motion

_SAME_M = 0.002


class SCOPE_OT_floor_here(CorrectionOperator):
    """Let a foot rest on the floor in this frame"""

    bl_description = (
        "In this frame, a foot rests on the floor: move the capture and its camera up or down "
        "until it does"
    )
    bl_idname = "scope.floor_here"
    bl_label = "Floor Here"

    foot: EnumProperty(
        name="Foot",
        items=(
            ("lower", "Lower Foot", "The lower one of the two in this frame", 0),
            ("left", "Left", "The left foot", 1),
            ("right", "Right", "The right foot", 2),
        ),
        default="lower",
        description="Which foot rests on the floor",
    )

    def edit(
        self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float
    ) -> str:
        """Move everybody of the capture, and the camera."""
        from ...edit.pins.corrections import Floor, added
        from ...scene.character.corrected_keys import heights_of_foot

        scene = context.scene
        motion = motion_of(armature)
        frame = shown_frame(scene, armature, motion)
        height, shown = heights_of_foot(armature, body, rate, motion, (frame, self.foot))
        floor = Floor(frame, height)
        # Edited keys may have the foot elsewhere than the motion.
        rise = height - shown if abs(height - shown) > _SAME_M else 0.0
        change_world(scene, armature, rate, lambda present: added(present, floor), rise)
        if warning := _others_under_floor(motion_of(armature), body):
            self.report({"WARNING"}, warning)
        return ""


def _others_under_floor(motion: Motion, body: Body) -> str:
    """Return the message about feet that are now under the floor in other frames; empty if there
    are none.
    """
    from ...kinematics.foot_skin import UNDER_FLOOR_M, depth_under_floor

    depth = depth_under_floor(motion, body)
    under = depth > UNDER_FLOOR_M
    if not under.any():
        return ""
    return rpt_(
        "A foot is up to {depth:.0f} cm under this floor in {count} of {total} frames: press Floor "
        "Here in a frame in "
        "which it rests on the floor, or use Snap Feet to Floor",
        depth=100 * depth.max(),
        count=int(under.sum()),
        total=len(motion),
    )


CLASSES = (SCOPE_OT_floor_here,)
