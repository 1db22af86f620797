# SPDX-License-Identifier: GPL-3.0-or-later
"""The tool that chooses whom to capture by a click on a frame of the footage, which it shows over
the viewport.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
from bpy.types import Context, Event, Operator, Region

from ...solver.errors import ScopeError
from . import comparison
from .capture_operators import nothing_runs
from .preferences import cache, python_command
from .reporting import iface_, refuse, sentence
from .viewports import Pointer, redraw_sidebars, redraw_viewport, region_at

if TYPE_CHECKING:
    from ..job.footage_picture import FootagePicture, PictureProcess

_TIMER_S = 0.1
_STEPS_S = {"LEFT_ARROW": -1.0, "RIGHT_ARROW": 1.0, "WHEELUPMOUSE": -1.0, "WHEELDOWNMOUSE": 1.0}
_BACKGROUND = (0.05, 0.05, 0.05, 1.0)
_HELP = "Click the person to capture.  Left and Right Arrow: a second back or forward.  Esc: cancel"
_Size = tuple[float, float]
_Box = tuple[float, float, float, float]


def box_of_picture(size: _Size, visible: _Box) -> _Box:
    """Return left, right, bottom and top of a picture that is as large as fits, in the middle.

    :param size: of the picture.
    :param visible: left, right, bottom and top of the place for it.
    """
    left, right, bottom, top = visible
    scale = min((right - left) / size[0], (top - bottom) / size[1])
    x = (left + right - scale * size[0]) / 2.0
    y = (bottom + top - scale * size[1]) / 2.0
    return x, x + scale * size[0], y, y + scale * size[1]


def person_at(
    mouse: tuple[float, float], box: _Box, size: tuple[int, int], time_s: float
) -> str | None:
    """Return the option's value for who is at a place of the shown frame; None beside the frame.

    :param box: left, right, bottom and top of the shown frame.
    :param size: width and height of the frame that a capture sees. Its first pixel's centre is at
        0, 0.
    """
    left, right, bottom, top = box
    across = (mouse[0] - left) / (right - left)
    down = (top - mouse[1]) / (top - bottom)
    if not (0.0 <= across < 1.0 and 0.0 <= down < 1.0):
        return None
    x = max(0.0, across * size[0] - 0.5)
    y = max(0.0, down * size[1] - 0.5)
    return f"{x:.0f},{y:.0f}@{time_s:.2f}"


class SCOPE_OT_pick_person(Operator):
    """Choose whom to capture by a click on a frame of the footage"""

    bl_idname = "scope.pick_person"
    bl_label = "Pick Person"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a viewport, footage of one camera, and that nothing is running."""
        if context.area is None or context.area.type != "VIEW_3D" or not nothing_runs(cls):
            return False
        settings = context.scene.scope
        if not settings.footage:
            return refuse(cls, "Choose a video or image first")
        if settings.views:
            return refuse(cls, "Remove the other cameras' videos first")
        if settings.queue:
            return refuse(cls, "In each clip of the list, somebody else is at that place")
        return True

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Show the first frame of the part that is captured, and wait for the click."""
        settings = context.scene.scope
        self._process: PictureProcess | None = None
        self._picture: FootagePicture | None = None
        self._texture: Any = None  # of the picture, made when it is drawn
        self._pointer = Pointer()
        self._area = context.area.as_pointer()
        self._time_s = settings.range_start if settings.use_range else 0.0
        if not self._ask(context, self._time_s):
            return {"CANCELLED"}
        self._handler = bpy.types.SpaceView3D.draw_handler_add(
            _draw, (self,), "WINDOW", "POST_PIXEL"
        )
        manager = context.window_manager
        self._timer = manager.event_timer_add(_TIMER_S, window=context.window)
        manager.modal_handler_add(self)
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set(iface_(_HELP))
        redraw_viewport(self._area)
        return {"RUNNING_MODAL"}

    def modal(self, context: Context, event: Event) -> set[str]:
        """Wait for the frame and the click."""
        x, y = self._pointer.place(event)
        viewport = region_at(self._area)
        is_cancelled = event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS"
        if is_cancelled or viewport is None or (event.type == "TIMER" and not self._listen()):
            self.cancel(context)
            return {"CANCELLED"}
        if event.type == "TIMER":
            return {"PASS_THROUGH"}
        if event.value == "PRESS" and event.type in _STEPS_S and self._process is None:
            self._ask(context, max(0.0, self._time_s + _STEPS_S[event.type]))
        if event.value == "PRESS" and event.type == "LEFTMOUSE" and self._picture is not None:
            area, region = viewport
            box = box_of_picture(self._picture.size, comparison.visible_part(area, region))
            mouse = x - region.x, y - region.y
            person = person_at(mouse, box, self._picture.size, self._picture.time_s)
            if person is not None:
                context.scene.scope.person = person
                self.cancel(context)
                return {"FINISHED"}
        return {"RUNNING_MODAL"}

    def cancel(self, context: Context) -> None:
        """Remove the frame, and end the process that decodes one."""
        if self._process is not None:
            self._process.close()
            self._process = None
        bpy.types.SpaceView3D.draw_handler_remove(self._handler, "WINDOW")
        context.window_manager.event_timer_remove(self._timer)
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        redraw_viewport(self._area)
        redraw_sidebars()

    def _ask(self, context: Context, time_s: float) -> bool:
        """Start to decode the frame at a time; return whether that worked."""
        from ..job.footage_picture import PictureProcess
        from ..job.request import PictureRequest

        settings = context.scene.scope
        path = bpy.path.abspath(settings.footage)
        request = PictureRequest(
            path, time_s=time_s, rotate=settings.rotate, mirror=settings.mirror
        )
        try:
            self._process = PictureProcess(
                request, cache().new_job_folder(), python=python_command()
            )
        except (ScopeError, OSError) as error:
            self.report({"ERROR"}, sentence(error))
            return False
        return True

    def _listen(self) -> bool:
        """See whether the frame is there; return False if there is none to show."""
        if self._process is None:
            return True
        try:
            picture = self._process.answer()
        except (ScopeError, OSError) as error:
            self._process.close()
            self._process = None
            # After the end of the footage, the last frame stays.
            self.report({"ERROR" if self._picture is None else "WARNING"}, sentence(error))
            return self._picture is not None
        if picture is not None:
            self._process.close()
            self._process = None
            self._picture = picture
            self._time_s = picture.time_s
            self._texture = None
            redraw_viewport(self._area)
        return True


def _draw(tool: SCOPE_OT_pick_person) -> None:
    """Draw the frame over the viewport that the tool was started in."""
    import gpu
    from gpu_extras.batch import batch_for_shader
    from gpu_extras.presets import draw_texture_2d

    context = bpy.context
    if context.area is None or context.area.as_pointer() != tool._area:
        return
    region = context.region
    corners = [(0, 0), (region.width, 0), (region.width, region.height), (0, region.height)]
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    batch = batch_for_shader(shader, "TRIS", {"pos": corners}, indices=[(0, 1, 2), (0, 2, 3)])
    shader.uniform_float("color", _BACKGROUND)
    batch.draw(shader)
    picture = tool._picture
    if picture is None:
        _draw_text(region, iface_("Reading the footage"))
        return
    if tool._texture is None:
        tool._texture = _texture(picture)
    left, right, bottom, top = box_of_picture(
        picture.size, comparison.visible_part(context.area, region)
    )
    draw_texture_2d(tool._texture, (left, bottom), right - left, top - bottom)


def _texture(picture: FootagePicture) -> Any:
    import gpu
    import numpy as np

    values = np.frombuffer(picture.pixels, np.uint8).astype(np.float32) / 255.0
    buffer = gpu.types.Buffer("FLOAT", len(values), values)
    # Blender encodes what is drawn over a viewport as sRGB, so the shader has to read linear light.
    return gpu.types.GPUTexture(picture.shown_size, format="SRGB8_A8", data=buffer)


def _draw_text(region: Region, text: str) -> None:
    import blf

    blf.size(0, 14 * bpy.context.preferences.system.ui_scale)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    width, _ = blf.dimensions(0, text)
    blf.position(0, (region.width - width) / 2.0, region.height / 2.0, 0)
    blf.draw(0, text)


CLASSES = (SCOPE_OT_pick_person,)
