# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool that pins limbs with the mouse: drag a handle to where the joint is in the picture, or
in space.

The handles are in every viewport of the file, so that what is dragged beside the footage can be
checked, and dragged again, in the view from the side.
"""

from __future__ import annotations

import math

import bpy
from bpy.types import Area, Context, Event, Object, Operator, Region, Window
from mathutils import Vector

from ..scene.character.correction_list import listed_corrections
from ..scene.datablocks import is_in_layer
from .captured_person import captured_armature, may_edit
from .comparison import camera_of
from .correction_operators import last_pin_warnings
from .reporting import iface_, rpt_
from .viewports import Pointer, draw_disc, draw_line, redraw_sidebars, region_at, viewports

_SIDED = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "foot")
HANDLES = ("head", "pelvis", *(f"{side}_{name}" for side in ("left", "right") for name in _SIDED))
# pixels
_RADIUS = 6.0
_NEAR = 16.0
_MOVED = 3.0
_FREE = (1.0, 1.0, 1.0, 0.8)
_HOVERED = (1.0, 0.8, 0.2, 1.0)
_PINNED = (0.9, 0.2, 0.2, 1.0)
_LINE = (1.0, 0.8, 0.2, 0.9)
_MISSED = (1.0, 0.5, 0.1, 1.0)
_HELP = (
    "Drag a handle to where the joint is.  Scrub or play to go to other frames.  Esc or Enter: done"
)


class _Session:
    """What the tool draws; Blender's objects are looked up by name, because undo replaces them"""

    def __init__(self, armature: str, area: int) -> None:
        """Begin with no handle under the mouse.

        :param area: ``as_pointer`` of the viewport with the mouse.
        """
        self.armature = armature
        self.area = area
        self.hovered = self.dragged = ""
        self.start: tuple[float, float] = (0.0, 0.0)
        self.mouse: tuple[float, float] = (0.0, 0.0)
        self.pointer = Pointer()
        self._handler = bpy.types.SpaceView3D.draw_handler_add(
            _draw, (self,), "WINDOW", "POST_PIXEL"
        )

    def follow(self, active: Object | None) -> None:
        """Show the handles of the active person, whom a click on the body may have changed."""
        if active is not None and active.name != self.armature:
            self.armature = active.name
            self.hovered = ""
            _redraw()

    def end(self) -> None:
        """Remove the handles; the modal operator ends at its next event."""
        global _running
        if _running is self:
            _running = None
            bpy.types.SpaceView3D.draw_handler_remove(self._handler, "WINDOW")
        _redraw()


_running: _Session | None = None


def is_running() -> bool:
    """Return whether the handles are shown"""
    return _running is not None


def detach() -> None:
    """Remove the handles: Blender drops a modal operator whose class is unregistered without
    calling ``cancel``.
    """
    if _running is not None:
        _running.end()


class SCOPE_OT_pin_limb(Operator):
    """Drag handles on the body to where the joints are in this frame"""

    bl_description = (
        "Drag handles on the body to where the joints are in this frame; the motion around is "
        "solved again"
    )
    bl_idname = "scope.pin_limb"
    bl_label = "Pin Limbs"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a captured armature in a 3D viewport."""
        if context.area is None or context.area.type != "VIEW_3D":
            return False
        return may_edit(cls, context)

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Show the handles; hide them if they are shown."""
        global _running
        if _running is not None:
            _running.end()
            context.workspace.status_text_set(None)
            return {"FINISHED"}
        armature = captured_armature(context)
        assert armature is not None  # checked by poll
        self._session = _running = _Session(armature.name, context.area.as_pointer())
        context.workspace.status_text_set(iface_(_HELP))
        context.window_manager.modal_handler_add(self)
        _redraw()
        return {"RUNNING_MODAL"}

    def modal(self, context: Context, event: Event) -> set[str]:
        """Follow the mouse."""
        session = self._session
        if session is not _running:  # ended by its button
            return {"FINISHED", "PASS_THROUGH"}
        x, y = session.pointer.place(event)
        if not session.dragged:
            session.follow(captured_armature(context))
            _move_to_viewport(session, context.window, (x, y))
        viewport = region_at(session.area)
        if viewport is None or session.armature not in bpy.data.objects:
            self.cancel(context)
            return {"CANCELLED"}
        area, region = viewport
        session.mouse = (x - region.x, y - region.y)
        inside = 0 <= session.mouse[0] < region.width and 0 <= session.mouse[1] < region.height
        if event.type == "MOUSEMOVE":
            if not session.dragged:
                session.hovered = _nearest(session, area, region) if inside else ""
            area.tag_redraw()
            return {"RUNNING_MODAL"} if session.dragged else {"PASS_THROUGH"}
        busy = bool(session.dragged)
        if event.type == "LEFTMOUSE" and event.value == "PRESS" and inside:
            session.hovered = _nearest(session, area, region)
            session.dragged = session.hovered
            session.start = session.mouse
            context.workspace.status_text_set(iface_(_HELP))  # in place of the last pin's warnings
            busy = bool(session.dragged)
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE" and busy:
            self._drop(context, area, region)
        elif event.type in ("ESC", "RIGHTMOUSE", "RET", "NUMPAD_ENTER") and event.value == "PRESS":
            if not busy:
                self.cancel(context)
                return {"FINISHED"}
            session.dragged = ""
            area.tag_redraw()
        return {"RUNNING_MODAL"} if busy else {"PASS_THROUGH"}

    def cancel(self, context: Context) -> None:
        """Remove the handles."""
        self._session.end()
        context.workspace.status_text_set(None)

    def _drop(self, context: Context, area: Area, region: Region) -> None:
        """Pin the dragged joint under the mouse, which is a step to undo of its own."""
        from bpy_extras.view3d_utils import location_3d_to_region_2d, region_2d_to_location_3d

        session = self._session
        joint = session.dragged
        session.dragged = ""
        session.hovered = ""
        _redraw()
        if math.dist(session.mouse, session.start) < _MOVED:
            return
        view = area.spaces.active.region_3d
        was = _joint_positions(session).get(joint)
        at = location_3d_to_region_2d(region, view, was) if was is not None else None
        if at is None:  # the bone was removed or renamed meanwhile, or is behind the viewer
            return
        screen = at + Vector(session.mouse) - Vector(session.start)
        location = region_2d_to_location_3d(region, view, screen, was)
        person = bpy.data.objects[session.armature]
        if not is_in_layer(context.view_layer, person):  # another scene is shown by now
            text = rpt_(
                "'{rig}' is not in the scene's view layer: add it to the scene, or enable its "
                "collection in the Outliner",
                rig=person.name,
            )
            self.report({"ERROR"}, text)
            return
        if person != captured_armature(context):  # something else was selected
            context.view_layer.objects.active = person
        in_image = view.view_perspective == "CAMERA" and context.scene.camera == camera_of(
            context.scene
        )
        try:
            bpy.ops.scope.add_pin(
                "EXEC_DEFAULT", True, joint=joint, location=location, in_image=in_image
            )
        except RuntimeError as error:
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return
        for warning in last_pin_warnings:
            # in Blender's log: its status bar shows the tool's text in place of it
            self.report({"WARNING"}, warning)
        if last_pin_warnings:
            context.workspace.status_text_set("  ".join(last_pin_warnings))


def _redraw() -> None:
    """Redraw the viewports with the handles, and the panel with the tool's button"""
    for _, area in viewports():
        area.tag_redraw()
    redraw_sidebars()


def _move_to_viewport(session: _Session, window: Window, at: tuple[int, int]) -> None:
    """Go on in the viewport under the mouse, if there is one.

    :param at: pixels of the window.
    """
    for shown, area in viewports():
        inside = 0 <= at[0] - area.x < area.width and 0 <= at[1] - area.y < area.height
        if shown == window and inside and area.as_pointer() != session.area:
            session.hovered = ""
            session.area = area.as_pointer()
            _redraw()


def _joint_positions(session: _Session) -> dict[str, Vector]:
    """Return the handles' positions in the scene"""
    armature = bpy.data.objects.get(session.armature)
    bones = armature.pose.bones if armature is not None and armature.pose is not None else {}
    return {name: armature.matrix_world @ bones[name].head for name in HANDLES if name in bones}


def _nearest(session: _Session, area: Area, region: Region) -> str:
    """Return the handle under the mouse, or an empty name"""
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    best = _NEAR * bpy.context.preferences.system.ui_scale
    found = ""
    for name, place in _joint_positions(session).items():
        at = location_3d_to_region_2d(region, area.spaces.active.region_3d, place)
        if at is not None and math.dist(at, session.mouse) < best:
            best = math.dist(at, session.mouse)
            found = name
    return found


def _draw(session: _Session) -> None:
    """Draw the handles and this frame's pins"""
    import blf
    import gpu
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    context = bpy.context
    armature = bpy.data.objects.get(session.armature)
    space = context.space_data
    if armature is None or context.area is None or context.region_data is None:
        return
    if space.local_view and not armature.evaluated_get(context.view_layer.depsgraph).local_view_get(
        space
    ):
        return  # only evaluated objects know in which local views they are
    here = context.area.as_pointer() == session.area
    frame = context.scene.frame_current
    scale = context.preferences.system.ui_scale
    pins = [
        each
        for each in listed_corrections(armature)
        if each["kind"] == "PIN" and each["first"] <= frame <= each["last"]
    ]
    # how far away the joint stays; empty where it does not
    missed = {e["joint"]: e["missed"] for e in pins}
    gpu.state.blend_set("ALPHA")
    for name, place in _joint_positions(session).items():
        at = location_3d_to_region_2d(context.region, context.region_data, place)
        if at is None:
            continue
        if here and name == session.dragged:
            target = (
                at[0] + session.mouse[0] - session.start[0],
                at[1] + session.mouse[1] - session.start[1],
            )
            draw_line([tuple(at), target], _LINE)
            draw_disc(target, 1.4 * _RADIUS * scale, _HOVERED)
        color = _FREE if name not in missed else _MISSED if missed[name] else _PINNED
        if name == session.hovered:
            color = _HOVERED
        draw_disc(tuple(at), (1.3 if name == session.hovered else 1.0) * _RADIUS * scale, color)
        label = (
            iface_(name.replace("_", " ").title())
            if here and name in (session.hovered, session.dragged)
            else ""
        )
        if label or missed.get(name):
            blf.enable(0, blf.SHADOW)  # over light footage
            blf.shadow(0, 5, 0.0, 0.0, 0.0, 0.9)
            blf.size(0, 13 * scale)
            blf.color(0, *(_MISSED if missed.get(name) else (1.0, 1.0, 1.0, 1.0)))
            blf.position(0, at[0] + 14 * scale, at[1] + 8 * scale, 0)
            blf.draw(0, "  ".join(filter(None, (label, missed.get(name)))))
            blf.disable(0, blf.SHADOW)
    gpu.state.blend_set("NONE")


CLASSES = (SCOPE_OT_pin_limb,)
