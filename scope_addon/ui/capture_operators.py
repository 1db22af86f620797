# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that choose footage, capture it in the background and cancel, and the state of the
running job. The menu File > Import chooses the footage and captures it in one step.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import bpy
from bpy.props import IntProperty
from bpy.types import Context, Event, Operator, Panel, Scene

from ...solver.errors import ScopeError
from ..errors import UsageError
from ..options.capture import MOST_VIEWS
from ..scene.datablocks import found
from ..scene.visibility import window_shows
from . import warm_up
from .captures import shown_capture, unit_text
from .declared_properties import split
from .export_operators import unused_path, write_at_own_rate, write_captures
from .file_field import FootageBrowser, SeveralFootageBrowser, chosen_files, stored_path
from .job_operator import JobOperator, JobState, clear_preview, clear_status_bar
from .live_properties import state as live_state
from .reporting import iface_, refuse, restore_libraries, rpt_, sentence
from .view_operators import hide_startup_cube, show_new_capture
from .viewports import redraw_sidebars, redraw_sidebars_twice, show_tab

if TYPE_CHECKING:
    from .capture_job import CaptureJob

SAMPLE = Path(__file__).resolve().parents[2] / "assets" / "sample" / "sample.mp4"
DRAWN_EVERY_S = 0.3  # between two drawings of a stage's progress; previews come as often
ASK_AFTER_S = 10.0  # a capture that has run longer is cancelled only after a question
# States of a clip of the queue.
WAITING = "WAITING"
CAPTURING = "CAPTURING"
DONE = "DONE"
FAILED = "FAILED"
NO_FILES = "NONE"  # of the formats in which the clips of the queue are written


class _State(JobState):
    """The running capture, and when it was started."""

    job: CaptureJob | None = None
    started = 0.0  # in seconds of the monotonic clock

    def stop(self) -> None:
        """End the job in any state, and remove its preview."""
        super().stop()
        clear_preview()


state = _State()


def nothing_runs(cls: type[Operator]) -> bool:
    """Return whether no capture is running, live or not; if one is, say so as the reason why the
    operator cannot be used.
    """
    if state.job is None and live_state.job is None:
        return True
    return refuse(cls, "A capture is running; wait for it or cancel it")


def end_capture() -> None:
    """End a running capture: the extension is being disabled, or a test begins."""
    state.stop()
    clear_status_bar()
    state.message = ""


def _set_footage(operator: Operator, context: Context, path: str) -> None:
    """Set the footage to a file. What is a place in the picture and videos of other cameras belong
    to the footage before: they are removed, of which the operator reports the latter.
    """
    settings = context.scene.scope
    before = bpy.path.abspath(settings.footage)
    settings.footage = stored_path(context, path)
    redraw_sidebars_twice()
    if bpy.path.abspath(settings.footage) == before:
        return
    settings.forget_places()
    if settings.views:
        settings.views.clear()
        text = rpt_("Removed the other cameras' videos, which belong to the previous footage")
        operator.report({"INFO"}, text)


class SCOPE_OT_choose_footage(SeveralFootageBrowser, Operator):
    """Choose a video or image of a person, or several that are captured one after the other"""

    bl_idname = "scope.choose_footage"
    bl_label = "Choose Footage"  # short: the button of the file browser shows it, too
    bl_options = {"UNDO"}

    def execute(self, context: Context) -> set[str]:
        """Set the footage to the file, and queue the files if there are several."""
        paths = chosen_files(self)
        if not paths:
            return {"CANCELLED"}
        settings = context.scene.scope
        _set_footage(self, context, paths[0])
        settings.queue.clear()
        if len(paths) > 1:
            settings.person = ""  # a place in one of them
            for path in paths:
                settings.queue.add().footage = stored_path(context, path)
        show_tab(context)
        return {"FINISHED"}


class SCOPE_OT_add_view(SeveralFootageBrowser, Operator):
    """Add a video of the same moment by another camera. All cameras must stand still"""

    bl_idname = "scope.add_view"
    bl_label = "Add View"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require footage, and that there may be another view."""
        settings = context.scene.scope
        if not settings.footage:
            return refuse(cls, "Choose a video or image first")
        if len(settings.views) >= MOST_VIEWS - 1:
            return refuse(cls, "There are at most eight cameras")
        return True

    def execute(self, context: Context) -> set[str]:
        """Add the chosen files."""
        settings = context.scene.scope
        paths = chosen_files(self)
        if not paths:
            return {"CANCELLED"}
        if len(settings.views) + len(paths) > MOST_VIEWS - 1:
            self.report({"ERROR"}, rpt_("There are at most eight cameras"))
            return {"CANCELLED"}
        for path in paths:
            settings.views.add().footage = stored_path(context, path)
        show_tab(context)
        return {"FINISHED"}


class _RemoveFromList:
    """An operator that removes an entry of one of the footage's lists. Not registered."""

    bl_options = {"UNDO"}
    listed: ClassVar[str]  # the list, of the settings

    index: IntProperty(min=0, options={"SKIP_SAVE", "HIDDEN"})

    def execute(self, context: Context) -> set[str]:
        """Remove the entry."""
        entries = getattr(context.scene.scope, self.listed)
        if self.index >= len(entries):
            return {"CANCELLED"}
        entries.remove(self.index)
        return {"FINISHED"}


class SCOPE_OT_remove_view(_RemoveFromList, Operator):
    """Remove this video from the list; the file stays"""

    bl_idname = "scope.remove_view"
    bl_label = "Remove View"
    listed = "views"


class SCOPE_OT_use_sample(Operator):
    """Use the short clip that is included with Scope"""

    bl_idname = "scope.use_sample"
    bl_label = "Try the Sample Clip"
    bl_options = {"UNDO"}

    def execute(self, context: Context) -> set[str]:
        """Set the footage to the sample clip."""
        _set_footage(self, context, str(SAMPLE))
        return {"FINISHED"}


class CapturingOperator(JobOperator):
    """An operator that captures footage. Not registered."""

    timer_s = 0.1
    job_state = state
    _shown = ("", "", 0)  # the stage, progress and messages that were drawn last
    _drawn_s = 0.0  # when that was
    _pause_s = 0.0  # after it, until the next drawing

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that footage is chosen and nothing is running."""
        if not nothing_runs(cls):
            return False
        if not context.scene.scope.footage:
            return refuse(cls, "Choose a video or image first")
        return True

    def execute(self, context: Context) -> set[str]:
        """Capture from a script, and wait for the result."""
        if not self.start(context):
            return {"CANCELLED"}
        try:
            while not (outcome := self._advance()):
                time.sleep(0.02)
            return outcome
        finally:
            state.stop()

    def start(self, context: Context) -> bool:
        """Start the job; return whether that worked."""
        return self.begin(context.scene)

    def begin(self, scene: Scene) -> bool:
        """Start the job for a scene with its settings; return whether that worked."""
        state.message = ""
        state.scene_uid = scene.session_uid
        state.started = time.monotonic()

        # Imported here: it loads numba and numpy, which would slow down the start of Blender.
        try:
            restore_libraries()
            from .capture_job import CaptureJob
        except (ScopeError, ImportError) as error:
            return self.fail(error)

        warm_up.detach()  # the capture compiles what is left; what it has compiled is kept
        try:
            state.job = CaptureJob(scene)
        except (ScopeError, OSError) as error:
            return self.fail(error)
        return True

    def step(self, context: Context) -> set[str] | None:
        """Advance the job, and show its progress; return None while it is running, and then the
        outcome.
        """
        job = state.job
        assert job is not None
        outcome = self._advance()
        progress = ", ".join(job.progress.lines(iface_))
        shown = (job.progress.stage, progress, job.messages)
        now_s = time.monotonic()
        if not self._pause_s:  # the first step after a drawing: its delay is the drawing's
            delay_s = now_s - self._drawn_s
            self._pause_s = 5.0 * delay_s if delay_s > 1.5 * self.timer_s else DRAWN_EVERY_S
        is_due = shown[0] != self._shown[0] or now_s - self._drawn_s >= self._pause_s
        # Drawing costs time in which Blender does not react: without a graphics card 0.1 s, and
        # more on a busy machine.
        if shown != self._shown and is_due:
            self._shown = shown
            self._drawn_s = now_s
            self._pause_s = 0.0
            context.workspace.status_text_set(
                iface_(
                    "Scope: {progress}   (Esc over the Scope panel to cancel)", progress=progress
                )
            )
            redraw_sidebars()
        return outcome

    def _advance(self) -> set[str] | None:
        """Advance the job; return None while it is running, and then the operator's outcome."""
        assert state.job is not None
        try:
            if state.job.step():
                return None
        except (ScopeError, OSError, MemoryError) as error:
            self.fail(error)
            return {"CANCELLED"}
        self.report({"INFO"}, "Capture finished")
        self._report_unit()
        return {"FINISHED"}

    def _report_unit(self) -> None:
        """Warn at once of a scene in whose unit the person is not life-size."""
        scene = _scene_of_job()
        if scene is not None and (text := unit_text(scene)):
            self.report({"WARNING"}, text)

    def ask_to_cancel(self) -> None:
        """Ask, if the capture has run for long, and cancel it."""
        bpy.ops.scope.cancel("INVOKE_DEFAULT")

    def say_cancelled(self) -> None:
        """Say that nothing has changed."""
        self.report({"INFO"}, "Capture cancelled; the scene is unchanged")

    def end(self, context: Context, outcome: set[str]) -> set[str]:
        """Stop the job and the timer, show what was built, and return the outcome."""
        if "FINISHED" in outcome:
            show_new_capture(context, _scene_of_job())
        return super().end(context, outcome)


class SCOPE_OT_capture(CapturingOperator):
    """Capture the person in the footage as an animated body, while Blender stays usable"""

    bl_idname = "scope.capture"
    bl_label = "Capture"
    bl_options = {"UNDO"}


class SCOPE_OT_capture_queue(CapturingOperator):
    """Capture all clips of the list that wait, one after the other, with the same options"""

    bl_idname = "scope.capture_queue"
    bl_label = "Capture All"

    _finished = 0  # clips so far
    _clip = ""  # footage of the clip that is being captured
    # State and message of the clips that have ended, by their footage: what the user undoes
    # meanwhile takes the list back to an earlier state, too.
    _ended: dict[str, tuple[str, str]]

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a clip that waits, of one camera, and that nothing is running."""
        if not super().poll(context):
            return False
        settings = context.scene.scope
        if settings.views:
            return refuse(cls, "Remove the other cameras' videos first")
        if all(clip.status == DONE for clip in settings.queue):
            return refuse(cls, "All clips of the list have been captured; choose others")
        if settings.queue_format != NO_FILES and not os.path.isdir(_folder_of_files(settings)):
            return refuse(cls, "Choose a folder for the files")
        return True

    def start(self, context: Context) -> bool:
        """Start the first clip; those that failed before are tried again."""
        self._ended = {}
        for clip in context.scene.scope.queue:
            if clip.status == FAILED:
                clip.status = WAITING
        return super().start(context)

    def begin(self, scene: Scene) -> bool:
        """Start the first clip that waits and can be started; return whether there is one."""
        for clip in scene.scope.queue:
            if clip.footage in self._ended:
                clip.status, clip.message = self._ended[clip.footage]
            # a file that was saved while a clip was being captured holds it as such
            elif clip.status in (WAITING, CAPTURING):
                clip.status = CAPTURING
                clip.message = ""
                self._clip = scene.scope.footage = clip.footage
                if super().begin(scene):
                    return True
        return False

    def fail(self, error: Exception | str) -> bool:
        """Note why the clip cannot be captured, and go on; return False."""
        self._end_clip(FAILED, sentence(error))
        state.stop()
        self.report({"WARNING"}, sentence(error))
        return False

    def _end_clip(self, status: str, message: str) -> None:
        """Note what has become of the clip that was being captured."""
        self._ended[self._clip] = status, message
        if (clip := self._listed_clip()) is not None:
            clip.status = status
            clip.message = message

    def _listed_clip(self) -> Any | None:
        """Return the list's entry of the clip that is being captured; None if it was removed."""
        scene = _scene_of_job()
        clips = [] if scene is None else scene.scope.queue
        return next((clip for clip in clips if clip.footage == self._clip), None)

    def _advance(self) -> set[str] | None:
        """Advance the clip's job, and begin the next clip when it has ended."""
        outcome = super()._advance()
        if outcome is None:
            return None
        redraw_sidebars_twice()  # the list shows what has become of the clip
        scene = _scene_of_job()
        if "FINISHED" in outcome:
            self._finished += 1
            self._end_clip(DONE, self._write_files(scene) if scene is not None else "")
            state.stop()
            if scene == bpy.context.scene:
                hide_startup_cube(bpy.context)  # as a part of what can be undone
            if not bpy.app.background:  # so that each capture can be undone alone
                bpy.ops.ed.undo_push(message="Capture")
        if scene is not None and self.begin(scene):
            return None
        return {"FINISHED"} if self._finished else {"CANCELLED"}

    def _write_files(self, scene: Scene) -> str:
        """Write the files of the clip that was captured last, if there shall be any; return why
        that failed, or an empty text.
        """
        from .capture_job import AUTOMATIC, build_options
        from .frame_rate_operators import differs

        settings = scene.scope
        kind = settings.queue_format
        capture = shown_capture(scene)
        if kind == NO_FILES or capture is None:
            return ""
        try:
            folder = _folder_of_files(settings)
            if not os.path.isdir(folder):
                raise UsageError(
                    f"no file was written, because there is no folder '{folder}' any more; choose "
                    "another one, and export the capture"
                )
            with window_shows(scene), unused_path(Path(folder), capture, kind) as path:
                if settings.frame_rate == AUTOMATIC and differs(scene):
                    write_at_own_rate(path, kind, capture, build_options(scene))
                else:
                    write_captures(path, kind, [capture])
        except (ScopeError, OSError) as error:
            self.report({"WARNING"}, sentence(error))
            return sentence(error)
        return ""

    def say_cancelled(self) -> None:
        """Say what the scene keeps."""
        if not self._finished:
            super().say_cancelled()
            return
        self.report({"INFO"}, "Capture cancelled; the clips captured before stay in the scene")

    def end(self, context: Context, outcome: set[str]) -> set[str]:
        """Let a cancelled clip wait again, and end as a single capture does."""
        clip = self._listed_clip()
        if clip is not None and self._clip not in self._ended:
            clip.status = WAITING
        return super().end(context, outcome)


class SCOPE_OT_remove_clip(_RemoveFromList, Operator):
    """Remove this clip from the list; the file and its capture stay"""

    bl_idname = "scope.remove_clip"
    bl_label = "Remove Clip"
    listed = "queue"


def _folder_of_files(settings: Any) -> str:
    """Return the folder for the files of the list's clips; empty if none is chosen."""
    if settings.queue_folder.startswith("//") and not bpy.data.filepath:
        return ""  # relative to a .blend file that was never saved
    return bpy.path.abspath(settings.queue_folder)


def _scene_of_job() -> Scene | None:
    """Return the scene that the running job belongs to; None if it was removed."""
    return found("scenes", "", state.scene_uid)


class SCOPE_OT_cancel(Operator):
    """Cancel the capture; the scene stays unchanged"""

    bl_idname = "scope.cancel"
    bl_label = "Cancel Capture"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that a capture is running."""
        return state.job is not None

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask first if the capture has run for a while."""
        if time.monotonic() - state.started <= ASK_AFTER_S or bpy.app.background:
            return self.execute(context)
        ask_to_stop()
        return {"INTERFACE"}

    def execute(self, context: Context) -> set[str]:
        """End the worker, and ask the modal operator to end."""
        assert state.job is not None
        state.job.cancelled = True
        state.job.close()
        return {"FINISHED"}


class SCOPE_OT_keep_capturing(Operator):
    """Continue the capture"""

    bl_idname = "scope.keep_capturing"
    bl_label = "Keep Capturing"
    bl_options = {"INTERNAL"}

    def execute(self, context: Context) -> set[str]:
        """Do nothing: the question closes."""
        return {"FINISHED"}


class SCOPE_PT_stop_capture(Panel):
    """The question before a capture that has run for a while is stopped. Escape closes it, and the
    capture goes on.
    """

    bl_idname = "SCOPE_PT_stop_capture"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"  # for a popover: in no sidebar
    bl_label = "Stop the Capture?"
    bl_ui_units_x = 16

    def draw(self, context: Context) -> None:
        """Draw both answers; Return gives the one that was asked for."""
        from ..job.job_progress import duration

        column = self.layout.column()
        column.operator_context = "EXEC_DEFAULT"  # or it would ask again
        column.label(text="Stop the Capture?", icon="QUESTION")
        seconds = time.monotonic() - state.started
        text = iface_("It has run for {time}. The scene stays unchanged", time=duration(seconds))
        column.label(text=text, translate=False, icon="BLANK1")
        row = column.row()
        row.scale_y = 1.3
        row.operator("scope.keep_capturing", icon="PLAY")
        cell = row.row()
        cell.active_default = True
        cell.operator("scope.cancel", text="Stop Capture", icon="CANCEL")


def ask_to_stop() -> None:
    """Open the question. In Blender's own, its Cancel beside our answer would leave open what is
    cancelled.
    """
    bpy.ops.wm.call_panel(name=SCOPE_PT_stop_capture.bl_idname, keep_open=False)


class SCOPE_OT_import_video(FootageBrowser, Operator):
    """Motion capture: animate a body with the motion of the person in a video or image"""

    bl_idname = "scope.import_video"
    bl_label = "Motion from Video"  # short: the button of the file browser shows it, too
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require that no capture is running."""
        return nothing_runs(cls)

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for the file."""
        return self.ask(context)

    def draw(self, context: Context) -> None:
        """Draw the settings of the capture in the sidebar of the file browser."""
        layout = split(self.layout)
        settings = context.scene.scope
        for name in ("quality", "people", "people_count", "hands", "face", "height_cm", "take"):
            if name != "people_count" or settings.people == "COUNT":
                layout.prop(settings, name)

    def execute(self, context: Context) -> set[str]:
        """Set the footage to the file, and start the capture."""
        path = Path(bpy.path.abspath(self.filepath))
        if not os.path.isfile(path):  # Path.is_file raises where a name is too long
            self.report({"ERROR"}, rpt_("{path} is not a file; choose a video or image", path=path))
            return {"CANCELLED"}
        _set_footage(self, context, str(path))
        show_tab(context)
        try:
            bpy.ops.scope.capture("INVOKE_DEFAULT")
        except RuntimeError as error:  # it has said why nothing can be captured here
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        return {"FINISHED"}


CLASSES = (
    SCOPE_OT_choose_footage,
    SCOPE_OT_add_view,
    SCOPE_OT_remove_view,
    SCOPE_OT_use_sample,
    SCOPE_OT_capture,
    SCOPE_OT_capture_queue,
    SCOPE_OT_remove_clip,
    SCOPE_OT_cancel,
    SCOPE_OT_keep_capturing,
    SCOPE_PT_stop_capture,
    SCOPE_OT_import_video,
)
