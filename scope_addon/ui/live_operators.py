# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of live captures, operators that start, record, stop and cancel them, and the button
that asks the chosen camera for its formats.

A process of its own asks, since FFmpeg loads the camera's driver for it on Windows and macOS. A
timer waits for it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.types import Context, Operator, Panel, UILayout

from ...solver.errors import ScopeError
from ..errors import UsageError
from . import live_properties, warm_up
from .capture_operators import nothing_runs
from .capture_panel import Tab, draw_text
from .file_field import draw_file
from .job_operator import JobOperator
from .live_properties import state
from .preferences import cache, python_command
from .reporting import iface_, refuse, restore_libraries, sentence, warning_text
from .view_operators import frame_selected, hide_startup_cube
from .viewports import redraw_sidebars, viewports

if TYPE_CHECKING:
    from .live_job import LiveJob

_ANSWER_INTERVAL_S = 0.1


def end_live() -> None:
    """End a running live capture: the extension is being disabled, or a test begins"""
    state.stop()
    end_question()
    state.cameras.clear()
    state.message = ""
    live_properties.forget_logins()


class _LiveOperator(JobOperator):
    """An operator that runs a live job. Not registered"""

    bl_options = {"UNDO"}

    timer_s = 1 / 60  # poses come at half of this rate
    job_state = state
    _shown: tuple[object, ...] = ()  # what was drawn last
    _played = False  # whether the scene's animation was started

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that nothing is running."""
        return nothing_runs(cls)

    def execute(self, context: Context) -> set[str]:
        """Refuse to run without a window, whose timer applies the poses."""
        self.report(
            {"ERROR"}, "Live capture needs Blender's window; in a shell, use ./scripts/live"
        )
        return {"CANCELLED"}

    def start(self, context: Context) -> bool:
        """Start the job; return whether that worked."""
        state.message = ""
        state.scene_uid = context.scene.session_uid

        # Imported here: it loads numba and numpy, which would slow down the start of Blender.
        try:
            restore_libraries()
            from .live_job import LiveJob
        except (ScopeError, ImportError) as error:
            return self.fail(error)

        end_question()  # the camera is needed
        warm_up.stop()  # its processor time is the capture's; what it has compiled is kept
        try:
            state.job = LiveJob(context.scene, unfinished=self.unfinished_recording())
        except (ScopeError, OSError) as error:
            return self.fail(error)
        return True

    def unfinished_recording(self) -> Path | None:
        """Return the file of a recording that is to be finished; None: capture."""
        return None

    def step(self, context: Context) -> set[str] | None:
        """Advance the job; return None while it is running, and then the operator's outcome."""
        job = state.job
        assert job is not None
        before = job.poses
        try:
            running = job.step()
        except (ScopeError, OSError, MemoryError) as error:
            self.fail(error)
            return {"CANCELLED"}
        if not running:
            for warning in job.warnings:
                self.report({"WARNING"}, warning_text(warning))
            self.report(
                {"INFO"}, "Live capture recorded" if job.recording else "Live capture stopped"
            )
            return {"FINISHED"}
        if job.created:
            hide_startup_cube(context)
            if job.selects_body:
                frame_selected(context)
        if job.poses != before:
            redraw_viewports()
        if job.recording and not job.finishing and not self._played:
            self._played = True
            play_scene(context)
        status = job.status
        seconds = (status.recorded_s, round(job.quiet_s), job.countdown_s)
        panel = (status.presence, round(status.rate), status.notice, seconds)
        # drawing the same again costs time in which Blender does not react
        if panel != self._shown:
            self._shown = panel
            redraw_sidebars()
        return None

    def ask_to_cancel(self) -> None:
        """Cancel at once: nothing is lost that took long."""
        bpy.ops.scope.cancel_live()

    def say_cancelled(self) -> None:
        """Say that nothing has changed."""
        self.report({"INFO"}, "Live capture cancelled; the scene is unchanged")

    def end(self, context: Context, outcome: set[str]) -> set[str]:
        """Stop the job, the timer and the scene's animation, and return the outcome."""
        if self._played:
            stop_scene(context)
        return super().end(context, outcome)


class SCOPE_OT_live(_LiveOperator):
    """Make a captured body follow the person in front of the camera until the capture is stopped"""

    bl_idname = "scope.live"
    bl_label = "Start"


class SCOPE_OT_finish_recording(_LiveOperator):
    """Write the newest recording of a live capture that did not end by itself, as keyframes"""

    bl_idname = "scope.finish_recording"
    bl_label = "Finish Recording"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that nothing is running, and that there is a recording."""
        return super().poll(context) and bool(cache().unfinished_recordings())

    def unfinished_recording(self) -> Path | None:
        """Return the newest recording that was not finished."""
        return cache().unfinished_recordings()[0]


class _RunningOperator(Operator):
    """An operator on the running live capture. Not registered"""

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that one is running, and not being stopped."""
        return state.job is not None and not state.job.finishing


class SCOPE_OT_record_live(_RunningOperator):
    """Record the motion from now on; Stop writes it as keyframes"""

    bl_idname = "scope.record_live"
    bl_label = "Record"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that somebody was seen."""
        if not super().poll(context):
            return False
        assert state.job is not None
        if not state.job.has_body:
            return refuse(cls, "Wait until somebody is seen")
        return True

    def execute(self, context: Context) -> set[str]:
        """Begin the recording."""
        assert state.job is not None
        if not state.job.recording and not state.job.countdown_s:
            state.job.record(context.scene.scope_live.countdown_s)
        redraw_sidebars()
        return {"FINISHED"}


class SCOPE_OT_stop_live(_RunningOperator):
    """Stop the live capture"""

    bl_description = (
        "Stop the live capture. What was recorded is written as keyframes; otherwise the last pose "
        "stays"
    )
    bl_idname = "scope.stop_live"
    bl_label = "Stop"

    def execute(self, context: Context) -> set[str]:
        """Ask the process to end; the modal operator does the rest."""
        assert state.job is not None
        state.job.stop()
        redraw_sidebars()
        return {"FINISHED"}


class SCOPE_OT_cancel_live(Operator):
    """Cancel the live capture; the scene stays unchanged, and nothing is recorded"""

    bl_idname = "scope.cancel_live"
    bl_label = "Cancel Live Capture"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that one is running."""
        return state.job is not None

    def execute(self, context: Context) -> set[str]:
        """End the process and remove the body; the modal operator ends at its next event."""
        assert state.job is not None
        state.job.cancel()
        return {"FINISHED"}


def play_scene(context: Context) -> None:
    """Play the scene's animation from the frame at which a recording begins, if that is wanted"""
    scene = context.scene
    if scene.scope_live.with_scene and context.screen is not None:
        # Sound that is already playing would go on where it is.
        stop_scene(context)
        scene.frame_set(int(scene.scope.start_frame))
        bpy.ops.screen.animation_play()


def stop_scene(context: Context) -> None:
    """Stop the scene's animation where it is, whoever began it, if it was to play along"""
    if (
        context.scene.scope_live.with_scene
        and context.screen is not None
        and context.screen.is_animation_playing
    ):
        bpy.ops.screen.animation_cancel(restore_frame=False)


def redraw_viewports() -> None:
    """Redraw the main region of every viewport"""
    for _, area in viewports():
        for region in area.regions:
            if region.type == "WINDOW":
                region.tag_redraw()


class SCOPE_OT_camera_formats(Operator):
    """Query the camera's formats, without taking an image. macOS may ask for permission"""

    bl_idname = "scope.camera_formats"
    bl_label = "Camera Formats"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that no camera is being asked or used."""
        if state.job is not None or state.asking is not None:
            return refuse(cls, "A camera is in use; wait for it or stop it")
        return True

    def execute(self, context: Context) -> set[str]:
        """Start to ask; the panel shows the answer."""
        # Imported here: it loads numpy, which would slow down the start of Blender.
        from ..job.live_cameras import FormatsProcess, camera_source

        typed = context.scene.scope_live.camera
        state.message = ""
        state.scene_uid = context.scene.session_uid
        try:
            if (source := camera_source(typed)) is None:
                raise UsageError(
                    f"'{typed.strip()}' is not a camera; enter its number, 0 for the first"
                )
            state.asking = FormatsProcess(source, cache().new_job_folder(), python_command())
        except (ScopeError, OSError) as error:
            state.message = sentence(error)
            self.report({"ERROR"}, state.message)
            return {"CANCELLED"}
        bpy.app.timers.register(see_answer, first_interval=_ANSWER_INTERVAL_S, persistent=True)
        redraw_sidebars()
        return {"FINISHED"}


def see_answer() -> float | None:
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
            return _ANSWER_INTERVAL_S
        state.cameras[camera.number] = camera
    end_question()
    redraw_sidebars()
    return None


def end_question() -> None:
    """End the process, if there is one."""
    if state.asking is not None:
        state.asking.close()
    state.asking = None


def draw_formats(context: Context, layout: UILayout) -> None:
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


class SCOPE_PT_live(Tab, Panel):
    """Source, buttons and state of live captures."""

    bl_idname = "SCOPE_PT_live"
    bl_label = "Live"
    bl_order = 1
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context: Context) -> None:
        """Draw what is running, and the button that stops it, in the header, which is visible while
        the panel is closed.
        """
        layout = self.layout
        job = state.job
        if job is not None:
            text, icon = _status(job)
            if job.recording and icon != "ERROR":
                text, icon = _recorded(job), "REC"
            layout.label(text=text, translate=False, icon=icon)
            layout.operator("scope.stop_live", text="", icon="SNAP_FACE", emboss=False)
        elif state.message_in(context.scene):
            layout.label(text="", icon="ERROR")

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        layout = self.layout
        settings = context.scene.scope_live
        job = state.job
        column = layout.column()
        column.enabled = job is None
        column.row(align=True).prop(settings, "source", expand=True)
        if settings.source == "CAMERA":
            row = column.row(align=True)
            row.prop(settings, "camera", icon="CAMERA_DATA")
            row.operator("scope.camera_formats", text="", icon="FILE_REFRESH")
            draw_formats(context, column)
        elif settings.source == "STREAM":
            column.prop(settings, "stream", text="", icon="URL")
        else:
            draw_file(column, settings, "file", text="", icon="FILE_MOVIE")
        column.row(align=True).prop(settings, "quality", expand=True)
        column.prop(settings, "people")
        _draw_rig(column, context)
        column = layout.column()
        column.enabled = job is None or not (job.recording or job.countdown_s)
        column.prop(settings, "countdown_s")
        column.prop(settings, "with_scene")
        if settings.source != "FILE":
            row = layout.row()
            row.enabled = job is None
            row.prop(settings, "keep_footage")
        row = layout.row(align=True)
        row.scale_y = 1.6
        if job is None:
            row.operator("scope.live", icon="PLAY")
            _draw_unfinished(context, layout)
        else:
            text = "Recording" if job.recording else str(job.countdown_s or "Record")
            row.operator(
                "scope.record_live",
                text=text,
                icon="REC",
                depress=job.recording or bool(job.countdown_s),
            )
            row.operator("scope.stop_live", icon="SNAP_FACE")
            row.operator("scope.cancel_live", text="", icon="CANCEL")
            _draw_status(context, layout, job)
        if message := state.message_in(context.scene):
            draw_text(context, layout.box(), message, "ERROR")


def _draw_unfinished(context: Context, layout: UILayout) -> None:
    """Say that a recording was not finished, and offer to."""
    if cache().unfinished_recordings():
        box = layout.box()
        draw_text(context, box, iface_("A recording was not finished"), "ERROR")
        box.operator("scope.finish_recording")


def _draw_rig(layout: UILayout, context: Context) -> None:
    settings = context.scene.scope_live
    row = layout.row(align=True)
    row.prop(settings, "with_rig")
    if settings.with_rig:
        row.prop(context.scene.scope_retarget, "rig", text="")


def _draw_status(context: Context, layout: UILayout, job: LiveJob) -> None:
    text, icon = _status(job)
    draw_text(context, layout.box() if icon == "ERROR" else layout, text, icon)
    presence = job.status.presence
    if icon != "ERROR" and presence not in ("", "seen") and not job.finishing:
        is_alone = context.scene.scope_live.people == 1
        lost = "Nobody is seen" if is_alone else "The first person is not seen"
        seen = iface_(lost if presence == "lost" else "Not seen for a moment")
        draw_text(context, layout, seen, "INFO")
    if job.recording:
        draw_text(context, layout, _recorded(job), "REC")


def _status(job: LiveJob) -> tuple[str, str]:
    """Return what a running capture does, and its icon."""
    status = job.status
    if job.finishing:
        return iface_("Writing the recording"), "NONE"
    if status.notice:
        return status.notice, "ERROR"
    if not status.presence:
        return iface_("Waiting for the source"), "NONE"
    if job.quiet_s:
        return iface_("No image from the source for {seconds:.0f} s", seconds=job.quiet_s), "ERROR"
    return _speed(status.rate, status.latency_ms), "NONE"


def _recorded(job: LiveJob) -> str:
    return iface_("Recorded: {seconds:.1f} s", seconds=job.status.recorded_s)


def _speed(rate: float, latency_ms: float) -> str:
    return iface_(
        "{rate:.0f} pose/s, latency {latency:.0f} ms"
        if round(rate) == 1
        else "{rate:.0f} poses/s, latency {latency:.0f} ms",
        rate=rate,
        latency=latency_ms,
    )


CLASSES = (
    SCOPE_OT_live,
    SCOPE_OT_finish_recording,
    SCOPE_OT_record_live,
    SCOPE_OT_stop_live,
    SCOPE_OT_cancel_live,
    SCOPE_OT_camera_formats,
    SCOPE_PT_live,
)
