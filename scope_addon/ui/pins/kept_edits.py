# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of keys that the motion keeps like corrections: interpolated frames, feet on the floor.

Where the motion is lost, as in old .blend files without their cache, they edit the keys only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty

from ....solver.errors import ScopeError
from ..captured_person import betas_of, captured_armature, motion_of
from ..edit_base import edit_clip
from ..reporting import tip_
from .corrected_person import CorrectionOperator, change_corrections
from .correction_operators import CorrectSpanOperator, floor_warning

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from ....solver.body import Body
    from ...edit.clip import Clip
    from ...edit.pins.corrections import Correction


class KeptSpanOperator(CorrectSpanOperator):
    """An edit of a span of frames that the motion keeps. Not registered."""

    if TYPE_CHECKING:  # implemented by each operator

        def change(self, body: Body, rate: float) -> Callable[[Clip, NDArray[np.float64]], Clip]:
            """Return the edit of keys whose motion is lost, for ``edit_clip``."""

    def edit(
        self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float
    ) -> str:
        """Edit the keys, and keep that with the motion."""
        if _has_motion(armature):
            return super().edit(context, armature, body, rate)
        edit_clip(armature, body, rate, self.change(body, rate))
        return ""


class SCOPE_OT_interpolate_span(KeptSpanOperator):
    """Replace frames by an interpolation between the pose before and the pose after them"""

    bl_idname = "scope.interpolate_span"
    bl_label = "Interpolate Frames"

    def correction(self, first: int, last: int) -> Correction:
        """Return the interpolation."""
        from ...edit.pins.corrections import Interpolation

        return Interpolation(first, last)

    def change(self, body: Body, rate: float) -> Callable[[Clip, NDArray[np.float64]], Clip]:
        """Return the interpolation of keys."""
        from ...edit.spans import interpolate

        return lambda clip, _: interpolate(clip, self.start / rate, self.end / rate)


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
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require a motion with one floor: on stairs, everything below their middle would be raised
        to it.
        """
        if not super().poll(context):
            return False
        armature = captured_armature(context)
        if armature is not None and armature.get("scope_uneven_ground", False):
            cls.poll_message_set(
                tip_(
                    "This motion was captured on uneven ground, where feet rest at any height: "
                    "use Floor Here"
                )
            )
            return False
        return True

    def edit(
        self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float
    ) -> str:
        """Edit all keys, and keep that with the motion."""
        from ...edit.pins.corrections import FeetOnFloor, added
        from ...scene.character.edited_keys import floored

        feet = FeetOnFloor(self.level, self.lift)
        if not _has_motion(armature):
            betas = betas_of(armature, body)
            edit_clip(
                armature,
                body,
                rate,
                lambda clip, frames: floored(armature, body, betas, (clip, frames), feet),
            )
            return ""
        change_corrections(armature, body, rate, lambda present: added(present, feet), feet)
        if warning := floor_warning(armature, body):
            self.report({"WARNING"}, warning)
        return ""


def _has_motion(armature: bpy.types.Object) -> bool:
    """Return whether the captured motion is there and can be read, with its corrections."""
    from ...edit.pins.corrected_motion import corrections_of

    try:
        corrections_of(motion_of(armature))
    except ScopeError:
        return False
    return True


CLASSES = (SCOPE_OT_interpolate_span, SCOPE_OT_refloor)
