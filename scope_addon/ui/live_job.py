# SPDX-License-Identifier: GPL-3.0-or-later
"""A live capture, from the button to the last pose or the recorded keys. ``step`` never waits for
the worker.

The modal operator calls ``step`` on a timer; tests call it in a loop.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
from bpy.types import Object, Scene

from ...solver.body import Body
from ...solver.errors import ScopeError
from ..capture_report import Report
from ..errors import OfflineError, UsageError, VideoError
from ..footage import display_text
from ..job.live_cameras import camera_source
from ..job.live_process import LiveProcess, ShownPose
from ..job.process import START_SCRIPT
from ..job.request import MOTION, LiveRequest
from ..live.journal import read_about
from ..live.unfinished import remove_recording, unfinished_video
from ..notices import OTHER, Notice, notice
from ..options import Place, options_at
from ..options.body_choice import chosen_body
from ..scene.datablocks import check_local, is_in_layer, scene_of
from ..scene.live_body import LiveBody
from ..scene.live_rig import LiveRig
from ..scene.rig_retarget import usable_guess
from ..scene.visibility import SceneBefore, hide, select_only, window_shows
from ..temporary import remove
from ..untrusted.body_file import load_body
from .capture_job import (
    build_capture,
    build_options,
    chosen_values,
    selection_in,
    work_kept,
)
from .captures import hide_others, show_again
from .live_properties import with_login
from .preferences import cache, python_command
from .retarget_operators import listed_map, retarget_options, retarget_to_chosen_rig

NOTICE_S = 1.0  # for which poses that were under way when a notice came do not end it
QUIET_S = 2.0  # without a pose, after which the panel says so
_WRITING_S = 600.0  # for which the recording is waited for, which may have lasted for hours
_ENDING_S = 5.0  # after which a process that has sent its recording is killed


@dataclass
class LiveStatus:
    """What the panel shows."""

    # of the first person, as in `ShownPose`; empty before the first picture
    presence: str = ""
    rate: float = 0.0  # poses per second
    latency_ms: float = 0.0
    recorded_s: float = 0.0
    notice: str = ""  # why nothing comes from the source


class LiveJob:
    """A live capture for one scene, with the current settings of the scene."""

    def __init__(self, scene: Scene, unfinished: Path | None = None) -> None:
        """Start the process.

        :param unfinished: file of a recording that is to be finished; None: capture.
        :raises ScopeError: a setting is invalid, or the process cannot be started.
        """
        check_local(scene)
        self.status = LiveStatus()
        self.cancelled = False
        self._unfinished = unfinished
        self.recording = self.finishing = unfinished is not None
        self._record_at_s: float | None = None  # while a countdown runs
        self.warnings: list[Notice] = []  # of the retargeting of a recording
        self.poses = 0  # shown so far
        self._scene_uid = scene.session_uid
        self._request = live_request(scene) if unfinished is None else finishing_request(unfinished)
        self._is_stream = self._request.online
        # the video of a recording, if it is wanted
        self._kept = self._request.values["keep_footage"]
        is_file = unfinished is None and scene.scope_live.source == "FILE"
        self._footage = self._request.source if is_file else ""
        self._scene_body = load_body(self._request.values["body"])
        names = [
            f"Live {number + 1}" if number else "Live"
            for number in range(self._request.values["live_people"])
        ]
        self._bodies = [LiveBody(scene, name, self._scene_body) for name in names]
        self._before = SceneBefore()
        self._selection = selection_in(scene)  # as the user or the first live body has left it
        follows = scene.scope_live.with_rig and unfinished is None
        self._rig = live_rig(scene, self._scene_body) if follows else None
        self._result: dict[str, Any] | None = None  # the recording's message
        self._last_pose_s = self._notice_s = self._stopped_s = self._result_s = time.monotonic()
        # whether the last step, or one before, created the body; whether that selected it
        self.created = self._was_created = self.selects_body = False
        self._hidden: set[int] = set()  # session_uid of the captures in whose place the bodies are
        self._cache = cache()
        try:
            self.worker = LiveProcess(
                self._request,
                self._cache.new_job_folder(),
                self._cache.kernels,
                python_command(),
                START_SCRIPT,
            )
        except BaseException:
            if self._rig is not None:  # which is ready to follow
                self._rig.restore()
            raise

    @property
    def has_body(self) -> bool:
        """Whether somebody was seen so far."""
        return any(body.armature is not None for body in self._bodies)

    @property
    def quiet_s(self) -> float:
        """Seconds since the last pose; 0 while poses come."""
        seconds = time.monotonic() - self._last_pose_s
        return seconds if seconds > QUIET_S and self.status.presence else 0.0

    @property
    def countdown_s(self) -> int:
        """Whole seconds until the recording begins; 0 if none is about to begin."""
        return (
            0
            if self._record_at_s is None
            else max(math.ceil(self._record_at_s - time.monotonic()), 1)
        )

    def record(self, countdown_s: float = 0.0) -> None:
        """Keep the poses for ``stop``, from the end of a countdown on."""
        self._record_at_s = time.monotonic() + countdown_s
        self._record_if_due()

    def _record_if_due(self) -> None:
        if (
            self._record_at_s is not None
            and time.monotonic() >= self._record_at_s
            and not self.finishing
        ):
            self._record_at_s = None
            self.recording = True
            self.worker.record()

    def stop(self) -> None:
        """End the capture; ``step`` returns False when all is done. Without a recording, the last
        pose stays.
        """
        self.finishing = True
        self._stopped_s = time.monotonic()
        if self.recording:
            self.worker.stop()
        else:
            self.worker.close()

    def cancel(self) -> None:
        """End the process, and remove what was created and recorded."""
        self._end()
        self._remove_recording()
        if self._kept:
            remove(unfinished_video(Path(self._kept)))

    def _remove_recording(self) -> None:
        """Remove the growing file of the process, once that has ended."""
        for path in self._cache.recordings():
            if path.stem == self.worker.job_folder.name:
                remove_recording(path)

    def _end(self) -> None:
        """End the process, and remove what was created. What was recorded stays on the disk."""
        self.cancelled = True
        self.close()
        self._remove_bodies()
        self._show_captures()
        if self._rig is not None:
            self._rig.restore()
        self._before.restore()

    def close(self) -> None:
        """End the process in any state; the scene stays as it is, and a recording on the disk."""
        self.worker.close()

    def step(self) -> bool:
        """Continue as far as possible without waiting; return False at the end.

        :raises ScopeError: the capture failed; what it created is removed.
        """
        try:
            return self._step()
        except BaseException:
            self._end()
            raise

    def _step(self) -> bool:
        self.created = False
        scene = scene_of(self._scene_uid)
        if self.finishing and not self.recording:
            self._leave_pose(scene)
            return False
        if self._is_stream and not bpy.app.online_access and not self.finishing:
            if not self.recording:
                raise OfflineError
            self.stop()  # what was recorded is written
        self._record_if_due()
        self._listen()
        poses = (
            []
            if self.finishing
            else self.worker.newest_poses(self._scene_body.K + 1, self._scene_body.P)
        )
        if poses:
            self._show(scene, poses)
        if self._result is None:
            if self.finishing and time.monotonic() - self._stopped_s > _WRITING_S:
                raise UsageError("the recording was not written in time; record again")
            return True
        if self.worker.alive and time.monotonic() - self._result_s < _ENDING_S:
            return True  # its files are read once they are closed
        self._build(scene, self._result)
        return False

    def _listen(self) -> None:
        """Read the messages."""
        for message in self.worker.poll():
            if message["event"] == "status":
                for name in ("presence", "rate", "latency_ms", "recorded_s"):
                    setattr(self.status, name, message[name])
            elif message["event"] == "notice":
                self.status.notice = display_text(message["text"])
                self._notice_s = time.monotonic()
            elif message["event"] == "ended":  # the source has, and nothing was recorded
                self.recording = False
                self.stop()
            elif message["event"] == "result":
                self._result = message
                self._result_s = time.monotonic()

    def _show(self, scene: Scene, poses: Sequence[ShownPose]) -> None:
        """Show the newest pose of each person."""
        self.poses += 1
        self._last_pose_s = time.monotonic()
        for pose in poses:
            if pose.person == 0:
                self.status.presence = pose.presence
        if self.status.notice and self._last_pose_s - self._notice_s > NOTICE_S:
            self.status.notice = ""
        if bpy.context.scene != scene:  # in another one nobody sees it
            return
        for pose in poses:
            if pose.person < len(self._bodies):
                self._show_person(scene, pose)

    def _show_person(self, scene: Scene, pose: ShownPose) -> None:
        body = self._bodies[pose.person]
        is_new = body.armature is None
        with work_kept(scene, self._selection) if is_new else nullcontext(False) as is_busy:
            created = body.show(pose.rotations, pose.pelvis, pose.betas)
        if created and not self._was_created:
            self.created = self._was_created = True
            self.selects_body = not is_busy
            if self.selects_body:
                select_only(bpy.context.view_layer, body.armature)
                self._selection = selection_in(scene)
        if created:
            self._hidden |= {capture.session_uid for capture in hide_others(scene, [])}
        if self._rig is not None and pose.person == 0:
            if created and scene.scope_retarget.captured == "hide":
                hide(body.armature, bpy.context.view_layer)
            self._rig.show(pose.rotations, pose.pelvis, body.betas)

    def _show_captures(self) -> None:
        """Show the captures again that were hidden while the bodies were in their place."""
        for capture in bpy.data.collections:
            if capture.session_uid in self._hidden:
                show_again(capture)

    def _remove_bodies(self) -> None:
        for body in self._bodies:
            body.remove()

    def _leave_pose(self, scene: Scene) -> None:
        """Leave the last pose, on an armature at rest in the shape that was estimated last."""
        self._show_captures()
        with window_shows(scene):
            for body in self._bodies:
                body.rest_at_shape()
            armature = self._bodies[0].armature
            if (
                self._rig is not None
                and armature is not None
                and scene.scope_retarget.captured == "hide"
            ):
                hide(armature, bpy.context.view_layer)

    def _build(self, scene: Scene, result: dict[str, Any]) -> None:
        """Write the recording's keys, as a capture of footage does, and remove the body that
        followed.
        """
        self.worker.wait(0.0)
        paths = [self.worker.job_folder / Path(name).name for name in result["motions"]]
        contents = [(path, path.read_bytes()) for path in paths]
        body = self._request.values["body"]
        options = build_options(scene)
        if self._kept and Path(self._kept).is_file():
            # Capture then captures the take once more
            self._footage = scene.scope.footage = str(self._kept)
            # what is of other footage
            scene.scope.forget_places()
            scene.scope.views.clear()
            scene.scope.queue.clear()
        with work_kept(scene, self._selection):
            built = build_capture(
                scene, contents, body, self._footage, Report.from_json(result["report"]), options
            )
        self._remove_bodies()
        if self._rig is not None and self._rig.rig is not None:
            self._rig.restore()
            self.warnings = self._retargeted(scene, built.people[0].armature, paths[0].name)
        self.worker.close()
        self._remove_recording()
        if self._unfinished is not None:
            remove_recording(self._unfinished)

    def _retargeted(self, scene: Scene, armature: Object, name: str) -> list[Notice]:
        """Put the first person's recording on the rig that followed them; return what to say.

        :param armature: of the first person who was recorded;  name: of that person's file.
        """
        try:
            if name != MOTION.format(1):
                raise UsageError(
                    "the rig followed the first person, who is not in the recording; Retarget puts "
                    "another one on it"
                )
            with window_shows(scene):
                return retarget_to_chosen_rig(bpy.context, armature).warnings
        except ScopeError as error:  # the recording is there, and can be retargeted later
            return [notice(OTHER, text=str(error))]


def finishing_request(unfinished: Path) -> LiveRequest:
    """Make the request to finish a recording.

    :raises InputError: its file is none of a recording.
    """
    return LiveRequest(str(unfinished), body=read_about(unfinished).body)


def live_rig(scene: Scene, body: Body) -> LiveRig:
    """Prepare the rig of the Retarget section.

    :raises ScopeError: there is none, or it cannot be used.
    """
    settings = scene.scope_retarget
    if settings.rig is None or not is_in_layer(bpy.context.view_layer, settings.rig):
        raise UsageError(
            "no rig of this scene's view layer is chosen; choose one, or switch off Rig Follows"
        )
    if settings.rig.library is not None:
        raise UsageError(
            f"'{settings.rig.name}' is linked; make an override of it, or switch off Rig Follows"
        )
    bones = listed_map(settings) if len(settings.pairs) else usable_guess(settings.rig)
    return LiveRig(settings.rig, body, bones, retarget_options(settings))


def kept_footage(scene: Scene) -> Path:
    """Return a new name beside the .blend file for the pictures of a recording.

    :raises UsageError: the .blend file was never saved.
    """
    if not bpy.data.filepath:
        raise UsageError(
            "the footage is written beside the .blend file; save that first, or "
            "switch off Keep Footage"
        )
    folder = Path(bpy.data.filepath).parent
    stem = bpy.path.clean_name(scene.scope.take or "Live")
    return folder / f"{stem} {time.strftime('%Y-%m-%d %H.%M.%S')}.mp4"


def live_request(scene: Scene) -> LiveRequest:
    """Make the request to the worker from the scene's settings and the preferences.

    :raises UsageError: no source or body file is chosen, or the source is a stream, and Blender is
        not to go online.
    :raises VideoError: the video does not exist.
    """
    settings = scene.scope_live
    online = False
    if settings.source == "FILE":
        if not settings.file:
            raise UsageError("no video is chosen; choose one first")
        source = bpy.path.abspath(settings.file)
        if not Path(source).is_file():
            raise VideoError(f"{source} does not exist; choose the video again")
    elif settings.source == "STREAM":
        source = settings.stream.strip()
        if "://" not in source:
            raise UsageError(
                "no stream is given; enter its address, such as rtsp://192.168.1.20/stream"
            )
        if not bpy.app.online_access:
            raise OfflineError
        online = True
        source = with_login(source)
    else:
        source = camera_source(settings.camera) or ""
        if not source:
            raise UsageError(
                f"'{settings.camera.strip()}' is not a camera; enter its number, 0 for the first"
            )
    names = {option.name for option in options_at(Place.LIVE_WORKER)}
    values = {name: value for name, value in chosen_values(scene).items() if name in names}
    values["body"] = chosen_body(values)
    if settings.keep_footage and settings.source != "FILE":
        values["keep_footage"] = str(kept_footage(scene))
    return LiveRequest(
        source,
        online=online,
        **values,
        live_quality=settings.quality.lower(),
        live_people=settings.people,
    )
