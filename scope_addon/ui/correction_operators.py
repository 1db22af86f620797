# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that add and remove corrections of a captured armature: in its motion, in its keys and
in the list for the panel. The tool with the mouse is in ``pin_tool.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)
from bpy.types import Context, Object, Scene

from ..errors import UsageError
from ..scene.budget import LAST_FRAME
from ..scene.character.correction_list import listed_corrections, store_corrections
from ..scene.datablocks import cameras_of_clip, captures_of, holds, is_person
from ..scene.stored_values import start_frame
from .captured_person import (
    EditOperator,
    SpanOperator,
    body_of,
    captured_armature,
    motion_if_stored,
    motion_of,
    set_motion_of,
)
from .preferences import keep_machine_code
from .reporting import iface_, refuse, rpt_

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...solver.body import Body
    from ..edit.corrections import Correction, Pin
    from ..motion import Motion


class CorrectionOperator(EditOperator):
    """A correction after which Blender evaluates the current frame again. Not registered."""

    def work(self, context: Context) -> str:
        """Correct the motion and its keys."""
        message = super().work(context)
        context.scene.frame_set(context.scene.frame_current, subframe=context.scene.frame_subframe)
        return message


def change_corrections(
    armature: Object,
    body: Body,
    rate: float,
    before: Motion,
    change: Callable[[tuple[Correction, ...]], tuple[Correction, ...]],
    added: Correction | None = None,
    rise: float = 0.0,
) -> Motion:
    """Change the corrections of a captured person: of the motion, the keys and the list.

    :param rate: for which the keys were written, frames per second.
    :param before: the person's motion, which takes long to read.
    :param change: returns the new corrections for the present ones.
    :param added: the one that this adds; a pin or an edit holds even if edited keys differ from the
        motion.
    :param rise: metres by which all keys are raised, until the floor is no longer corrected.
    :return: the corrected motion.
    :raises UsageError: keys are missing.
    """
    from ..edit.corrected_motion import corrections_of, with_corrections
    from ..scene.character.corrected_keys import pinned_places, rewrite_changed_keys
    from ..scene.character.other_curves import exchange_measurements
    from ..scene.packed_motion import stored_keys
    from ..scene.timing import key_frames

    keep_machine_code()
    after = with_corrections(before, body, change(corrections_of(before)))
    keys = rewrite_changed_keys(
        armature, body, rate, before, after, stored_keys(armature), added, rise
    )
    frames = key_frames(after.timestamps, rate, start_frame(armature))
    exchange_measurements(armature, body, before, after, frames)
    is_changed = len(keys.times) > 0 or keys.rise != 0.0
    set_motion_of(armature, after, keys.to_bytes() if is_changed else b"")
    store_corrections(armature, after, rate, pinned_places(armature, body, rate, after))
    return after


def add_correction(
    armature: Object, body: Body, rate: float, before: Motion, new: Correction
) -> Motion:
    """Add a correction; parameters and result are those of `change_corrections`."""
    from ..edit.corrections import added

    return change_corrections(
        armature, body, rate, before, lambda present: added(present, new), new
    )


def change_world(
    scene: Scene,
    armature: Object,
    motion: Motion,
    change: Callable[[tuple[Correction, ...]], tuple[Correction, ...]],
    rise: float = 0.0,
) -> Motion:
    """Change the upright line or floor of everybody that the same camera has captured, and move the
    camera with them. People of one clip whose files were imported are in several captures.

    :param motion: of this person.
    :param change: returns the new corrections for the present ones, and changes the same of
        everybody.
    :param rise: metres by which the keys of this person are raised.
    :return: the corrected motion of this person.
    :raises UsageError: the root motion is on an object, or keys are missing.
    """
    import numpy as np

    from ..edit.corrected_motion import corrections_of
    from ..edit.corrections import world_of
    from ..scene.camera import same_camera
    from ..scene.character.upright_scene import turn_camera
    from ..scene.timing import keyed_rate
    from ..scene.transaction import all_or_nothing

    captures = [capture for capture in captures_of(scene) if holds(capture, armature)]
    near = captures or armature.users_collection
    # each once, though it may be in several collections
    others = dict.fromkeys(obj for c in near for obj in c.all_objects if is_person(obj))
    others.pop(armature, None)
    if not captures:  # a capture is of one clip, also where people were not in all of its frames
        others = {o: None for o in others if same_camera(motion_of(o), motion)}
    cameras = {camera: armature for c in near for camera in cameras_of_clip(c)}
    for capture in captures_of(scene) if captures else ():
        if capture in captures or capture.hide_viewport:
            continue
        people = [o for o in capture.all_objects if is_person(o) and _is_in_footage(o, motion)]
        if people and armature not in people:
            others |= dict.fromkeys(people)
            cameras |= {c: people[0] for c in cameras_of_clip(capture) if c not in cameras}
    was = world_of(corrections_of(motion))
    now = world_of(change(corrections_of(motion)))
    turn = (np.eye(4) if now is None else now) @ np.linalg.inv(np.eye(4) if was is None else was)
    with all_or_nothing(scene, *others, *cameras):
        rate = keyed_rate(armature, scene)
        after = change_corrections(armature, body_of(armature), rate, motion, change, rise=rise)
        for person in others:
            rate = keyed_rate(person, scene)
            change_corrections(person, body_of(person), rate, motion_of(person), change)
        for camera, person in cameras.items():
            turn_camera(camera, person, turn, to_captured=now is None)
    return after


def _is_in_footage(person: Object, motion: Motion) -> bool:
    """Return whether a person was captured in the same footage as a motion, and is in its world."""
    from ..scene.camera import same_camera

    own = motion_if_stored(person)
    if own is None:
        return False  # They can be corrected neither alone nor with others.
    return bool(motion.source) and own.source == motion.source and same_camera(own, motion)


def without_kinds(corrections: tuple[Correction, ...], kinds: set[str]) -> tuple[Correction, ...]:
    """Return the corrections without those that move the world; the list calls them ``UPRIGHT`` and
    ``FLOOR``.
    """
    from ..edit.corrections import Floor, Upright, removed

    return removed(
        corrections, tuple(cls for cls in (Upright, Floor) if cls.__name__.upper() in kinds)
    )


def shown_frame(scene: Scene, armature: Object, motion: Motion) -> int:
    """Return the footage's frame at the scene's current frame.

    :raises UsageError: the motion has none there.
    """
    from ..scene.character.corrected_keys import source_frame
    from ..scene.timing import keyed_rate

    return source_frame(armature, motion, scene.frame_float, keyed_rate(armature, scene))


_RESTS_M = 0.02  # from the floor, within which what shall rest there does
_NOW = -LAST_FRAME  # the first frame that Blender allows; stands for the current one

# Of the last pin. Blender does not show what an operator reports that another one has called, so
# that one shows these.
last_pin_warnings: list[str] = []


def floor_warning(armature: Object, motion: Motion, body: Body) -> str:
    """Return the message about feet that corrections have put under the floor; empty if there are
    none.
    """
    from ..edit.corrected_motion import corrections_of, feet_under_floor
    from ..edit.corrections import Contact

    found = feet_under_floor(motion, body)
    if found is None:
        return ""
    remedy = rpt_("move the pin up")
    if isinstance(found.cause, Contact):
        entry = listed_corrections(armature)[corrections_of(motion).index(found.cause)]
        remedy = rpt_(
            "remove '{correction}', or add it for fewer frames", correction=iface_(entry["text"])
        )
    elif found.cause is None:
        remedy = rpt_("remove one of them")
    return rpt_(
        "The corrections put a foot up to {depth:.0f} cm under the floor: {remedy}"
        if len(motion) == 1
        else "The corrections put a foot up to {depth:.0f} cm under the floor in {count} of "
        "{total} frames: {remedy}",
        depth=100 * found.depth,
        count=found.frames,
        total=len(motion),
        remedy=remedy,
    )


def _unreached(armature: Object, joint: str, frame: int) -> str:
    """Return the message about a joint that cannot reach its pin in a scene frame; empty if it
    does.
    """
    for entry in listed_corrections(armature):
        is_here = entry["first"] - 1 <= frame <= entry["last"] + 1
        if entry["joint"] == joint and is_here and entry["missed"]:
            return rpt_(
                "{joint} cannot reach the pin and stays {distance} away: move the pin closer, or "
                "pin the pelvis too",
                joint=iface_(entry["text"]),
                distance=entry["missed"],
            )
    return ""


class SCOPE_OT_add_pin(EditOperator):
    """Pin a joint to a place in one frame, and solve the motion around it again"""

    bl_idname = "scope.add_pin"
    bl_label = "Add Pin"

    joint: StringProperty(
        name="Joint", default="left_wrist", description="Name of the joint's bone"
    )
    location: FloatVectorProperty(
        name="Location",
        subtype="TRANSLATION",
        unit="LENGTH",
        description="Where the joint is in that frame",
    )
    frame: IntProperty(
        name="Frame",
        default=_NOW,
        min=_NOW,
        description="Scene frame; the current one if left out",
        options={"HIDDEN"},
    )
    in_image: BoolProperty(
        name="In the Image",
        default=False,
        description="Pin the joint only in the camera's image; its distance from the camera is "
        "free, except the "
        "pelvis's",
    )
    reach: FloatProperty(
        name="Reach",
        default=0.4,
        min=0.02,
        soft_max=2.0,
        subtype="TIME_ABSOLUTE",
        description="Seconds before and after the frame over which the correction fades out",
    )

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Add the pin and change the keys around it."""
        from ..scene.timing import current_frame_kept

        scene = context.scene
        motion = motion_of(armature)
        with current_frame_kept(scene):
            if self.frame != _NOW:
                scene.frame_set(self.frame)
            pin = self._pin(context, armature, motion)
            motion = add_correction(armature, body, rate, motion, pin)
            missed = _unreached(armature, self.joint, scene.frame_current)
        warnings = (missed, floor_warning(armature, motion, body))
        last_pin_warnings[:] = filter(None, warnings)
        for warning in last_pin_warnings:
            self.report({"WARNING"}, warning)
        return ""

    def _pin(self, context: Context, armature: Object, motion: Motion) -> Pin:
        """Return the pin at the scene's current frame. One in the image needs the capture's camera
        where it was captured.

        :raises UsageError: the current frame is outside of the motion.
        """
        import numpy as np

        from ..edit.corrected_motion import corrections_of, shot_of
        from ..edit.corrections import Pin, world_of
        from ..scene.character.corrected_keys import captured_points

        scene = context.scene
        context.view_layer.update()
        current = scene.frame_float
        frame = shown_frame(scene, armature, motion)
        points = [np.array(self.location, float)]
        if self.in_image and scene.camera is not None:
            points.append(np.array(scene.camera.matrix_world.translation))
        at = captured_points(armature, current, np.array(points))
        row = int(np.abs(motion.frames - frame).argmin())
        centre = motion.world_from_camera[row, :3, 3]
        if len(at) == 2 and np.linalg.norm(at[1] - centre) < 0.02:
            u, v = shot_of(motion).project(frame, at[0])
            return Pin(frame, self.joint, pixel=(float(u), float(v)), reach=self.reach)
        world = world_of(corrections_of(motion))
        x, y, z = at[0] if world is None else (np.linalg.inv(world) @ [*at[0], 1.0])[:3]
        return Pin(frame, self.joint, position=(float(x), float(y), float(z)), reach=self.reach)


class CorrectSpanOperator(CorrectionOperator, SpanOperator):
    """A correction of a span of frames. Not registered."""

    if TYPE_CHECKING:  # implemented by each operator

        def correction(self, first: int, last: int) -> Correction:
            """Return the correction of these frames of the footage."""

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Add the correction and change the keys."""
        self.correct(armature, body, rate, motion_of(armature))
        return ""

    def correct(self, armature: Object, body: Body, rate: float, motion: Motion) -> None:
        """Do what `edit` does, with the person's motion."""
        from ..scene.character.corrected_keys import source_frame, whole_span

        begins, ends = whole_span(armature, motion, rate)
        span = self.start, self.end
        if begins <= self.end and self.start <= ends:  # the part of it in which there is a motion
            span = max(self.start, begins), min(self.end, ends)
        first, last = (source_frame(armature, motion, frame, rate) for frame in span)
        motion = add_correction(armature, body, rate, motion, self.correction(first, last))
        for warning in filter(None, self.warnings(armature, motion, body)):
            self.report({"WARNING"}, warning)

    def warnings(self, armature: Object, motion: Motion, body: Body) -> list[str]:
        """Return what to warn of in a corrected motion; empty texts are left out."""
        return [floor_warning(armature, motion, body)]


class SCOPE_OT_foot_stands(CorrectSpanOperator):
    """Keep a foot in place on the floor from the first to the last frame"""

    bl_idname = "scope.foot_stands"
    bl_label = "Foot Stands"

    foot: EnumProperty(
        name="Foot",
        items=(("left", "Left", "The left foot", 0), ("right", "Right", "The right foot", 1)),
        default="left",
        description="Which foot stands",
    )

    def correction(self, first: int, last: int) -> Correction:
        """Return the contact."""
        from ..edit.corrections import Contact

        return Contact(first, last, self.foot)


class SCOPE_OT_this_rests(CorrectSpanOperator):
    """Let a part of the body rest on the floor, in one place, from the first to the last frame"""

    bl_idname = "scope.this_rests"
    bl_label = "This Rests"

    part: EnumProperty(
        name="Part",
        items=(
            ("left_hand", "Left Hand", "The lowest point of the hand is on the floor", 0),
            ("right_hand", "Right Hand", "The lowest point of the hand is on the floor", 1),
            ("left_elbow", "Left Elbow", "The lowest point of the forearm is on the floor", 2),
            ("right_elbow", "Right Elbow", "The lowest point of the forearm is on the floor", 3),
            ("left_knee", "Left Knee", "The lowest point of the shin is on the floor", 4),
            ("right_knee", "Right Knee", "The lowest point of the shin is on the floor", 5),
            ("seat", "Seat", "The person sits on the floor", 6),
            ("back", "Back", "The person lies with seat and back on the floor", 7),
        ),
        default="left_hand",
        description="What rests on the floor",
    )

    def correction(self, first: int, last: int) -> Correction:
        """Return the contact."""
        from ..edit.corrections import Contact

        return Contact(first, last, self.part)

    def warnings(self, armature: Object, motion: Motion, body: Body) -> list[str]:
        """Say also where the body cannot reach the floor."""
        return [*super().warnings(armature, motion, body), self._off_floor(motion, body)]

    def _off_floor(self, motion: Motion, body: Body) -> str:
        """Return the message about a part that stays away from the floor; empty if it rests."""
        from ..edit.corrected_motion import corrections_of, height_at_rest
        from ..edit.corrections import Contact

        own = [c for c in corrections_of(motion) if isinstance(c, Contact) and c.part == self.part]
        heights = [height_at_rest(motion, body, each) for each in own]
        height = max(heights, key=abs, default=0.0)
        if abs(height) < _RESTS_M:
            return ""
        name = self.properties.bl_rna.properties["part"].enum_items[self.part].name
        return rpt_(
            "{part} stays up to {distance:.0f} cm above the floor: pin the pelvis, or what keeps "
            "it there"
            if height > 0
            else "{part} gets up to {distance:.0f} cm under the floor: remove the pin or contact "
            "that pulls it there",
            part=iface_(name),
            distance=100 * abs(height),
        )


class SCOPE_OT_exchange_sides(CorrectSpanOperator):
    """Exchange left and right from the first to the last frame; applying it again undoes it"""

    bl_idname = "scope.exchange_sides"
    bl_label = "Exchange Left and Right"

    limbs: EnumProperty(
        name="Limbs",
        items=(
            ("both", "Arms and Legs", "All four limbs", 0),
            ("legs", "Legs", "Only the legs", 1),
            ("arms", "Arms", "Only the arms", 2),
        ),
        default="both",
        description="Which limbs are exchanged",
    )

    def correction(self, first: int, last: int) -> Correction:
        """Return the exchange."""
        from ..edit.corrections import Exchange

        return Exchange(first, last, self.limbs)


class SCOPE_OT_flip_limb(CorrectSpanOperator):
    """Mirror a limb in depth, as the camera sees it; applying it again undoes it"""

    bl_description = (
        "Mirror a limb in depth from the first to the last frame: it stays where it is in the "
        "image, and points away from the camera instead of towards it, or the reverse. Applying "
        "it again undoes it"
    )
    bl_idname = "scope.flip_limb"
    bl_label = "Flip Limb in Depth"

    limb: EnumProperty(
        name="Limb",
        items=(
            ("left_arm", "Left Arm", "The whole left arm", 0),
            ("right_arm", "Right Arm", "The whole right arm", 1),
            ("left_leg", "Left Leg", "The whole left leg", 2),
            ("right_leg", "Right Leg", "The whole right leg", 3),
            ("left_forearm", "Left Forearm", "The left arm from the elbow on", 4),
            ("right_forearm", "Right Forearm", "The right arm from the elbow on", 5),
            ("left_shin", "Left Shin", "The left leg from the knee on", 6),
            ("right_shin", "Right Shin", "The right leg from the knee on", 7),
        ),
        default="left_leg",
        description="Which limb is mirrored",
    )

    def correction(self, first: int, last: int) -> Correction:
        """Return the flip."""
        from ..edit.corrections import DepthFlip

        return DepthFlip(first, last, self.limb)


class SCOPE_OT_turn_around(CorrectSpanOperator):
    """Turn the person to show the other side to the camera; applying it again undoes it"""

    bl_description = (
        "Mirror the whole person in depth from the first to the last frame, for frames in which "
        "front and back are mistaken for each other. Applying it again undoes it"
    )
    bl_idname = "scope.turn_around"
    bl_label = "Turn Around"

    def correction(self, first: int, last: int) -> Correction:
        """Return the flip of the whole body."""
        from ..edit.corrections import BODY, DepthFlip

        return DepthFlip(first, last, BODY)


class SCOPE_OT_remove_correction(CorrectionOperator):
    """Remove the correction and restore the motion around it"""

    bl_idname = "scope.remove_correction"
    bl_label = "Remove Correction"

    index: IntProperty(
        name="Number", default=-1, min=-1, description="Counted from 0; -1 removes all"
    )

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a captured armature with corrections."""
        if not super().poll(context):
            return False
        armature = captured_armature(context)
        if armature is None or not listed_corrections(armature):
            return refuse(cls, "The selected person has no corrections")
        return True

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Remove it and change the keys back.

        :raises UsageError: there is no correction of this number, or sides were exchanged by it in
            some frames only of another one.
        """
        from ..edit.corrections import without

        kinds = [entry["kind"] for entry in listed_corrections(armature)]
        if self.index >= len(kinds):
            raise UsageError(
                f"there is no correction {self.index}; '{armature.name}' has {len(kinds)}, "
                "counted from 0"
            )
        motion = motion_of(armature)
        removed = set(kinds if self.index < 0 else kinds[self.index : self.index + 1])
        if shared := removed & {"UPRIGHT", "FLOOR"}:  # which others of the capture have too
            motion = change_world(
                context.scene, armature, motion, lambda present: without_kinds(present, shared)
            )
        if removed - shared:
            change_corrections(
                armature,
                body,
                rate,
                motion,
                lambda present: without(present, self.index) if self.index >= 0 else (),
            )
        return ""


CLASSES = (
    SCOPE_OT_add_pin,
    SCOPE_OT_foot_stands,
    SCOPE_OT_this_rests,
    SCOPE_OT_exchange_sides,
    SCOPE_OT_flip_limb,
    SCOPE_OT_turn_around,
    SCOPE_OT_remove_correction,
)
