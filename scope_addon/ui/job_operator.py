# SPDX-License-Identifier: GPL-3.0-or-later
"""What captures of footage and live captures share in Blender's window: a job that a timer
advances, until it ends; and the preview of the current frame as an icon for the panel. It is not a
datablock, so no .blend file contains it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
import bpy.utils.previews
from bpy.types import Context, Event, Operator, Scene

from .reporting import sentence
from .viewports import is_over_tab, redraw_sidebars_twice

_previews: bpy.utils.previews.ImagePreviewCollection | None = None


class JobState:
    """The running job, and the error message of the last one. Never saved."""

    job: Any = None
    scene_uid = 0  # of the scene that the job or the message belongs to
    message = ""  # why the last job failed

    def message_in(self, scene: Scene) -> str:
        """Return the message if it belongs to a scene, and otherwise an empty text."""
        return self.message if self.scene_uid == scene.session_uid else ""

    def stop(self) -> None:
        """End the job in any state."""
        if self.job is not None:
            self.job.close()
        self.job = None


class JobOperator(Operator):
    """An operator that starts a job, and continues on a timer while Blender stays usable. Not
    registered.
    """

    timer_s: float  # between two steps
    job_state: JobState  # whose job's ``cancelled`` is set by the operator that cancels

    if TYPE_CHECKING:  # implemented by each operator

        def start(self, context: Context) -> bool:
            """Start the job; return whether that worked."""

        def step(self, context: Context) -> set[str] | None:
            """Advance the job, and show its state; return None while it runs, and then the
            operator's outcome.
            """

        def ask_to_cancel(self) -> None:
            """Call the operator that cancels."""

        def say_cancelled(self) -> None:
            """Report that the job was cancelled."""

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Start from the panel, and continue on a timer."""
        if bpy.app.background:
            return self.execute(context)
        if not self.start(context):
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(self.timer_s, window=context.window)
        manager.modal_handler_add(self)
        redraw_sidebars_twice()
        return {"RUNNING_MODAL"}

    def modal(self, context: Context, event: Event) -> set[str]:
        """Step on timer events, cancel on Escape over the panel, pass the others to Blender.

        Elsewhere, Escape belongs to what is under the mouse, such as the playback of the timeline.
        """
        job = self.job_state.job
        if job is None:  # stopped by something else
            return self.end(context, {"CANCELLED"})
        if event.type == "ESC" and event.value == "PRESS" and is_over_tab(context.window, event):
            self.ask_to_cancel()
            return {"RUNNING_MODAL"}
        if job.cancelled:
            self.say_cancelled()
            return self.end(context, {"CANCELLED"})
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            outcome = self.step(context)
        except Exception:  # Blender drops the operator without calling ``cancel``
            self.end(context, {"CANCELLED"})
            raise
        return self.end(context, outcome) if outcome else {"PASS_THROUGH"}

    def cancel(self, context: Context) -> None:
        """Stop when Blender opens another file or quits."""
        self.end(context, {"CANCELLED"})

    def fail(self, error: Exception | str) -> bool:
        """Stop, and say why; return False."""
        self.job_state.message = sentence(error)
        self.job_state.stop()  # before the report, which raises in a script
        redraw_sidebars_twice()
        self.report({"ERROR"}, self.job_state.message)
        return False

    def end(self, context: Context, outcome: set[str]) -> set[str]:
        """Stop the job and the timer, and return the outcome."""
        self.job_state.stop()
        if (timer := getattr(self, "_timer", None)) is not None:
            context.window_manager.event_timer_remove(timer)
            self._timer = None
        clear_status_bar()
        redraw_sidebars_twice()
        return outcome


def clear_status_bar() -> None:
    """Clear the status bar in every workspace, because each has its own text and the user may have
    switched.
    """
    for workspace in bpy.data.workspaces:
        with bpy.context.temp_override(workspace=workspace):  # Blender sets only the context's text
            workspace.status_text_set(None)


def show_preview(pixels: bytes, width: int, height: int) -> None:
    """Replace the picture; incomplete pictures are ignored.

    :param pixels: RGBA bytes, bottom row first.
    """
    import numpy as np  # imported here, so that Blender starts without it

    if len(pixels) != 4 * width * height or not pixels:
        return
    global _previews
    if _previews is None:
        _previews = bpy.utils.previews.new()
    icon = _previews.get("frame") or _previews.new("frame")
    icon.image_size = width, height
    icon.image_pixels.foreach_set(np.frombuffer(pixels, np.int32))


def preview_icon() -> int:
    """Return the icon for ``template_icon``; 0 if there is no picture."""
    return _previews["frame"].icon_id if _previews is not None and "frame" in _previews else 0


def clear_preview() -> None:
    """Remove the picture."""
    global _previews
    if _previews is not None:
        bpy.utils.previews.remove(_previews)
    _previews = None
