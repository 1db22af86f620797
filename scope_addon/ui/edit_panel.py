# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels about editing and correcting a captured motion, and the operators that edit it:
smoothing and root motion, and which keys it has: loop, key reduction, baking to a frame rate.

All rewrite the keys of the active capture's armature; smoothing starts from the captured motion,
which the .blend file stores. None uses the footage.

Interpolated frames and feet on the floor are edits that the motion keeps, like corrections. Where
the motion is lost, as in old .blend files without their cache, these edit the keys only.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bpy.props import BoolProperty, EnumProperty, FloatProperty
from bpy.types import Context, Object, Panel, Scene, UILayout

from ...solver.errors import ScopeError
from ..scene.character.correction_list import listed_corrections
from ..scene.datablocks import captures_of, holds
from ..scene.stored_values import start_frame
from .capture_panel import PersonTab
from .captured_person import (
    EditOperator,
    SpanOperator,
    betas_of,
    captured_armature,
    draw_active_person,
    edit_clip,
    library_of,
    motion_of,
    set_motion_of,
)
from .captures import people_of, shown_capture
from .correction_operators import (
    CorrectionOperator,
    CorrectSpanOperator,
    add_correction,
    floor_warning,
)
from .pin_tool import is_running
from .preferences import keep_machine_code
from .reporting import refuse, rpt_
from .translations import CONTEXT

if TYPE_CHECKING:
    from ...solver.body import Body
    from ..arrays import Float64Array
    from ..edit.clip import Clip
    from ..edit.corrections import Correction
    from ..motion import Motion
_ICONS = {
    "PIN": "PINNED",
    "CONTACT": "SNAP_FACE",
    "EXCHANGE": "MOD_MIRROR",
    "FLIP": "ARROW_LEFTRIGHT",
    "UPRIGHT": "EMPTY_SINGLE_ARROW",
    "FLOOR": "GRID",
    "INTERPOLATION": "IPO_EASE_IN_OUT",
    "FEET": "TRIA_DOWN_BAR",
}


class SCOPE_PT_edit(PersonTab, Panel):
    """Smoothing, repairs, floor, root motion, loops and keys of the selected person."""

    bl_idname = "SCOPE_PT_edit"
    bl_label = "Refine"

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        layout = self.layout
        if draw_active_person(layout, context) is None:
            return
        settings = context.scene.scope
        row = layout.row(align=True)
        for text, strength in (("Raw", 0.0), ("Normal", 1.0), ("Strong", 2.5)):
            smooth = row.operator("scope.smooth", text=text)
            smooth.strength = strength
            smooth.everyone = settings.smooth_everyone
        shown = shown_capture(context.scene)
        if shown is not None and len(people_of(shown)) > 1:
            layout.prop(settings, "smooth_everyone")
        column = layout.column(align=True)
        column.operator("scope.interpolate_span", icon="IPO_EASE_IN_OUT")
        column.operator("scope.refloor", icon="TRIA_DOWN_BAR")
        layout.label(text="Root Motion")
        row = layout.row(align=True)
        for text, mode in (
            ("In Bones", "BONES"),
            ("On Object", "OBJECT"),
            ("In Place", "IN_PLACE"),
        ):
            row.operator("scope.root_motion", text=text).mode = mode
        layout.label(text="Keys", text_ctxt=CONTEXT)
        column = layout.column(align=True)
        column.operator("scope.loop", icon="FILE_REFRESH")
        column.operator("scope.reduce_keys", icon="KEY_DEHLT")
        column.operator("scope.bake_rate", icon="KEYFRAME_HLT")


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

    def people(self, context: Context) -> list[Object]:
        """Return the active captured armature, or all local ones of its capture."""
        (active,) = super().people(context)
        capture = next((c for c in captures_of(context.scene) if holds(c, active)), None)
        if not self.everyone or capture is None:
            return [active]
        return [person for person in people_of(capture) if library_of(person) is None]

    def work(self, context: Context) -> str:
        """Smooth everybody, and only then remove what a failure could not bring back."""
        from ..scene.character.root_object import remove_root_object

        people = self.people(context)
        message = super().work(context)
        for armature in people:
            remove_root_object(armature)
        return message

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Replace the keys by those of the captured motion, smoothed."""
        from ..edit.corrected_motion import uncorrected
        from ..edit.smooth import smoothed
        from ..scene.actions import animated_together, remove_cycles
        from ..scene.character.corrected_keys import check_times_of_keys
        from ..scene.character.keys import bake_whole_frames, write_clip
        from ..scene.character.other_curves import restore_whole_motion
        from ..scene.character.root_object import check_own_action, root_object
        from ..scene.character.uncorrected_keys import write_both
        from ..scene.timing import cycle_span, key_frames, restore_scene_range, store_rate

        motion = motion_of(armature)
        check_times_of_keys(armature, motion, rate)
        if root_object(armature) is not None:  # which goes
            check_own_action(armature)
        if motion.corrections:  # which are solved again
            keep_machine_code()
        frames = key_frames(motion.timestamps, rate, start_frame(armature))
        clip = smoothed(body, motion, self.strength)
        if motion.corrections:
            free = smoothed(body, uncorrected(motion), self.strength)
            keys = write_both(armature, body, free, clip, frames, rate)
            set_motion_of(armature, motion, keys.to_bytes())
        else:
            write_clip(armature, body, clip, frames)
        armature["scope_smoothing"] = self.strength
        store_rate(armature, rate)
        if cycle_span(armature) is not None:  # a loop becomes the whole motion again
            restore_whole_motion(armature, body, motion, frames)
        for block in animated_together(armature, None):
            remove_cycles(block)
        if armature.get("scope_resampled"):
            bake_whole_frames(armature, body, rate)
        restore_scene_range(context.scene, armature)
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

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Change all keys. A rig that has the motion still has it where it looks the same."""
        import numpy as np

        from ..scene.character.keys import read_clip
        from ..scene.character.root_object import (
            clip_as_displayed,
            move_root_motion_to_bones,
            move_root_motion_to_object,
        )
        from ..scene.rig_action import remember_motion, up_to_date

        def displayed() -> Float64Array:
            clip = clip_as_displayed(armature, *read_clip(armature, body, rate))
            return clip.joints(body, betas_of(armature, body))

        retargeted = up_to_date(armature)
        before = displayed() if retargeted else None
        if self.mode == "BONES":
            move_root_motion_to_bones(armature, body, rate)
        else:
            move_root_motion_to_object(
                armature, body, rate, in_place=self.mode == "IN_PLACE", heading=self.heading
            )
        if before is not None and np.allclose(displayed(), before, atol=0.001):
            for action in retargeted:
                remember_motion(action, armature)
        return ""


class SCOPE_OT_loop(SpanOperator):
    """Find the best cycle within a span of frames, close it, and repeat it"""

    bl_idname = "scope.loop"
    bl_label = "Make Loop"

    shortest: FloatProperty(
        name="Shortest",
        default=0.5,
        min=0.1,
        soft_max=5.0,
        subtype="TIME_ABSOLUTE",
        description="Minimum duration of the cycle in seconds",
    )
    blend: FloatProperty(
        name="Blend",
        default=0.2,
        min=0.0,
        soft_max=1.0,
        subtype="TIME_ABSOLUTE",
        description="Duration in seconds, at the end of the cycle, over which it is closed",
    )
    movement: FloatProperty(
        name="Least Movement",
        default=0.05,
        min=0.0,
        soft_max=0.5,
        description="Mean distance in metres by which the joints must move within the cycle; 0 "
        "also loops a person who "
        "stays still",
    )
    repeat: BoolProperty(
        name="Repeat",
        default=True,
        description="Repeat the curves; each cycle starts where the previous one ended",
    )

    def default_span(self, scene: Scene) -> tuple[int, int]:
        """Return the span to suggest without a preview range: the scene's frame range."""
        return scene.frame_start, scene.frame_end

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Replace the keys by those of the closed cycle."""
        from ..edit.loop import MIN_TURN, best_cycle, close_cycle
        from ..scene.actions import add_cycles, animated_together
        from ..scene.character.keys import location_path, read_clip, write_clip
        from ..scene.character.other_curves import cut_to_cycle
        from ..scene.character.root_object import (
            check_own_action,
            clip_with_root_motion,
            remove_root_object,
            root_object,
        )
        from ..scene.timing import play_cycle

        if root_object(armature) is not None:  # which goes
            check_own_action(armature)
        clip, frames = read_clip(armature, body, rate)
        clip = clip_with_root_motion(armature, clip, frames)
        betas = betas_of(armature, body)
        cycle = best_cycle(
            clip,
            body,
            betas,
            self.start / rate,
            self.end / rate,
            self.shortest,
            self.movement,
            # The curves of rotations repeat without an offset, and would snap back.
            most_turn=MIN_TURN if self.repeat else math.pi,
        )
        closed: Clip = close_cycle(clip, cycle, self.blend)
        first = float(frames[cycle.first])
        last = float(frames[cycle.last])
        write_clip(armature, body, closed, frames[cycle.first : cycle.last + 1])
        cut_to_cycle(armature, body, first, last)
        if self.repeat:
            add_cycles(armature, offset_curves={(location_path(body), 0), (location_path(body), 1)})
            for face in animated_together(armature, None)[1:]:
                add_cycles(face)
        # As many frames as the cycle has, also where its keys lie between frames.
        shown = math.ceil(first)
        play_cycle(context.scene, armature, shown, shown + max(round(last - first), 1) - 1)
        remove_root_object(armature)
        return rpt_(
            "Cycle of {seconds:.2f} s, whose ends were {distance:.1f} cm apart",
            seconds=closed.times[-1],
            distance=100 * cycle.error_m,
        )


class SCOPE_OT_reduce_keys(EditOperator):
    """Remove keys within a maximum error"""

    bl_idname = "scope.reduce_keys"
    bl_label = "Reduce Keys"

    degrees: FloatProperty(
        name="Rotation",
        default=0.5,
        min=0.01,
        soft_max=5.0,
        max=45.0,
        description="Maximum rotation error of a bone in degrees",
    )
    millimetres: FloatProperty(
        name="Position",
        default=2.0,
        min=0.01,
        soft_max=50.0,
        max=1000.0,
        description="Maximum position error of the pelvis in millimetres",
    )

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Remove keys bone by bone."""
        from ..scene.character.keys import reduce_keys

        betas = betas_of(armature, body)
        found = reduce_keys(
            armature, body, betas, rate, math.radians(self.degrees), self.millimetres / 1000.0
        )
        return rpt_(
            "Reduced {before} key to {after}; maximum error {angle:.2f} degrees for bones and "
            "{pelvis:.1f} mm for the pelvis, which add up to {distance:.1f} mm for a joint"
            if found.before == 1
            else "Reduced {before} keys to {after}; maximum error {angle:.2f} degrees for bones "
            "and {pelvis:.1f} mm for the pelvis, which add up to {distance:.1f} mm for a joint",
            before=found.before,
            after=found.after,
            angle=math.degrees(found.angle),
            pelvis=1000 * found.pelvis_m,
            distance=1000 * found.joint_m,
        )


class SCOPE_OT_bake_rate(EditOperator):
    """Replace the keys by keys at a constant frame rate"""

    bl_idname = "scope.bake_rate"
    bl_label = "Bake to Frame Rate"

    rate: FloatProperty(
        name="Keys per Second",
        default=0.0,
        min=0.0,
        soft_max=120.0,
        max=1000.0,
        description="Frame rate of the keys; 0: one key on each frame of the scene",
    )

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Replace all keys; at the scene's frame rate, they are on whole frames."""
        from ..edit.clip import resample
        from ..scene.character.keys import bake_whole_frames, read_clip, write_clip

        if self.rate > 0:
            clip, frames = read_clip(armature, body, rate)
            baked = resample(clip, self.rate)
            write_clip(armature, body, baked, baked.times * rate)
            before = len(frames)
            after = len(baked)
        else:
            before, after = bake_whole_frames(armature, body, rate)
        return rpt_(
            "Replaced {before} key by {after}"
            if before == 1
            else "Replaced {before} keys by {after}",
            before=before,
            after=after,
        )


class SCOPE_OT_interpolate_span(CorrectSpanOperator):
    """Replace frames by an interpolation between the pose before and the pose after them"""

    bl_idname = "scope.interpolate_span"
    bl_label = "Interpolate Frames"

    def correction(self, first: int, last: int) -> Correction:
        """Return the interpolation."""
        from ..edit.corrections import Interpolation

        return Interpolation(first, last)

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Edit the keys, and keep that with the motion."""
        from ..edit.spans import interpolate

        motion = _correctable_motion(armature)
        if motion is None:
            first_s = self.start / rate
            last_s = self.end / rate
            edit_clip(armature, body, rate, lambda clip, _: interpolate(clip, first_s, last_s))
        else:
            self.correct(armature, body, rate, motion)
        return ""


class SCOPE_OT_refloor(CorrectionOperator):
    """Put feet in contact on the floor, which is at the height of the armature's origin"""

    bl_idname = "scope.refloor"
    bl_label = "Snap Feet to Floor"

    level: BoolProperty(
        name="Level the World",
        default=False,
        description="Rotate the motion so that all foot contacts are level, after which the camera "
        "no longer matches",
    )
    lift: BoolProperty(
        name="Lift Sunken Feet",
        default=True,
        description="Raise the frames in which a foot is below the floor",
    )

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a motion with one floor: on stairs, everything below their middle would be raised
        to it.
        """
        if not super().poll(context):
            return False
        armature = captured_armature(context)
        if armature is not None and armature.get("scope_uneven_ground", False):
            return refuse(
                cls,
                "This motion was captured on uneven ground, where feet rest at any height: "
                "use Floor Here",
            )
        return True

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Edit all keys, and keep that with the motion."""
        from ..edit.corrections import FeetOnFloor
        from ..scene.character.corrected_keys import floored

        feet = FeetOnFloor(self.level, self.lift)
        motion = _correctable_motion(armature)
        if motion is None:
            betas = betas_of(armature, body)
            edit_clip(
                armature,
                body,
                rate,
                lambda clip, frames: floored(armature, body, betas, clip, frames, feet),
            )
            return ""
        motion = add_correction(armature, body, rate, motion, feet)
        if warning := floor_warning(armature, motion, body):
            self.report({"WARNING"}, warning)
        return ""


def _correctable_motion(armature: Object) -> Motion | None:
    """Return the captured motion; None if it, or a correction of it, is lost or damaged."""
    from ..edit.corrected_motion import corrections_of

    try:
        motion = motion_of(armature)
        corrections_of(motion)
    except ScopeError:
        return None
    return motion


class SCOPE_PT_corrections(PersonTab, Panel):
    """Pins, feet that stand, exchanged sides, kept edits, the upright line and the floor of the
    selected person.
    """

    bl_idname = "SCOPE_PT_corrections"
    bl_label = "Corrections"
    bl_parent_id = "SCOPE_PT_edit"

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        layout = self.layout
        armature = captured_armature(context)
        if armature is None:
            return
        layout.operator("scope.pin_limb", icon="PINNED", depress=is_running())
        draw_corrections(layout, layout.row(align=True))
        listed = listed_corrections(armature)
        if not listed:
            return
        column = layout.box().column(align=True)
        for index, entry in enumerate(listed):
            row = column.row(align=True)
            span = (
                str(entry["first"])
                if entry["first"] == entry["last"]
                else f"{entry['first']}–{entry['last']}"
            )
            cells = row.split(factor=0.68, align=True)
            cells.label(
                text=entry["text"],
                icon="ERROR" if entry["missed"] else _ICONS.get(entry["kind"], "DOT"),
            )
            cells.operator("scope.go_to_frame", text=span).frame = entry["first"]
            row.operator("scope.remove_correction", text="", icon="X", emboss=False).index = index
        if len(listed) > 1:
            column.operator("scope.remove_correction", text="Remove All").index = -1


def draw_corrections(layout: UILayout, feet: UILayout) -> None:
    """Draw the buttons that add corrections, in the panel or a menu.

    :param feet: where both feet's buttons are.
    """
    for text, foot in (("Left Foot Stands", "left"), ("Right Foot Stands", "right")):
        feet.operator("scope.foot_stands", text=text).foot = foot
    layout.operator("scope.exchange_sides", icon="MOD_MIRROR")
    layout.operator("scope.upright_line", icon="EMPTY_SINGLE_ARROW")
    layout.operator("scope.floor_here", icon="GRID")
    layout.operator("scope.this_rests", icon="SNAP_FACE")
    layout.operator("scope.flip_limb", icon="ARROW_LEFTRIGHT")
    layout.operator("scope.turn_around", icon="FILE_REFRESH")


CLASSES = (
    SCOPE_PT_edit,
    SCOPE_OT_smooth,
    SCOPE_OT_root_motion,
    SCOPE_OT_loop,
    SCOPE_OT_reduce_keys,
    SCOPE_OT_bake_rate,
    SCOPE_OT_interpolate_span,
    SCOPE_OT_refloor,
    SCOPE_PT_corrections,
)
