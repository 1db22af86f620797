# SPDX-License-Identifier: GPL-3.0-or-later
"""The active captured person, and the data of the capture that is stored with its armature,
and the base classes of the operators that edit its motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import IntProperty
from bpy.types import Context, Event, Object, Operator, Scene, UILayout

from ...solver.errors import ScopeError
from ..errors import UsageError
from ..scene.datablocks import action_of, holds, is_person
from ..scene.stored_values import source_of, stored_numbers, stored_text
from .reporting import ReportingOperator, refuse

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...solver.body import Body
    from ..arrays import Float64Array
    from ..edit.clip import Clip
    from ..motion import Motion

# Custom property of a rig: the captured armature that it was retargeted from.
PERSON = "scope_person"


def captured_armature(context: Context) -> Object | None:
    """Return the captured armature of the active object, or else the only one of the selected
    capture or scene.
    """
    obj = context.view_layer.objects.active if context.view_layer else None
    while obj is not None:
        if is_person(obj):
            return obj
        person = retargeted_from(context.scene, obj)
        if person is not None:
            return person
        found = [child for child in obj.children if is_person(child)]
        if len(found) == 1:
            return found[0]
        obj = obj.parent
    collection = context.scene.scope.capture
    found = captured_people(context)
    last = [o for o in found if holds(collection, o)] if collection else []
    return last[0] if len(last) == 1 else found[0] if len(found) == 1 else None


def stored_person(rig: Object) -> Object | None:
    """Return the captured armature that a rig was retargeted from; None if it was deleted.

    Blender does not save what a library override of a rig stores, so that an opened file has what
    the library stores; it saves the override's own action.
    """
    stored = rig.get(PERSON)
    person = stored if isinstance(stored, Object) else None
    action = action_of(rig)
    if rig.override_library is None or action is None or action.library is not None:
        return person
    name = source_of(action)
    own = bpy.data.objects.get((name, None))
    is_renamed = own is None and person is not None and person.library is None
    if is_renamed or not name:
        return person
    return own or bpy.data.objects.get(name)


def retargeted_from(scene: Scene, rig: Object) -> Object | None:
    """Return the captured armature in the scene that a rig was retargeted from."""
    person = stored_person(rig)
    if person is None or not is_person(person):
        return None
    return person if holds(scene.collection, person) else None


def captured_people(context: Context) -> list[Object]:
    """Return the captured armatures of the scene."""
    return people_in(context.scene)


def people_in(scene: Scene) -> list[Object]:
    """Return the captured armatures of a scene."""
    return [obj for obj in scene.objects if obj.type == "ARMATURE" and is_person(obj)]


def has_captured_person(context: Context) -> bool:
    """Return whether the scene contains a captured person, or one is active."""
    return captured_armature(context) is not None or bool(captured_people(context))


def draw_active_person(layout: UILayout, context: Context) -> Object | None:
    """Draw the name of the active captured armature, or a request to select one; return the
    armature.
    """
    armature = captured_armature(context)
    text = armature.name if armature else "Select a Captured Person"
    layout.label(
        text=text, icon="OUTLINER_OB_ARMATURE" if armature else "INFO", translate=armature is None
    )
    return armature


def library_of(armature: Object) -> bpy.types.Library | None:
    """Return the library that the armature or its action is linked from, overridden or not; None if
    both are local.
    """
    for block in filter(None, (armature, action_of(armature))):
        original = block.override_library.reference if block.override_library else block
        if original is not None and original.library is not None:
            return original.library
    return None


def body_of(armature: Object) -> Body:
    """Return the body that the person was captured with.

    :raises ModelFileError: the body's file no longer exists or cannot be read.
    :raises UsageError: the armature does not store which body it is.
    """
    from ..untrusted.body_file import load_body

    which = stored_text(armature, "scope_body_file") or stored_text(armature, "scope_body")
    if not which:
        raise UsageError(
            f"'{armature.name}' does not store which body it is; undo what changed "
            "it, or capture again"
        )
    return load_body(which)


def betas_of(armature: Object, body: Body) -> Float64Array:
    """Return the person's shape coefficients, (P,).

    :raises UsageError: the armature does not store them.
    """
    import numpy as np

    betas = np.array(stored_numbers(armature, "scope_betas"))
    if betas.shape != (body.P,):
        raise UsageError(f"'{armature.name}' has no stored body shape; capture again")
    return betas


def motion_of(armature: Object) -> Motion:
    """Return the captured motion, before any editing but with its corrections.

    :raises UsageError: the armature does not store it.
    :raises MotionFileError: what it stores is damaged.
    """
    from ..scene.packed_motion import stored_motion

    return stored_motion(armature)


def motion_if_stored(armature: Object) -> Motion | None:
    """Return the captured motion as `motion_of` does; None if it is lost or damaged."""
    try:
        return motion_of(armature)
    except ScopeError:
        return None


def set_motion_of(armature: Object, motion: Motion, keys: bytes = b"") -> None:
    """Store a motion as the armature's captured one. Undo restores the former one, and its
    duplicates keep it.

    :param keys: the keys from before the motion's corrections, see
        ``scene/character/uncorrected_keys.py``.
    """
    from ..scene.packed_motion import pack_motion

    pack_motion(armature, motion.to_bytes(), keys)


def edit_clip(
    armature: Object, body: Body, rate: float, change: Callable[[Clip, Float64Array], Clip]
) -> None:
    """Replace the keys of a captured armature on the same frames.

    :param rate: for which the keys were written, frames per second.
    :param change: returns the new poses, given the present ones and the scene frame of each, (T,).
    """
    from ..scene.character.keys import read_clip, write_clip

    clip, frames = read_clip(armature, body, rate)
    write_clip(armature, body, change(clip, frames), frames)


def may_edit(cls: type[Operator], context: Context) -> bool:
    """Return whether there is a captured armature whose keys are stored in this file; if not, say
    why.
    """
    armature = captured_armature(context)
    if armature is None:
        return refuse(cls, "Select the armature of a capture first")
    library = library_of(armature)
    if library is not None:
        return refuse(
            cls,
            "'{name}' or its motion is linked from {file}, so changes would be lost: make both "
            "local (Object > "
            "Relations > Make Local > All) or edit them in that file",
            name=armature.name,
            file=library.filepath,
        )
    return True


class EditOperator(ReportingOperator):
    """An operator that edits the keys of the active capture; if it fails, the keys are unchanged.
    Not registered.
    """

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a captured armature whose keys are stored in this file."""
        return may_edit(cls, context)

    if TYPE_CHECKING:  # implemented by each operator

        def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
            """Change the keys and return a message for the user, which may be empty.

            :param rate: for which the keys were written, frames per second.
            """

    def work(self, context: Context) -> str:
        """Edit the keys; if that fails, restore them."""
        from ..scene.timing import keyed_rate
        from ..scene.transaction import all_or_nothing

        message = ""
        people = self.people(context)
        scene = context.scene
        with all_or_nothing(scene, *people):
            for armature in people:
                # not the scene's rate, which an importer may have changed since: that moves no key
                rate = keyed_rate(armature, scene)
                message = self.edit(context, armature, body_of(armature), rate)
        return message

    def people(self, context: Context) -> list[Object]:
        """Return the captured armatures to edit: the active one."""
        armature = captured_armature(context)
        assert armature is not None  # checked by poll
        return [armature]


class SpanOperator(EditOperator):
    """An operator on a span of frames, which a dialog asks for. Not registered."""

    start: IntProperty(name="First Frame", description="First frame of the span")
    end: IntProperty(name="Last Frame", description="Last frame of the span, inclusive")

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for the span; suggest the preview range, if there is one."""
        scene = context.scene
        if scene.use_preview_range:
            self.start = scene.frame_preview_start
            self.end = scene.frame_preview_end
        else:
            self.start, self.end = self.default_span(scene)
        return context.window_manager.invoke_props_dialog(self)

    def work(self, context: Context) -> str:
        """Edit the keys within the span.

        :raises UsageError: the span ends before it begins.
        """
        if self.end < self.start:
            raise UsageError(
                f"the span ends in frame {self.end}, before it begins in frame "
                f"{self.start}; swap them"
            )
        return super().work(context)

    def default_span(self, scene: Scene) -> tuple[int, int]:
        """Return the span to suggest without a preview range: around the current frame."""
        return scene.frame_current - 2, scene.frame_current + 2
