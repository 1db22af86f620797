# SPDX-License-Identifier: GPL-3.0-or-later
"""The button that asks the chosen camera for its formats, and what the cameras have answered so
far.

A process of its own asks, since FFmpeg loads the camera's driver for it on Windows and macOS. A
timer waits for it.
"""

from __future__ import annotations

import sys

import bpy

from ...solver.errors import ScopeError
from ..errors import UsageError
from .capture.capture_panel import draw_text
from .live_properties import state
from .preferences import cache
from .reporting import iface_, sentence, tip_
from .sidebar import redraw_sidebars

_INTERVAL_S = 0.1


class SCOPE_OT_camera_formats(bpy.types.Operator):
    """Query the camera's formats, without taking an image. macOS may ask for permission"""

    bl_idname = "scope.camera_formats"
    bl_label = "Camera Formats"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require that no camera is being asked or used."""
        if state.job is not None or state.asking is not None:
            cls.poll_message_set(tip_("A camera is in use; wait for it or stop it"))
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Start to ask; the panel shows the answer."""
        # Imported here: it loads numpy, which would slow down the start of Blender.
        from ..job.live_cameras import FormatsProcess, camera_source

        typed = context.scene.scope_live.camera
        state.message = ""
        state.scene_uid = context.scene.session_uid
        python = [sys.executable, *getattr(bpy.app, "python_args", ("-I",))]
        try:
            if (source := camera_source(typed)) is None:
                raise UsageError(
                    f"'{typed.strip()}' is not a camera; enter its number, 0 for the first"
                )
            state.asking = FormatsProcess(source, cache().new_job_folder(), python)
        except (ScopeError, OSError) as error:
            state.message = sentence(error)
            self.report({"ERROR"}, state.message)
            return {"CANCELLED"}
        bpy.app.timers.register(step, first_interval=_INTERVAL_S, persistent=True)
        redraw_sidebars()
        return {"FINISHED"}


def step() -> float | None:
    """See whether the camera has answered; return in how many seconds to call again. A timer calls
    this.
    """
    asking = state.asking
    if asking is None:
        return None
    try:
        camera = asking.answer()
    except ScopeError as error:
        state.message = sentence(error)
    else:
        if camera is None:
            return _INTERVAL_S
        state.cameras[camera.number] = camera
    end()
    redraw_sidebars()
    return None


def end() -> None:
    """End the process, if there is one."""
    if state.asking is not None:
        state.asking.close()
    state.asking = None


def draw(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Show what the chosen camera has answered."""
    if state.asking is not None:
        draw_text(context, layout, iface_("Querying the camera"))
    elif state.cameras:
        from ..job.live_cameras import camera_number, camera_source

        source = camera_source(context.scene.scope_live.camera)
        camera = state.cameras.get(camera_number(source)) if source is not None else None
        if camera is not None:
            draw_text(context, layout, camera.label, "INFO")
            if not camera.formats:
                draw_text(context, layout, iface_("It reports no formats"))


CLASSES = (SCOPE_OT_camera_formats,)
