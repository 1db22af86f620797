# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker's side of a live capture: poses as messages, and a recording from when the parent asks
for it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...solver.errors import ScopeError
from ..capture_report import warnings_as_json
from ..errors import system_error_message
from ..live.footage_recording import FootageRecording
from ..live.open_source import open_source
from ..live.pose import values
from ..live.recording import Keep, PeopleRecording, unfinished_recording
from ..live.run import Listeners, LiveOptions, LiveProgress, run_live
from ..live.source import Picture, Source
from ..live.unfinished import SUFFIX, is_recording
from ..notices import OTHER, Notice, notice
from .cache import recordings_of
from .request import MOTION, Commands, LiveRequest

if TYPE_CHECKING:
    from ...solver import Body
    from ..live.people import LivePeople
    from ..live.pose import LivePose

Send = Callable[..., None]  # an event and its values


def capture_live(request: LiveRequest, job_folder: Path, send: Send, commands: Commands) -> None:
    """Capture until the source ends or the parent stops it; send poses, and at the end the
    recording, if there is one.

    :raises ScopeError: an option is invalid, the source cannot be read, or nobody was seen in the
        recording.
    """
    from ..live.source import Clock
    from ..untrusted.body_file import load_body

    chosen = request.values
    if is_recording(request.source):
        _finish_recording(Path(request.source), job_folder, send)
        return
    source = open_source(request.source, online=request.online)
    body = load_body(chosen["body"])
    options = LiveOptions.of(chosen)
    clock = Clock()
    clock.stopped = commands.stopped
    kept = chosen["keep_footage"]
    footage = FootageRecording(Path(kept), source.fps) if kept else None
    paths = motion_files(job_folder, options.people)
    keep = Keep(
        recordings_of(job_folder) / f"{job_folder.name}{SUFFIX}",
        str(chosen["body"]),
        lambda text: send("notice", text=text),
        lambda: str((footage and footage.unfinished) or ""),
    )
    recorder = _Recorder(paths, body, source, commands, footage, keep)

    def say(text: str) -> None:
        send("notice", text=text)
        recorder.note(text)

    listeners = Listeners(
        say,
        lambda state: send("status", **_status(state, recorder)),
        recorder.begin,
        recorder.receive,
    )
    warnings: list[Notice] = []
    poses_per_second = 0.0
    try:
        report = run_live(source, body, options, (recorder, _Sender(send)), listeners, clock)
        poses_per_second = report["poses_per_second"]
    except (ScopeError, OSError, MemoryError) as error:
        if recorder.recording is None:
            raise
        text = str(error) if isinstance(error, ScopeError) else system_error_message(error)
        warnings.append(notice(OTHER, text=f"{text}; the recording ends there"))
    finally:
        warnings = [*source.warnings, *recorder.notes.values(), *warnings]
        warnings += save_footage(footage) if footage else []
    if recorder.recording is None:
        send("ended")
        return
    _send_recording(recorder.recording, poses_per_second, warnings, send)


def _send_recording(
    recording: PeopleRecording, poses_per_second: float, warnings: list[Notice], send: Send
) -> None:
    """Write the motion files of a recording, and send its result. Its growing file stays until the
    parent has built the motions.

    :raises ScopeError: nobody was seen in it, or a file cannot be written.
    """
    saved = recording.save(keeps_journal=True)
    camera = recording.camera
    facts = {
        "camera": camera.source if camera else "",
        "fps": {"total": poses_per_second},
        **warnings_as_json(warnings),
    }
    send("result", motions=[path.name for path in saved], report=facts)


def _finish_recording(journal: Path, job_folder: Path, send: Send) -> None:
    """Send the result of a recording that was not finished; its file stays.

    :raises ScopeError: it cannot be read, or a file cannot be written.
    """
    recording, about = unfinished_recording(
        journal, lambda people: motion_files(job_folder, people)
    )
    warnings = []
    if about.footage and Path(about.footage).is_file():
        warnings.append(notice(OTHER, text=f"the images are in {about.footage}"))
    _send_recording(recording, 0.0, warnings, send)


def motion_files(job_folder: Path, people: int) -> list[Path]:
    """Return the motion files of some people."""
    return [job_folder / MOTION.format(number + 1) for number in range(people)]


def save_footage(footage: FootageRecording) -> list[Notice]:
    """Finish the video of a recording, which is not lost if that fails; return what went wrong."""
    try:
        footage.save()
    except ScopeError as error:
        return [notice(OTHER, text=str(error))]
    return [notice(OTHER, text=footage.missing)] if footage.missing else []


class _Sender:
    """Sends every pose; the parent uses the newest one of each person only."""

    def __init__(self, send: Send) -> None:
        self._send = send

    def send(self, pose: LivePose, latency_ms: float) -> None:
        self._send("pose", **values(pose, latency_ms))


class _Recorder:
    """Keeps poses from when the parent asks for it; ``recording`` is None before."""

    def __init__(
        self,
        paths: Sequence[Path],
        body: Body,
        source: Source,
        commands: Commands,
        footage: FootageRecording | None = None,
        keep: Keep | None = None,
    ) -> None:
        self._footage = footage
        self._keep = keep
        self._paths = paths
        self._body = body
        self._source = source
        self._commands = commands
        self._people: tuple[LivePeople, tuple[int, int]] | None = None
        self.recording: PeopleRecording | None = None
        # what was said during the recording, the first sentence of each kind
        self.notes: dict[str, Notice] = {}

    def begin(self, people: LivePeople, size: tuple[int, int]) -> None:
        """Note where the poses come from. The capture ends where its recording does."""
        self._people = people, size
        if self.recording is not None:
            self.recording.begin(people, size)
            if self.recording.is_over:
                self._commands.stopped.set()

    def note(self, text: str) -> None:
        """Keep a sentence that is said during the recording, unless the source keeps it."""
        if self.recording is None or text in map(str, self._source.warnings):
            return
        kind = re.sub("[0-9]+", "", text)
        said = f"{text} ({self.recording.seconds:.1f} s into the recording)"
        self.notes.setdefault(kind, notice(OTHER, text=said))

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Keep a pose if one is asked for."""
        if self.recording is None and self._is_due(pose) and self._people is not None:
            first = pose.index, pose.timestamp_s
            if self._footage is not None and self._footage.origin is not None:
                first = self._footage.origin
            # A file keeps its times, so that its pictures and the poses belong together.
            origin = None if self._source.ends else first
            self.recording = PeopleRecording(
                self._paths, self._body, self._source, origin=origin, keep=self._keep
            )
            self.recording.begin(*self._people)
        if self.recording is not None:
            self.recording.send(pose, latency_ms)

    def receive(self, picture: Picture) -> None:
        """Keep a picture if that is asked for."""
        if self._footage is not None and self._commands.recording.is_set():
            self._footage.add(picture)

    def _is_due(self, pose: LivePose) -> bool:
        """Whether the recording begins with a pose: none from before the first picture that is
        kept.
        """
        if self._footage is None:
            return self._commands.recording.is_set()
        return self._footage.origin is not None and pose.index >= self._footage.origin[0]


def _status(state: LiveProgress, recorder: _Recorder) -> dict[str, Any]:
    return {
        "presence": state.presence.value,
        "rate": round(state.rate, 1),
        "latency_ms": round(state.median_ms, 1),
        "recorded_s": round(recorder.recording.seconds, 1) if recorder.recording else 0.0,
    }
