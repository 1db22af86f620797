# SPDX-License-Identifier: GPL-3.0-or-later
"""Work on a captured motion: smooth, mend, floor, root motion, loop, fewer keys, another rate.

Every one of them reads the keys of the active capture's armature and writes them anew; only smoothing begins again with
the motion as it was solved, which the cache keeps. None of them looks at the footage again.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ..captured_person import betas_of, body_of, cached_motion, captured_armature, library_of
from ..reporting import TellingOperator

if TYPE_CHECKING:
    from ....solver.body import Body


class _Edit(TellingOperator):
    """What the operators share: whom they work on, and that a failure leaves the keys as they were."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """A captured armature is meant, whose keys this file keeps."""
        armature = captured_armature(context)
        if armature is None:
            cls.poll_message_set("Select the armature of a capture first")
            return False
        library = library_of(armature)
        if library is not None:
            cls.poll_message_set(
                f"'{armature.name}' or its motion is linked from {library.filepath}, and changes would be lost: make "
                "both local (Object > Relations > Make Local > All), or work on them in that file"
            )
            return False
        return True

    if TYPE_CHECKING:  # each operator has its own

        def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
            """Change the keys; returns what to tell, or nothing."""

    def work(self, context: bpy.types.Context) -> str:
        """Change the keys, or none of them."""
        from ...scene.animation_data.timing import scene_rate
        from ...scene.animation_data.transaction import all_or_nothing

        armature = captured_armature(context)
        assert armature is not None  # poll has asked
        with all_or_nothing(context.scene, armature):
            return self.edit(context, armature, body_of(armature), scene_rate(context.scene))


class _Span(_Edit):
    """An operator on some frames, asked for in a dialog that begins with the preview range or what is near."""

    start: IntProperty(name="First Frame", description="First frame of the span")
    end: IntProperty(name="Last Frame", description="Last frame of the span, included")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the frames."""
        scene = context.scene
        if scene.use_preview_range:
            self.start, self.end = scene.frame_preview_start, scene.frame_preview_end
        else:
            self.start, self.end = self.default_span(scene)
        return context.window_manager.invoke_props_dialog(self)

    def default_span(self, scene: bpy.types.Scene) -> tuple[int, int]:
        """Where nothing was chosen: about the current frame."""
        return scene.frame_current - 2, scene.frame_current + 2


class SCOPE_OT_smooth(_Edit):
    """Smooth the motion more or less, from how it was solved. Takes back what was changed by hand"""

    bl_idname = "scope.smooth"
    bl_label = "Smooth Again"

    strength: FloatProperty(
        name="Strength",
        default=1.0,
        min=0.0,
        soft_max=4.0,
        max=20.0,
        description="0 keeps every frame as it was solved, 1 is what a capture does, 3 is calm",
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
        """From the cached motion."""
        from ...edit.smooth import smoothed
        from ...scene.animation_data.actions import remove_cycles
        from ...scene.animation_data.timing import key_frames, restore_scene_range
        from ...scene.character.keys import bake_whole_frames, write_clip
        from ...scene.character.root_object import remove_root_object

        motion = cached_motion(armature)
        clip = smoothed(body, motion, self.strength)
        write_clip(armature, body, clip, key_frames(motion.timestamps, rate, float(armature.get("scope_start", 0.0))))
        remove_cycles(armature)  # what was a loop is the whole motion again
        if armature.get("scope_resampled"):
            bake_whole_frames(armature, body, rate)
        restore_scene_range(context.scene, armature)
        remove_root_object(armature)
        return ""


class SCOPE_OT_interpolate_span(_Span):
    """Go smoothly over frames that went wrong, from the last good pose before them to the first one after"""

    bl_idname = "scope.interpolate_span"
    bl_label = "Bridge Frames"

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
        """Keys inside the span."""
        from ...edit.spans import interpolate
        from ...scene.character.keys import read_clip, write_clip

        clip, frames = read_clip(armature, body, rate)
        write_clip(armature, body, interpolate(clip, self.start / rate, self.end / rate), frames)
        return ""


class SCOPE_OT_swap_sides(_Span):
    """Exchange left and right within some frames: each limb goes where the other one is"""

    bl_idname = "scope.swap_sides"
    bl_label = "Swap Left and Right"

    limbs: EnumProperty(
        name="Limbs",
        items=(
            ("both", "Arms and Legs", "All four limbs", 0),
            ("legs", "Legs", "The legs alone", 1),
            ("arms", "Arms", "The arms alone", 2),
        ),
        default="both",
        description="Which limbs are exchanged",
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
        """Keys inside the span."""
        from ...edit.spans import swap_sides
        from ...scene.character.keys import read_clip, write_clip

        clip, frames = read_clip(armature, body, rate)
        write_clip(armature, body, swap_sides(clip, body, self.start / rate, self.end / rate, self.limbs), frames)
        return ""


class SCOPE_OT_refloor(_Edit):
    """Put the standing feet on the floor: at the height of the armature's origin, so on the grid unless you moved it"""

    bl_idname = "scope.refloor"
    bl_label = "Feet to Floor"

    level: BoolProperty(
        name="Level the World",
        default=False,
        description="Turn the motion so that the places where feet stood lie level; the camera no longer fits then",
    )
    lift: BoolProperty(
        name="Lift Sunken Feet", default=True, description="Raise the frames in which a foot is below the floor"
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
        """All keys."""
        from ...edit.floor import refloor
        from ...edit.root_motion import relative_to_trajectory, with_trajectory
        from ...scene.character.keys import read_clip, write_clip
        from ...scene.character.root_object import removed_root_motion

        clip, frames = read_clip(armature, body, rate)
        positions, angles = removed_root_motion(armature, frames)
        path = positions * [1.0, 1.0, 0.0], angles  # feet that stand are still only where the person goes
        floored = refloor(
            with_trajectory(clip, *path), body, betas_of(armature, body), level=self.level, lift=self.lift
        )
        write_clip(armature, body, relative_to_trajectory(floored, *path), frames)
        return ""


class SCOPE_OT_root_motion(_Edit):
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
        name="With Heading", default=True, description="Include the rotation about the vertical axis in the root motion"
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
        """All keys."""
        from ...scene.character.root_object import move_root_motion_to_bones, move_root_motion_to_object

        if self.mode == "BONES":
            move_root_motion_to_bones(armature, body, rate)
        else:
            move_root_motion_to_object(armature, body, rate, in_place=self.mode == "IN_PLACE", heading=self.heading)
        return ""


class SCOPE_OT_loop(_Span):
    """Cut the best cycle out of some frames, close it, and let it repeat"""

    bl_idname = "scope.loop"
    bl_label = "Make Loop"

    shortest: FloatProperty(
        name="Shortest",
        default=0.5,
        min=0.1,
        soft_max=5.0,
        subtype="TIME_ABSOLUTE",
        description="Seconds that a cycle takes at least",
    )
    blend: FloatProperty(
        name="Blend",
        default=0.2,
        min=0.0,
        soft_max=1.0,
        subtype="TIME_ABSOLUTE",
        description="Seconds at the end over which the cycle is closed",
    )
    repeat: BoolProperty(
        name="Repeat", default=True, description="Let the curves repeat for ever, going on from where a cycle ended"
    )

    def default_span(self, scene: bpy.types.Scene) -> tuple[int, int]:
        """The whole scene."""
        return scene.frame_start, scene.frame_end

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
        """Find, cut, close."""
        from ...edit.clip import Clip
        from ...edit.loop import best_cycle, close_cycle
        from ...scene.animation_data.actions import add_cycles
        from ...scene.animation_data.timing import play_cycle
        from ...scene.character.keys import location_path, read_clip, write_clip
        from ...scene.character.root_object import clip_with_root_motion, remove_root_object

        clip, frames = read_clip(armature, body, rate)
        clip = clip_with_root_motion(armature, clip, frames)
        betas = betas_of(armature, body)
        cycle = best_cycle(clip, body, betas, self.start / rate, self.end / rate, self.shortest)
        closed: Clip = close_cycle(clip, cycle, self.blend)
        first, last = float(frames[cycle.first]), float(frames[cycle.last])
        write_clip(armature, body, closed, frames[cycle.first : cycle.last + 1])
        if self.repeat:
            add_cycles(armature, offset_curves={(location_path(body), 0), (location_path(body), 1)})
        play_cycle(context.scene, armature, math.ceil(first), math.floor(last) - 1)
        remove_root_object(armature)
        return f"A cycle of {closed.times[-1]:.2f} s, its ends {100 * cycle.error_m:.1f} cm apart before closing"


class SCOPE_OT_reduce_keys(_Edit):
    """Remove the keys that the motion does not need, within an error that you choose"""

    bl_idname = "scope.reduce_keys"
    bl_label = "Reduce Keys"

    degrees: FloatProperty(
        name="Rotation",
        default=0.5,
        min=0.01,
        soft_max=5.0,
        max=45.0,
        description="Most that a bone may turn, in degrees",
    )
    millimetres: FloatProperty(
        name="Position",
        default=2.0,
        min=0.01,
        soft_max=50.0,
        max=1000.0,
        description="Most that the pelvis may move, in millimetres",
    )

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
        """All keys, bone by bone."""
        from ...scene.character.keys import reduce_keys

        betas = betas_of(armature, body)
        found = reduce_keys(armature, body, betas, rate, math.radians(self.degrees), self.millimetres / 1000.0)
        return (
            f"{found.before} keys became {found.after}; bones are off by {math.degrees(found.angle):.2f} degrees, "
            f"joints by {1000 * found.joint_m:.1f} mm at most"
        )


class SCOPE_OT_bake_rate(_Edit):
    """A key on every frame of a rate that you choose, from the first one on"""

    bl_idname = "scope.bake_rate"
    bl_label = "Bake to Rate"

    rate: FloatProperty(
        name="Keys per Second", default=0.0, min=0.0, soft_max=120.0, max=1000.0,
        description="0: one key on each frame of the scene",
    )  # fmt: skip

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
        """All keys; on whole frames where it is the scene's rate."""
        from ...edit.clip import resample
        from ...scene.character.keys import bake_whole_frames, read_clip, write_clip

        if self.rate > 0:
            clip, frames = read_clip(armature, body, rate)
            baked = resample(clip, self.rate)
            write_clip(armature, body, baked, baked.times * rate)
            before, after = len(frames), len(baked)
        else:
            before, after = bake_whole_frames(armature, body, rate)
        return f"{before} keys became {after}"


CLASSES = (
    SCOPE_OT_smooth,
    SCOPE_OT_interpolate_span,
    SCOPE_OT_swap_sides,
    SCOPE_OT_refloor,
    SCOPE_OT_root_motion,
    SCOPE_OT_loop,
    SCOPE_OT_reduce_keys,
    SCOPE_OT_bake_rate,
)
