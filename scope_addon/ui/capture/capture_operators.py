# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that choose footage, capture it in the background and cancel, and the state of the running job."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import StringProperty

from ...footage import FOOTAGE_SUFFIXES
from ...job.progress import duration
from .. import warm_up
from ..live.live_state import state as live_state
from ..reporting import iface_, rpt_, sentence, tip_
from ..view.sidebar import is_over_tab, redraw_sidebars, redraw_sidebars_twice, show_tab
from ..view.view_operators import frame_selected, hide_startup_cube
from . import preview_picture

if TYPE_CHECKING:
    from .capture_job import CaptureJob

SAMPLE = Path(__file__).resolve().parents[3] / "assets" / "sample" / "sample.mp4"
TIMER_S = 0.1
ASK_AFTER_S = 10.0  # a capture that has run longer is cancelled only after a question


class _State:
    """The running capture, and the error message of the last one. Never saved."""

    job: CaptureJob | None = None
    scene_uid = 0  # of the scene that the job or the message belongs to
    message = ""  # why the last capture failed
    started = 0.0  # when the job was started, in seconds of the monotonic clock


state = _State()


def end_capture() -> None:
    """End a running capture: the extension is being disabled, or a test begins."""
    stop_job()
    clear_status_bar()
    state.message = ""


class SCOPE_OT_choose_footage(bpy.types.Operator):
    """Choose a video or image of a person"""

    bl_idname = "scope.choose_footage"
    bl_label = "Choose Video or Picture"
    bl_options = {"UNDO"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default=";".join(f"*{s}" for s in FOOTAGE_SUFFIXES), options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Use a dropped file, or ask for one."""
        if self.filepath:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the footage to the file."""
        path = Path(bpy.path.abspath(self.filepath))
        if not path.is_file():
            self.report({"ERROR"}, rpt_("{path} is not a file; choose a video or image", path=path))
            return {"CANCELLED"}
        context.scene.scope.footage = str(path)
        show_tab(context)
        return {"FINISHED"}


class SCOPE_OT_use_sample(bpy.types.Operator):
    """Use the short clip that is included with Scope"""

    bl_idname = "scope.use_sample"
    bl_label = "Try the Sample Clip"
    bl_options = {"UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the footage to the sample clip."""
        context.scene.scope.footage = str(SAMPLE)
        return {"FINISHED"}


class SCOPE_OT_capture(bpy.types.Operator):
    """Capture the person in the footage as an animated body, while Blender stays usable"""

    bl_idname = "scope.capture"
    bl_label = "Capture"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require that footage is chosen and nothing is running."""
        if state.job is not None or live_state.job is not None:
            cls.poll_message_set(tip_("A capture is running; wait for it or cancel it"))
            return False
        if not context.scene.scope.footage:
            cls.poll_message_set(tip_("Choose a video or image first"))
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start from the panel, and continue on a timer."""
        if bpy.app.background or not self._start(context):
            return self.execute(context) if bpy.app.background else {"CANCELLED"}
        manager = context.window_manager
        self._shown: tuple[str, int] | None = None
        self._timer = manager.event_timer_add(TIMER_S, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Step on timer events, cancel on Escape over the panel, pass the others to Blender.

        Elsewhere, Escape belongs to what is under the mouse, such as the playback of the timeline.
        """
        job = state.job
        if job is None:  # stopped by something else
            return self._end(context, {"CANCELLED"})
        if event.type == "ESC" and event.value == "PRESS" and is_over_tab(context.window, event):
            bpy.ops.scope.cancel("INVOKE_DEFAULT")
            return {"RUNNING_MODAL"}
        if job.cancel_requested:
            self.report({"INFO"}, "Capture cancelled; the scene is unchanged")
            return self._end(context, {"CANCELLED"})
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            outcome = self._step()
        except Exception:  # Blender drops the operator without calling ``cancel``
            self._end(context, {"CANCELLED"})
            raise
        progress = ", ".join(job.progress.lines(iface_))
        if self._shown != (progress, job.messages):  # drawing the same again costs time in which Blender does not react
            self._shown = progress, job.messages
            context.workspace.status_text_set(
                iface_("Scope: {progress}   (Esc over the Scope panel to cancel)", progress=progress)
            )
            redraw_sidebars()
        return self._end(context, outcome) if outcome else {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop when Blender opens another file or quits."""
        self._end(context, {"CANCELLED"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Capture from a script, and wait for the result."""
        if not self._start(context):
            return {"CANCELLED"}
        try:
            while not (outcome := self._step()):
                time.sleep(0.02)
            return outcome
        finally:
            stop_job()

    def _start(self, context: bpy.types.Context) -> bool:
        state.message, state.scene_uid, state.started = "", context.scene.session_uid, time.monotonic()
        # Imported here: it loads numba and numpy, which would slow down the start of Blender.
        try:
            from .capture_job import CaptureJob
        except ImportError as error:
            return self._fail(f"a part of Scope cannot be loaded ({error}); reinstall the extension")
        from ....solver.errors import ScopeError

        warm_up.detach()  # the capture compiles what is left; what it has compiled is kept
        try:
            state.job = CaptureJob(context.scene)
        except (ScopeError, OSError) as error:
            return self._fail(error)
        return True

    def _step(self) -> set[str] | None:
        """Advance the job; return None while it is running, and then the operator's outcome."""
        from ....solver.errors import ScopeError

        assert state.job is not None
        try:
            if state.job.step():
                return None
        except (ScopeError, OSError, MemoryError) as error:
            self._fail(error)
            return {"CANCELLED"}
        self.report({"INFO"}, "Capture finished")
        return {"FINISHED"}

    def _fail(self, error: Exception | str) -> bool:
        state.message = sentence(error)
        stop_job()  # before the report, which raises in a script
        redraw_sidebars_twice()
        self.report({"ERROR"}, state.message)
        return False

    def _end(self, context: bpy.types.Context, outcome: set[str]) -> set[str]:
        stop_job()
        if (timer := getattr(self, "_timer", None)) is not None:
            context.window_manager.event_timer_remove(timer)
            self._timer = None
        clear_status_bar()
        if "FINISHED" in outcome:
            hide_startup_cube(context)
            frame_selected(context)
        redraw_sidebars_twice()
        return outcome


class SCOPE_OT_cancel(bpy.types.Operator):
    """Cancel the capture; the scene stays unchanged"""

    bl_idname = "scope.cancel"
    bl_label = "Cancel Capture"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require that a capture is running."""
        return state.job is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask first if the capture has run for a while."""
        seconds = time.monotonic() - state.started
        if seconds <= ASK_AFTER_S or bpy.app.background:
            return self.execute(context)
        outcome: set[str] = context.window_manager.invoke_confirm(
            self,
            event,
            title="Stop the Capture?",
            message=iface_("It has run for {time}. The scene stays unchanged", time=duration(seconds)),
            confirm_text="Stop Capture",
        )
        return outcome

    def execute(self, context: bpy.types.Context) -> set[str]:
        """End the worker, and ask the modal operator to end."""
        assert state.job is not None
        state.job.cancel_requested = True
        state.job.close()
        return {"FINISHED"}


def stop_job() -> None:
    """End the job in any state."""
    if state.job is not None:
        state.job.close()
    state.job = None
    preview_picture.clear()


def clear_status_bar() -> None:
    """Clear the status bar in every workspace, because each has its own text and the user may have switched."""
    for workspace in bpy.data.workspaces:
        with bpy.context.temp_override(workspace=workspace):  # Blender sets only the context's text
            workspace.status_text_set(None)


CLASSES = (SCOPE_OT_choose_footage, SCOPE_OT_use_sample, SCOPE_OT_capture, SCOPE_OT_cancel)
