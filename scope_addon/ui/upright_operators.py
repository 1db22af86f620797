# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that correct what is upright in the world, by a line in the footage or in a view from
the side, and the floor's height, by a foot that rests on it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import bpy
from bpy.props import EnumProperty, FloatVectorProperty
from bpy.types import Area, Context, Event, Object, Operator, Region, Scene

from ...solver.errors import ScopeError
from ..errors import UsageError
from .captured_person import captured_armature, may_edit, motion_of
from .comparison import camera_of
from .correction_operators import CorrectionOperator, change_world, shown_frame
from .reporting import iface_, refuse, rpt_, sentence
from .viewports import Pointer, draw_line, main_region, redraw_viewport, region_at

if TYPE_CHECKING:
    from ...solver.body import Body
    from ..arrays import Float64Array
    from ..motion import Motion

_HELP = (
    "Draw a line along something upright: a door or post in the footage, or a standing person in a "
    "side view.  "
    "Esc: cancel"
)
# how the types of events begin that move a view
_NAVIGATION = ("MIDDLEMOUSE", "WHEEL", "TRACKPAD", "NUMPAD")
_SAME_M = 0.002


class SCOPE_OT_set_upright(CorrectionOperator):
    """Turn the capture and its camera so that a line in the footage is upright"""

    bl_idname = "scope.set_upright"
    bl_label = "Set Upright"

    start: FloatVectorProperty(
        name="Start", size=2, description="Pixel of the footage, from its top left"
    )
    end: FloatVectorProperty(
        name="End", size=2, description="Pixel of the footage, from its top left"
    )

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Move everybody of the capture, and the camera."""
        from ..edit.upright import upright_transform

        scene = context.scene
        motion = motion_of(armature)
        frame = shown_frame(scene, armature, motion)
        transform = upright_transform(motion, body, frame, (tuple(self.start), tuple(self.end)))
        _set_upright(scene, armature, motion, transform)
        return ""


def _set_upright(scene: Scene, armature: Object, motion: Motion, transform: Float64Array) -> None:
    """Move everybody of a capture, and the camera, by a transform (4, 4) of the world."""
    from ..edit.corrections import Upright, added

    upright = Upright.of(transform)
    change_world(scene, armature, motion, lambda present: added(present, upright))


class SCOPE_OT_set_upright_in_view(CorrectionOperator):
    """Turn capture and camera so that a line in an orthographic view is upright"""

    bl_description = (
        "Turn the capture and its camera so that a line in an orthographic view from a side is "
        "upright"
    )
    bl_idname = "scope.set_upright_in_view"
    bl_label = "Set Upright in View"

    start: FloatVectorProperty(
        name="Start", size=3, subtype="TRANSLATION", description="Point of the scene"
    )
    end: FloatVectorProperty(
        name="End", size=3, subtype="TRANSLATION", description="Point of the scene"
    )
    direction: FloatVectorProperty(
        name="Direction",
        size=3,
        default=(0.0, 1.0, 0.0),
        description="Direction of the scene in which the view looks",
    )

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Move everybody of the capture, and the camera."""
        import numpy as np

        from ..edit.upright import upright_transform_in_view
        from ..scene.character.corrected_keys import captured_points

        scene = context.scene
        motion = motion_of(armature)
        points = np.array([self.start, self.end, self.start])
        points[2] += self.direction
        current = scene.frame_float
        start, end, beyond = captured_points(armature, current, points)
        transform = upright_transform_in_view(motion, body, (start, end), beyond - start)
        _set_upright(scene, armature, motion, transform)
        return ""


@dataclass
class _Line:
    """The line that is drawn: its ends in pixels of a region, and the address of the region's
    viewport.
    """

    ends: list[tuple[float, float]] = field(default_factory=list)
    area: int = 0


class SCOPE_OT_upright_line(Operator):
    """Draw a line along something upright"""

    bl_description = (
        "Draw a line along something upright, in the footage or a side view; it rotates the "
        "capture and its camera"
    )
    bl_idname = "scope.upright_line"
    bl_label = "Upright Line"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a viewport in which the line can be drawn."""
        space = context.space_data
        areas = context.window.screen.areas if context.window else ()
        if (
            space is None
            or space.type != "VIEW_3D"
            or not any(_takes_line(context.scene, area) for area in areas)
        ):
            return refuse(
                cls,
                "Press Compare with Footage or switch to an orthographic side view; the line "
                "is drawn there",
            )
        return may_edit(cls, context)

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Wait for the line."""
        self._line = _Line()
        self._pointer = Pointer()
        self._handler = bpy.types.SpaceView3D.draw_handler_add(
            _draw, (self._line,), "WINDOW", "POST_PIXEL"
        )
        context.workspace.status_text_set(iface_(_HELP))
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Context, event: Event) -> set[str]:
        """Follow the mouse."""
        line = self._line
        x, y = self._pointer.place(event)
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            self.cancel(context)
            return {"CANCELLED"}
        if not line.ends:
            area = (
                _area_at(context, x, y)
                if event.type == "LEFTMOUSE" and event.value == "PRESS"
                else None
            )
            if area is not None:
                line.area = area.as_pointer()
                region = main_region(area)
                line.ends = [(x - region.x, y - region.y)] * 2
            return {"PASS_THROUGH"} if event.type.startswith(_NAVIGATION) else {"RUNNING_MODAL"}
        viewport = region_at(line.area)
        if viewport is None:
            self.cancel(context)
            return {"CANCELLED"}
        area, region = viewport
        if event.type == "MOUSEMOVE":
            line.ends[1] = (x - region.x, y - region.y)
            area.tag_redraw()
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self.cancel(context)
            self._finish(context, area, region)
            return {"FINISHED"}
        return {"RUNNING_MODAL"}

    def cancel(self, context: Context) -> None:
        """Remove the line."""
        bpy.types.SpaceView3D.draw_handler_remove(self._handler, "WINDOW")
        context.workspace.status_text_set(None)
        context.window.cursor_modal_restore()
        redraw_viewport(self._line.area)

    def _finish(self, context: Context, area: Area, region: Region) -> None:
        """Set what is upright, which is a step to undo of its own."""
        from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d

        view = area.spaces.active.region_3d
        ends = self._line.ends
        origins = [region_2d_to_origin_3d(region, view, at) for at in ends]
        directions = [region_2d_to_vector_3d(region, view, at) for at in ends]
        try:
            if view.view_perspective == "CAMERA":
                rays = [
                    origin + 3.0 * along for origin, along in zip(origins, directions, strict=True)
                ]
                start, end = _pixels(context, rays)
                bpy.ops.scope.set_upright("EXEC_DEFAULT", True, start=start, end=end)
            else:
                start, end = origins
                use = bpy.ops.scope.set_upright_in_view
                use("EXEC_DEFAULT", True, start=start, end=end, direction=directions[0])
        except (RuntimeError, ScopeError) as error:
            self.report({"ERROR"}, sentence(str(error).removeprefix("Error: ")))


def _takes_line(scene: Scene, area: Area) -> bool:
    """Return whether an area shows the footage through the capture's camera, or an orthographic
    view.
    """
    if area.type != "VIEW_3D":
        return False
    perspective = area.spaces.active.region_3d.view_perspective
    through_camera = (
        perspective == "CAMERA" and scene.camera is not None and scene.camera == camera_of(scene)
    )
    return perspective == "ORTHO" or through_camera


def _area_at(context: Context, x: int, y: int) -> Area | None:
    """Return the area under the mouse, unless it takes no line or a sidebar, toolbar or header is
    there.
    """
    for area in context.window.screen.areas:
        shown = [
            r
            for r in area.regions
            if r.width > 1 and 0 <= x - r.x < r.width and 0 <= y - r.y < r.height
        ]
        if shown and all(r.type == "WINDOW" for r in shown) and _takes_line(context.scene, area):
            return area
    return None


def _pixels(context: Context, points: list[object]) -> list[tuple[float, float]]:
    """Return the pixels of the footage at which points of the scene are.

    :raises UsageError: the person was removed, or their motion does not contain the current frame.
    """
    import numpy as np

    from ..edit.corrected_motion import shot_of
    from ..scene.character.corrected_keys import captured_points

    armature = captured_armature(context)
    scene = context.scene
    if armature is None:  # since the line was begun
        raise UsageError("the captured person was removed; select another one")
    motion = motion_of(armature)
    current = scene.frame_float
    frame = shown_frame(scene, armature, motion)
    at = captured_points(armature, current, np.array(points, float))
    u, v = (shot_of(motion).project(frame, point) for point in at)
    return [(float(u[0]), float(u[1])), (float(v[0]), float(v[1]))]


def _draw(line: _Line) -> None:
    if line.ends and bpy.context.area is not None and bpy.context.area.as_pointer() == line.area:
        draw_line(line.ends, (1.0, 0.8, 0.2, 0.9))


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

    def edit(self, context: Context, armature: Object, body: Body, rate: float) -> str:
        """Move everybody of the capture, and the camera."""
        from ..edit.corrections import Floor, added
        from ..scene.character.corrected_keys import heights_of_foot

        scene = context.scene
        motion = motion_of(armature)
        frame = shown_frame(scene, armature, motion)
        height, shown = heights_of_foot(armature, body, rate, motion, frame, self.foot)
        floor = Floor(frame, height)
        # Edited keys may have the foot elsewhere than the motion.
        rise = height - shown if abs(height - shown) > _SAME_M else 0.0
        motion = change_world(scene, armature, motion, lambda present: added(present, floor), rise)
        if warning := _others_under_floor(motion, body):
            self.report({"WARNING"}, warning)
        return ""


def _others_under_floor(motion: Motion, body: Body) -> str:
    """Return the message about feet that are now under the floor in other frames; empty if there
    are none.
    """
    from ..kinematics.foot_skin import UNDER_FLOOR_M, depth_under_floor

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


CLASSES = (
    SCOPE_OT_set_upright,
    SCOPE_OT_set_upright_in_view,
    SCOPE_OT_upright_line,
    SCOPE_OT_floor_here,
)
