# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that correct what is upright in the world, by a line in the footage."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import FloatVectorProperty

from ..captured_person import captured_armature, motion_of
from ..edit.edit_base import may_edit
from ..reporting import iface_, sentence, tip_
from ..view.comparison import camera_of
from .corrected_person import CorrectionOperator, change_world, shown_frame
from .drawing import draw_line, redraw_viewport, viewport_of
from .pointer import Pointer

if TYPE_CHECKING:
    from ....solver.body import Body

_HELP = "Draw a line along something that is upright: a door, a wall's edge, a post.  Esc: cancel"


class SCOPE_OT_set_upright(CorrectionOperator):
    """Turn the capture and its camera so that a line in the footage is upright"""

    bl_idname = "scope.set_upright"
    bl_label = "Set Upright"

    start: FloatVectorProperty(name="Start", size=2, description="Pixel of the footage, from its top left")
    end: FloatVectorProperty(name="End", size=2, description="Pixel of the footage, from its top left")

    def edit(self, context: bpy.types.Context, armature: bpy.types.Object, body: Body, rate: float) -> str:
        """Move everybody of the capture, and the camera."""
        from ...edit.pins.corrections import Upright, added
        from ...edit.pins.upright import upright_transform

        scene, motion = context.scene, motion_of(armature)
        frame = shown_frame(scene, armature, motion)
        transform = upright_transform(motion, body, frame, (tuple(self.start), tuple(self.end)))
        change_world(scene, armature, rate, lambda present: added(present, Upright.of(transform)))
        return ""


class SCOPE_OT_upright_line(bpy.types.Operator):
    """Draw a line in the footage along something that is upright; the capture and its camera turn with it"""

    bl_idname = "scope.upright_line"
    bl_label = "Upright Line"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require the view through the capture's camera."""
        space = context.space_data
        if space is None or space.type != "VIEW_3D" or space.region_3d.view_perspective != "CAMERA":
            cls.poll_message_set(tip_("Press Compare with Footage first: the line is drawn in the footage"))
            return False
        return may_edit(cls, context) and context.scene.camera == camera_of(context.scene)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Wait for the line."""
        self._area = context.area.as_pointer()
        self._line: list[tuple[float, float]] = []
        self._pointer = Pointer()
        draw = bpy.types.SpaceView3D.draw_handler_add
        self._handler = draw(_draw, (self._line, self._area), "WINDOW", "POST_PIXEL")
        context.workspace.status_text_set(iface_(_HELP))
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Follow the mouse."""
        viewport = viewport_of(self._area)
        if viewport is None:
            self.cancel(context)
            return {"CANCELLED"}
        area, region = viewport
        x, y = self._pointer.place(event)
        mouse = (x - region.x, y - region.y)
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            self.cancel(context)
            return {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            self._line[:] = [mouse, mouse]
        elif event.type == "MOUSEMOVE" and self._line:
            self._line[1] = mouse
            area.tag_redraw()
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE" and self._line:
            self.cancel(context)
            self._finish(context, area, region)
            return {"FINISHED"}
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Remove the line."""
        bpy.types.SpaceView3D.draw_handler_remove(self._handler, "WINDOW")
        context.workspace.status_text_set(None)
        context.window.cursor_modal_restore()
        redraw_viewport(self._area)

    def _finish(self, context: bpy.types.Context, area: bpy.types.Area, region: bpy.types.Region) -> None:
        """Set what is upright, which is a step to undo of its own."""
        from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d

        from ....solver.errors import ScopeError

        view = area.spaces.active.region_3d
        rays = [
            region_2d_to_origin_3d(region, view, at) + 3.0 * region_2d_to_vector_3d(region, view, at)
            for at in self._line
        ]
        try:
            start, end = _pixels(context, rays)
            bpy.ops.scope.set_upright("EXEC_DEFAULT", True, start=start, end=end)
        except (RuntimeError, ScopeError) as error:
            self.report({"ERROR"}, sentence(str(error).removeprefix("Error: ")))


def _pixels(context: bpy.types.Context, points: list[object]) -> list[tuple[float, float]]:
    """Return the pixels of the footage at which points of the scene are.

    :raises UsageError: the person was removed, or their motion does not contain the current frame.
    """
    import numpy as np

    from ...edit.pins.corrected_motion import shot_of
    from ...errors import UsageError
    from ...scene.character.corrections.corrected_keys import captured_points

    armature, scene = captured_armature(context), context.scene
    if armature is None:  # since the line was begun
        raise UsageError("the captured person was removed; select another one")
    motion, current = motion_of(armature), scene.frame_current + scene.frame_subframe
    frame = shown_frame(scene, armature, motion)
    at = captured_points(armature, current, np.array(points, float))
    u, v = (shot_of(motion).project(frame, point) for point in at)
    return [(float(u[0]), float(u[1])), (float(v[0]), float(v[1]))]


def _draw(line: list[tuple[float, float]], area: int) -> None:
    if line and bpy.context.area is not None and bpy.context.area.as_pointer() == area:
        draw_line(line, (1.0, 0.8, 0.2, 0.9))


CLASSES = (SCOPE_OT_set_upright, SCOPE_OT_upright_line)
