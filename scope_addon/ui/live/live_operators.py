# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that start, record, stop and cancel a live capture."""

from __future__ import annotations

import bpy

from .. import warm_up
from ..capture.capture_operators import clear_status_bar
from ..capture.capture_operators import state as capture_state
from ..reporting import sentence, tip_
from ..view.sidebar import is_over_tab, redraw_sidebars, redraw_sidebars_twice
from ..view.view_operators import frame_selected, hide_startup_cube
from ..view.viewports import viewports
from . import stream_logins
from .live_state import state, stop_job

TIMER_S = 1 / 60  # poses come at half of this rate


def end_live() -> None:
    """End a running live capture: the extension is being disabled, or a test begins."""
    stop_job()
    state.message = ""
    stream_logins.forget()


class SCOPE_OT_live(bpy.types.Operator):
    """Let a captured body follow the person in front of the camera, until it is stopped"""

    bl_idname = "scope.live"
    bl_label = "Start"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require that nothing is running."""
        if state.job is not None or capture_state.job is not None:
            cls.poll_message_set(tip_("A capture is running; wait for it or cancel it"))
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start from the panel, and continue on a timer."""
        if bpy.app.background or not self._start(context):
            return self.execute(context) if bpy.app.background else {"CANCELLED"}
        manager = context.window_manager
        self._shown: tuple[object, ...] = ()
        self._played = False
        self._timer = manager.event_timer_add(TIMER_S, window=context.window)
        manager.modal_handler_add(self)
        redraw_sidebars_twice()
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Step on timer events, cancel on Escape over the panel, pass the others to Blender."""
        job = state.job
        if job is None:  # stopped by something else
            return self._end(context, {"CANCELLED"})
        if event.type == "ESC" and event.value == "PRESS" and is_over_tab(context.window, event):
            bpy.ops.scope.cancel_live()
        if job.cancelled:
            self.report({"INFO"}, "Live capture cancelled; the scene is unchanged")
            return self._end(context, {"CANCELLED"})
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            outcome = self._step(context)
        except Exception:  # Blender drops the operator without calling ``cancel``
            self._end(context, {"CANCELLED"})
            raise
        return self._end(context, outcome) if outcome else {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop when Blender opens another file or quits."""
        self._end(context, {"CANCELLED"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Refuse to run without a window, whose timer applies the poses."""
        self.report({"ERROR"}, "Live capture needs Blender's window; in a shell, use ./scripts/live")
        return {"CANCELLED"}

    def _start(self, context: bpy.types.Context) -> bool:
        state.message, state.scene_uid = "", context.scene.session_uid
        # Imported here: it loads numba and numpy, which would slow down the start of Blender.
        try:
            from .live_job import LiveJob
        except ImportError as error:
            return self._fail(f"a part of Scope cannot be loaded ({error}); reinstall the extension")
        from ....solver.errors import ScopeError

        warm_up.stop()  # its processor time is the capture's; what it has compiled is kept
        try:
            state.job = LiveJob(context.scene)
        except (ScopeError, OSError) as error:
            return self._fail(error)
        return True

    def _step(self, context: bpy.types.Context) -> set[str] | None:
        """Advance the job; return None while it is running, and then the operator's outcome."""
        from ....solver.errors import ScopeError

        job = state.job
        assert job is not None
        before = job.poses
        try:
            running = job.step()
        except (ScopeError, OSError, MemoryError) as error:
            self._fail(error)
            return {"CANCELLED"}
        if not running:
            for warning in job.warnings:
                self.report({"WARNING"}, sentence(warning))
            self.report({"INFO"}, "Live capture recorded" if job.recording else "Live capture stopped")
            return {"FINISHED"}
        if job.created:
            hide_startup_cube(context)
            frame_selected(context)
        if job.poses != before:
            redraw_viewports()
        if job.recording and not job.finishing and not self._played:
            self._played = True
            play_scene(context)
        status = job.status
        seconds = (status.recorded_s, round(job.quiet_s), job.countdown_s)
        panel = (status.presence, round(status.rate), status.notice, seconds)
        if panel != self._shown:  # drawing the same again costs time in which Blender does not react
            self._shown = panel
            redraw_sidebars()
        return None

    def _fail(self, error: Exception | str) -> bool:
        state.message = sentence(error)
        stop_job()  # before the report, which raises in a script
        redraw_sidebars_twice()
        self.report({"ERROR"}, state.message)
        return False

    def _end(self, context: bpy.types.Context, outcome: set[str]) -> set[str]:
        stop_job()
        if getattr(self, "_played", False):
            stop_scene(context)
        if (timer := getattr(self, "_timer", None)) is not None:
            context.window_manager.event_timer_remove(timer)
            self._timer = None
        clear_status_bar()
        redraw_sidebars_twice()
        return outcome


class _RunningOperator(bpy.types.Operator):
    """An operator on the running live capture. Not registered."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require that one is running, and not being stopped."""
        return state.job is not None and not state.job.finishing


class SCOPE_OT_record_live(_RunningOperator):
    """Keep the motion from now on; Stop writes it as keyframes"""

    bl_idname = "scope.record_live"
    bl_label = "Record"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require that somebody was seen."""
        if not super().poll(context):
            return False
        assert state.job is not None
        if not state.job.has_body:
            cls.poll_message_set(tip_("Wait until somebody is seen"))
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Begin the recording."""
        assert state.job is not None
        if not state.job.recording and not state.job.countdown_s:
            state.job.record(context.scene.scope_live.countdown_s)
        redraw_sidebars()
        return {"FINISHED"}


class SCOPE_OT_stop_live(_RunningOperator):
    """Stop the live capture. What was recorded is written as keyframes; otherwise the last pose stays"""

    bl_idname = "scope.stop_live"
    bl_label = "Stop"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Ask the process to end; the modal operator does the rest."""
        assert state.job is not None
        state.job.stop()
        redraw_sidebars()
        return {"FINISHED"}


class SCOPE_OT_cancel_live(bpy.types.Operator):
    """Cancel the live capture; the scene stays unchanged, and nothing is recorded"""

    bl_idname = "scope.cancel_live"
    bl_label = "Cancel Live Capture"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Require that one is running."""
        return state.job is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """End the process and remove the body; the modal operator ends at its next event."""
        assert state.job is not None
        state.job.cancel()
        return {"FINISHED"}


def play_scene(context: bpy.types.Context) -> None:
    """Play the scene's animation from the frame at which a recording begins, if that is wanted."""
    scene = context.scene
    if scene.scope_live.with_scene and context.screen is not None and not context.screen.is_animation_playing:
        scene.frame_set(int(scene.scope.start_frame))
        bpy.ops.screen.animation_play()


def stop_scene(context: bpy.types.Context) -> None:
    """Stop the animation that `play_scene` began; one that the user plays meanwhile stops as well."""
    if context.scene.scope_live.with_scene and context.screen is not None and context.screen.is_animation_playing:
        bpy.ops.screen.animation_cancel(restore_frame=False)


def redraw_viewports() -> None:
    """Redraw the main region of every viewport."""
    for _, area in viewports():
        for region in area.regions:
            if region.type == "WINDOW":
                region.tag_redraw()


CLASSES = (SCOPE_OT_live, SCOPE_OT_record_live, SCOPE_OT_stop_live, SCOPE_OT_cancel_live)
