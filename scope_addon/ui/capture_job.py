# SPDX-License-Identifier: GPL-3.0-or-later
"""A capture, from the button to the finished scene and the result that the panel shows. ``step``
advances it and never waits for the worker.

The modal operator calls ``step`` on a timer; scripts and tests call it in a loop.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import uuid4

import bpy
import numpy as np
from bpy.types import PropertyGroup, Scene

from ..arrays import BoolArray, Float64Array
from ..capture_report import Report
from ..errors import UsageError, VideoError
from ..job.cache import Cache, CachedCapture
from ..job.job_progress import BUILDING, JobProgress, kind_of, load_stage_times, save_stage_times
from ..job.process import ROOT, START_SCRIPT, WorkerProcess
from ..job.request import JobRequest, code_version
from ..motion import Motion
from ..notices import Notice, notice
from ..options import Place
from ..options.body_choice import chosen_body
from ..options.capture import AUTO
from ..review_spans import Span, body_sigma_m, find_review_spans
from ..scene.build import BuildOptions, BuildResult, build_scene
from ..scene.datablocks import captures_of, check_local, found
from ..scene.match_rate import is_animated
from ..scene.packed_motion import pack_motion
from ..scene.stored_values import FrameSpan, in_scene
from ..scene.timing import current_frame_kept
from ..scene.visibility import Selection, window_shows
from ..untrusted.body_file import load_body
from . import warm_up
from .captures import hide_others, show_again
from .declared_properties import option_values
from .frame_rate_operators import rate_warnings
from .job_operator import show_preview
from .preferences import body_file, cache, preferences, python_command
from .reporting import add_warning
from .scene_camera import scene_camera_path

_ENDING_S = 5.0  # after which a worker that has sent its result is killed
AUTOMATIC = "AUTO"  # the setting of the frame rate that depends on what the scene contains
_MAX_SPANS = 12  # buttons of one warning in the panel


class CaptureJob:
    """A capture for one scene, with the current settings of the scene."""

    def __init__(self, scene: Scene) -> None:
        """Start the worker, or find the finished capture in the cache.

        :raises ScopeError: a setting is invalid, or the worker cannot be started.
        """
        self._cache: Cache = cache()
        self.cancelled = False
        self.messages = 0  # of the worker so far
        self._scene_uid = scene.session_uid
        self._selection = selection_in(scene)
        self._options = build_options(scene)
        self._is_automatic = scene.scope.frame_rate == AUTOMATIC
        self._request = capture_request(scene)
        self._kind = kind_of(self._request.values)
        self.progress = JobProgress(
            earlier=load_stage_times(self._cache.root, self._kind),
            may_compile=not warm_up.is_compiled(),
        )
        self._key = self._request.key(code_version(ROOT))
        self._captured: CachedCapture | None = self._cache.find(self._key)
        self.worker: WorkerProcess | None = None  # none if the result was cached
        self._result: dict[str, Any] | None = None  # of a worker that may still be ending
        self._result_s = 0.0
        self._building = False
        if self._captured is None:
            folder = self._cache.new_job_folder()
            self.worker = WorkerProcess(
                self._request, folder, self._cache.kernels, python_command(), START_SCRIPT
            )

    def step(self) -> bool:
        """Continue as far as possible without waiting; return False once the scene is built.

        :raises ScopeError: the capture failed; the scene is unchanged and no file is left on disk.
        """
        try:
            return self._step()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Stop in any state, without leaving a process or an unfinished file behind."""
        if self.worker is not None:
            self.worker.close()

    def _step(self) -> bool:
        if self._captured is None:
            self._listen()
            return True
        # built in the next step, so that the panel can show this stage first
        if not self._building:
            self._building = True
            self.progress.update(BUILDING, 0, 0)
            return True
        scene = found("scenes", "", self._scene_uid)
        if scene is None:
            raise UsageError("the scene was removed during the capture; capture in another scene")
        self._build(scene, self._captured)
        return False

    def _listen(self) -> None:
        assert self.worker is not None
        for message in self.worker.poll():
            self.messages += 1
            if message["event"] == "progress":
                self.progress.update(message["stage"], message["done"], message["total"])
            elif message["event"] == "preview":
                self._show_preview(message)
            elif message["event"] == "result":
                self._result = message
                self._result_s = time.monotonic()
        if self._result is None or (
            self.worker.alive and time.monotonic() - self._result_s < _ENDING_S
        ):
            return  # its files are moved once they are closed
        self.worker.wait(0.0)
        key = self._key if self._is_as_requested() else uuid4().hex  # which no request has
        self._captured = self._cache.keep(
            self.worker.job_folder, key, self._result["motions"], self._result["report"]
        )
        self.progress.update(BUILDING, 0, 0)
        save_stage_times(self._cache.root, self._kind, self.progress.seconds, self.progress.frames)
        limit = preferences()
        self._cache.prune((limit.cache_limit_gb if limit else 2) * 10**9)
        self.worker.close()

    def _is_as_requested(self) -> bool:
        """Return whether the footage and all files are as they were when the key was made: the
        worker has read them later.
        """
        with suppress(OSError):
            return self._request.key(code_version(ROOT)) == self._key
        return False

    def _show_preview(self, message: dict[str, Any]) -> None:
        assert self.worker is not None
        try:
            pixels = (self.worker.job_folder / Path(message["file"]).name).read_bytes()
        except OSError:
            return  # on Windows, while the worker replaces the file
        show_preview(pixels, message["width"], message["height"])

    def _build(self, scene: Scene, captured: CachedCapture) -> None:
        report = Report.from_json(captured.report)
        options = self._options
        if self._is_automatic:  # the user may have begun to animate during the capture
            options = replace(options, frame_rate=_automatic_frame_rate(scene))
        views = report.placed_videos(self._request.views)
        view_footage = [path if path.is_file() else None for path in views]
        with work_kept(scene, self._selection):
            build_capture(
                scene,
                [(path, path.read_bytes()) for path in captured.motions],
                self._request.values["body"],
                self._request.footage,
                report,
                replace(options, view_footage=view_footage),
            )


def selection_in(scene: Scene) -> Selection:
    """Return what is selected in the view layer that a scene is shown in."""
    is_shown = bpy.context.scene == scene
    return Selection(bpy.context.view_layer if is_shown else scene.view_layers[0])


@contextmanager
def work_kept(scene: Scene, before: Selection) -> Iterator[bool]:
    """If the user has begun to work on something else since ``before``, keep the selection, the
    active object, its mode and the current frame while a capture is built, and show other captures
    that something is selected of; give the block whether it is so.

    They have if what is selected is not what was selected before, or is being edited.
    """
    now = selection_in(scene)
    is_edited = now.mode not in ("OBJECT", "POSE")
    is_busy = is_edited or (now.selected and vars(now) != vars(before))
    if bpy.context.scene != scene or not is_busy:
        yield False
        return
    layer = bpy.context.view_layer
    with current_frame_kept(scene):
        yield True
    for capture in captures_of(scene):
        if any(obj.session_uid in now.selected for obj in capture.all_objects):
            show_again(capture)
    now.restore(layer)
    # The modes that edit data have undo steps of their own, which do not contain the capture.
    if is_edited and not bpy.app.background:
        bpy.ops.ed.undo_push(message="Capture")
    now.restore_mode()


def build_capture(
    scene: Scene,
    contents: Sequence[tuple[Path, bytes]],
    body: str,
    footage: str,
    report: Report,
    options: BuildOptions,
) -> BuildResult:
    """Build a capture in a scene, show its result, and store its motions.

    :param contents: path and bytes of each person's motion file.
    :param body: name or file of the body.
    :param footage: path of the video or picture; empty if there is none.
    :param report: of the capture.
    :raises ScopeError: the motions cannot be built; the scene is unchanged.
    """
    motions = [Motion.load(path, content) for path, content in contents]
    warnings = list(report.warnings)
    shows_footage = bool(footage) and Path(footage).is_file()
    if footage and not shows_footage:
        warnings.append(notice("missing_footage", footage=footage))
    with window_shows(scene):
        result = build_scene(motions, load_body(body), footage if shows_footage else None, options)
    for person, (_, content) in zip(result.people, contents, strict=True):
        pack_motion(person.armature, content)
    keeps_rate = options.frame_rate == "keep"
    show_build(scene, result, footage, replace(report, warnings=warnings), keeps_rate=keeps_rate)
    hide_others(scene, [result.collection])
    return result


def show_build(
    scene: Scene,
    result: BuildResult,
    footage: str,
    report: Report,
    *,
    keeps_rate: bool,
    what: str = "footage",
) -> Sequence[Notice]:
    """Show what was built in a scene, with what is to be known about it.

    :param footage: path of the video or picture; empty if there is none.
    :param report: of the capture.
    :param keeps_rate: whether the scene keeps its own frame rate.
    :param what: has the other rate: a key of ``notices.PHRASES``.
    :return: what is to be known.
    """
    motion = result.people[0].motion
    warnings = list(report.warnings)
    if keeps_rate and len(motion) > 1:
        warnings += rate_warnings(result.frame_rate, float(motion.mocap_framerate), what)
    report = replace(report, warnings=warnings + result.warnings)
    show_result(result.collection.scope_result, footage, report, result)
    scene.scope.capture = result.collection
    return report.warnings


def capture_request(scene: Scene) -> JobRequest:
    """Make the request to the worker from the scene's settings and the preferences.

    :raises UsageError: the scene is linked, no footage, calibration, camera or body file is chosen,
        the captured part is empty, a person is chosen of several cameras, or the camera cannot have
        filmed the footage.
    :raises VideoError: the footage does not exist.
    """
    settings = scene.scope
    check_local(scene)
    if not settings.footage:
        raise UsageError("no footage is chosen; choose a video or image first")
    footage, *views = [Path(bpy.path.abspath(each.footage)) for each in (settings, *settings.views)]
    for path in (footage, *views):
        if not path.is_file():
            what = "is not a file" if path.exists() else "does not exist"
            raise VideoError(f"{path} {what}; choose the video or image again")
    if settings.use_range and settings.range_end <= settings.range_start:
        raise UsageError("the part of the video ends before it starts; change From or To")
    if settings.person and views:
        raise UsageError(
            "Person is a place in one video, and there are several; clear it, or remove the other "
            "cameras' videos"
        )
    values = chosen_values(scene)
    values["body"] = chosen_body(values)
    if any(view.use_offset for view in settings.views):
        values["offset"] = ",".join(
            f"{view.offset_s:.6f}" if view.use_offset else AUTO for view in settings.views
        )
    if settings.lens == "CAMERA":
        values["camera_path"] = str(scene_camera_path(scene))
    return JobRequest(str(footage), [str(view) for view in views], **values)


def chosen_values(scene: Scene) -> dict[str, Any]:
    """Return the values of a worker's options from the scene's settings and the preferences.

    :raises UsageError: no body or calibration file is chosen.
    """
    settings = scene.scope
    if settings.lens == "FILE" and not settings.calibration_file:
        raise UsageError("no calibration file is chosen; choose one, or another kind of lens")
    chosen = preferences()
    values = option_values(settings, Place.PANEL) | option_values(chosen, Place.PREFERENCES)
    if values["body"] == "file":
        values["body"] = body_file(scene)
        if not values["body"]:
            raise UsageError(
                "no body file is chosen; choose one here or in the preferences, or "
                "use the built-in body"
            )
    return values


def build_options(scene: Scene) -> BuildOptions:
    """Make the options of building the scene from its settings."""
    settings = scene.scope
    frame_rate = settings.frame_rate.lower()
    if settings.frame_rate == AUTOMATIC:
        frame_rate = _automatic_frame_rate(scene)
    return BuildOptions(
        name=settings.take.strip(),
        frame_rate=frame_rate,
        set_frame_range=settings.set_frame_range,
        start_frame=float(settings.start_frame),
        shape=settings.shape.lower(),
        with_camera=settings.with_camera,
        with_markers=settings.with_markers,
    )


def _automatic_frame_rate(scene: Scene) -> str:
    """Return the policy of the rate, with which another animation keeps its speed."""
    return "keep" if is_animated(scene) else "set"


def show_result(shown: PropertyGroup, footage: str, report: Report, result: BuildResult) -> None:
    """Fill the properties that the result panel shows.

    :param shown: the properties, which are overwritten.
    """
    shown.footage = footage
    shown.people = len(result.people)
    shown.frames = max(len(p.motion) for p in result.people)
    motions = [person.motion for person in result.people]
    residuals = np.concatenate([motion.residual_px[motion.has_residual] for motion in motions])
    shown.reprojection_px = float(residuals.mean()) if residuals.size else 0.0
    sigma_m = body_sigma_m(motions)
    shown.sigma_cm = 100.0 * sigma_m if np.isfinite(sigma_m) else 0.0
    shown.heights = ", ".join(
        _height(person) for person in report.per_person if "height_m" in person
    )
    shown.frames_per_second = float(report.fps.get("total", 0.0))
    first = result.people[0].motion
    shown.footage_rate = first.mocap_framerate if len(first) > 1 else 0.0
    shown.camera = str(report.camera)
    shown.execution = str(report.execution)
    shown.resolution = [int(n) for n in first.image_size]
    shown.warnings.clear()
    for warning in report.warnings:
        # The frames of the first are among the spans; the panel itself says the second.
        if warning.code not in ("implausible", "scene_unit"):
            add_warning(shown, warning)
    for index, person in enumerate(result.people, 1):
        number = 0 if len(result.people) == 1 else index
        spans = review_spans(person.motion, person.frames, person.under_floor)
        for reason, of_reason in spans.items():
            add_warning(shown, notice("review", person=number, reason=reason), of_reason)


def review_spans(
    motion: Motion, frames: Float64Array, under_floor: BoolArray
) -> dict[str, list[FrameSpan]]:
    """Return the review spans of a motion in scene frames, by reason; at most the longest
    ``_MAX_SPANS`` of each.

    :param frames: (T,) scene frame of each pose.
    :param under_floor: (T,) poses with a foot under the floor.
    :return: reason, a key of ``REASONS``, to spans.
    """
    by_reason: dict[str, list[Span]] = {}
    for span in find_review_spans(motion, under_floor=under_floor):
        by_reason.setdefault(span.reason, []).append(span)
    found = {}
    for reason, spans in by_reason.items():
        longest = sorted(spans, key=lambda span: span.first - span.last)[:_MAX_SPANS]
        in_order = sorted(longest, key=lambda span: span.first)
        found[reason] = [in_scene(span, frames) for span in in_order]
    return found


def _height(person: Mapping[str, Any]) -> str:
    """Return a stature with its standard deviation, where that is known, from the report about a
    person.
    """
    sigma_m = person.get("height_sigma_m")
    if sigma_m is None:
        return f"{person['height_m']:.2f} m"
    return f"{person['height_m']:.2f} m ± {sigma_m:.{2 if sigma_m >= 0.01 else 3}f}"
