# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker's side of a live capture: poses as messages, and a recording from when the parent asks
for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....solver.errors import ScopeError
from ...capture_report import warnings_as_json
from ...live.outputs.footage import Footage
from ...live.outputs.people_recording import PeopleRecording
from ...live.outputs.pose_values import values
from ...live.run import Listeners, LiveOptions, LiveProgress, run_live
from ...live.sources import Picture, Source, open_source
from ...notices import OTHER, Notice, notice
from .commands import Commands
from .request import LiveRequest

if TYPE_CHECKING:
    from ....solver import Body
    from ...live.people import LivePeople
    from ...live.pose import LivePose

Send = Callable[..., None]  # an event and its values
MOTION = "person{}.npz"  # from 1 on


def capture_live(request: LiveRequest, job_folder: Path, send: Send, commands: Commands) -> None:
    """Capture until the source ends or the parent stops it; send poses, and at the end the
    recording, if there is one.

    :raises ScopeError: an option is invalid, the source cannot be read, or nobody was seen in the
        recording.
    """
    from ...live.clock import Clock
    from ...untrusted.body_file import load_body

    chosen = request.values
    source = open_source(request.source, online=request.online)
    body = load_body(chosen["body"])
    options = LiveOptions.of(chosen)
    clock = Clock()
    clock.stopped = commands.stopped
    with ExitStack() as stack:
        kept = chosen["keep_footage"]
        footage = stack.enter_context(Footage(Path(kept), source.fps)) if kept else None
        paths = [job_folder / MOTION.format(number + 1) for number in range(options.people)]
        recorder = _Recorder(paths, body, source, commands, footage)
        listeners = Listeners(
            lambda text: send("notice", text=text),
            lambda state: send("status", **_status(state, recorder)),
            recorder.begin,
            recorder.receive,
        )
        report = run_live(source, body, options, (recorder, _Sender(send)), listeners, clock)
        recording = recorder.recording
        if recording is None:
            send("ended")
            return
        saved = recording.save()
        warnings = save_footage(footage) if footage else []
    camera = recording.camera
    facts = {
        "camera": camera.source if camera else "",
        "fps": {"total": report["poses_per_second"]},
        **warnings_as_json(warnings),
    }
    send("result", motions=[path.name for path in saved], report=facts)


def save_footage(footage: Footage) -> list[Notice]:
    """Finish the video of a recording, which is not lost if that fails; return what went wrong."""
    try:
        footage.save()
    except ScopeError as error:
        return [notice(OTHER, text=str(error))]
    if footage.lost == 0:
        return []
    return [notice("lost_frame" if footage.lost == 1 else "lost_frames", lost=footage.lost)]


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
        footage: Footage | None = None,
    ) -> None:
        self._footage = footage
        self._paths = paths
        self._body = body
        self._source = source
        self._commands = commands
        self._people: tuple[LivePeople, tuple[int, int]] | None = None
        self.recording: PeopleRecording | None = None

    def begin(self, people: LivePeople, size: tuple[int, int]) -> None:
        """Note where the poses come from."""
        self._people = people, size
        if self.recording is not None:
            self.recording.begin(people, size)

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Keep a pose if one is asked for."""
        if self.recording is None and self._is_due(pose) and self._people is not None:
            # A file keeps its times, so that its pictures and the poses belong together.
            self.recording = PeopleRecording(
                self._paths, self._body, self._source, from_zero=not self._source.ends
            )
            self.recording.origin = self._footage.origin if self._footage is not None else None
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
        "dropped": state.dropped,
        "received": state.received,
        "recorded_s": round(recorder.recording.seconds, 1) if recorder.recording else 0.0,
    }
