# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes of the operators that edit a captured motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import IntProperty

from ..errors import UsageError
from .captured_person import body_of, captured_armature, library_of
from .reporting import ReportingOperator, tip_

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from ...solver.body import Body
    from ..edit.clip import Clip


def edit_clip(
    armature: bpy.types.Object,
    body: Body,
    rate: float,
    change: Callable[[Clip, NDArray[np.float64]], Clip],
) -> None:
    """Replace the keys of a captured armature on the same frames.

    :param rate: of the scene, frames per second.
    :param change: returns the new poses, given the present ones and the scene frame of each, (T,).
    """
    from ..scene.character.keys import read_clip, write_clip

    clip, frames = read_clip(armature, body, rate)
    write_clip(armature, body, change(clip, frames), frames)


def may_edit(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Return whether there is a captured armature whose keys are stored in this file; if not, say
    why.
    """
    armature = captured_armature(context)
    if armature is None:
        cls.poll_message_set(tip_("Select the armature of a capture first"))
        return False
    library = library_of(armature)
    if library is not None:
        cls.poll_message_set(
            tip_(
                "'{name}' or its motion is linked from {file}, so changes would be lost: make both "
                "local (Object > "
                "Relations > Make Local > All) or edit them in that file",
                name=armature.name,
                file=library.filepath,
            )
        )
        return False
    return True


class EditOperator(ReportingOperator):
    """An operator that edits the keys of the active capture; if it fails, the keys are unchanged.
    Not registered.
    """

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require a captured armature whose keys are stored in this file."""
        return may_edit(cls, context)

    if TYPE_CHECKING:  # implemented by each operator

        def edit(
            self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float
        ) -> str:
            """Change the keys and return a message for the user, which may be empty."""

    def work(self, context: bpy.types.Context) -> str:
        """Edit the keys; if that fails, restore them."""
        from ..scene.timing import scene_rate
        from ..scene.transaction import all_or_nothing

        message = ""
        people = self.people(context)
        rate = scene_rate(context.scene)
        with all_or_nothing(context.scene, *people):
            for armature in people:
                message = self.edit(context, armature, body_of(armature), rate)
        return message

    def people(self, context: bpy.types.Context) -> list[bpy.types.Object]:
        """Return the captured armatures to edit: the active one."""
        armature = captured_armature(context)
        assert armature is not None  # checked by poll
        return [armature]


class SpanOperator(EditOperator):
    """An operator on a span of frames, which a dialog asks for. Not registered."""

    start: IntProperty(name="First Frame", description="First frame of the span")
    end: IntProperty(name="Last Frame", description="Last frame of the span, inclusive")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the span; suggest the preview range, if there is one."""
        scene = context.scene
        if scene.use_preview_range:
            self.start = scene.frame_preview_start
            self.end = scene.frame_preview_end
        else:
            self.start, self.end = self.default_span(scene)
        outcome: set[str] = context.window_manager.invoke_props_dialog(self)
        return outcome

    def work(self, context: bpy.types.Context) -> str:
        """Edit the keys within the span.

        :raises UsageError: the span ends before it begins.
        """
        if self.end < self.start:
            raise UsageError(
                f"the span ends in frame {self.end}, before it begins in frame "
                f"{self.start}; swap them"
            )
        return super().work(context)

    def default_span(self, scene: bpy.types.Scene) -> tuple[int, int]:
        """Return the span to suggest without a preview range: around the current frame."""
        return scene.frame_current - 2, scene.frame_current + 2
