# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of live captures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

from . import live_operators
from .capture_panel import Tab, draw_text
from .file_field import draw_file
from .live_properties import state
from .preferences import cache
from .reporting import iface_

if TYPE_CHECKING:
    from .live_job import LiveJob


class SCOPE_PT_live(Tab, bpy.types.Panel):
    """Source, buttons and state of live captures."""

    bl_idname = "SCOPE_PT_live"
    bl_label = "Live"
    bl_order = 1
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header_preset(self, context: bpy.types.Context) -> None:
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

    def draw(self, context: bpy.types.Context) -> None:
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
            live_operators.draw_formats(context, column)
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


def _draw_unfinished(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Say that a recording was not finished, and offer to."""
    if cache().unfinished_recordings():
        box = layout.box()
        draw_text(context, box, iface_("A recording was not finished"), "ERROR")
        box.operator("scope.finish_recording")


def _draw_rig(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.scope_live
    row = layout.row(align=True)
    row.prop(settings, "with_rig")
    if settings.with_rig:
        row.prop(context.scene.scope_retarget, "rig", text="")


def _draw_status(context: bpy.types.Context, layout: bpy.types.UILayout, job: LiveJob) -> None:
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


CLASSES = (SCOPE_PT_live,)
