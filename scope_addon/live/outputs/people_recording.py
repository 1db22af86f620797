# SPDX-License-Identifier: GPL-3.0-or-later
"""The recordings of a live capture's people, a motion file each, that begin together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from ....solver import Body
from ...capture.camera.intrinsics import Camera
from ...errors import NoPersonError, OutputError
from ...motion import Motion
from ...temporary import remove
from ...untrusted.body_file import load_body
from ..people import LivePeople
from ..pose import LivePose, Presence
from .journal import About, Journal, fingerprint, read_about, read_records, saved_elsewhere
from .recording import Recorded, Recording


@dataclass(frozen=True)
class Keep:
    """How a recording is kept on the disk while it runs.

    :param file: see `Journal`.
    :param body: see `About`.
    :param say: gets sentences, also from another thread.
    :param footage: gives the file in which the images are; empty: in none.
    """

    file: Path
    body: str
    say: Callable[[str], None] = lambda _: None
    footage: Callable[[], str] = lambda: ""


class PeopleRecording:
    """Keeps every pose.

    :param paths: a file for each person.
    :param from_zero: whether frame numbers and times begin with 0, rather than with those of the
        source.
    :param keep: None: in memory alone.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        body: Body,
        source: Recorded,
        *,
        from_zero: bool = False,
        keep: Keep | None = None,
    ) -> None:
        self._recordings = [Recording(path, body, source) for path in paths]
        self._body = body
        self._source = source
        self._from_zero = from_zero
        self._keep = keep
        self._journal: Journal | None = None
        self._size = (1, 1)
        # the frame number and time that become 0, if not the first ones
        self.origin: tuple[int, float] | None = None
        self._is_over = False

    def begin(self, people: LivePeople, size: tuple[int, int]) -> None:
        """Note where the poses come from; once there are some, those of pictures of another size
        are left out.
        """
        self._is_over = any(recording.first is not None for recording in self._recordings)
        if self._is_over:
            return
        self._size = size
        for recording, session in zip(self._recordings, people.sessions, strict=True):
            recording.begin(session, size)

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Keep a pose in which the person is seen."""
        if self._is_over:
            return
        recording = self._recordings[pose.person]
        recording.send(pose, latency_ms)
        if pose.presence is Presence.SEEN and self._keep is not None and recording.camera:
            self._journal = self._journal or self._new_journal(self._keep, pose)
            self._journal.add(pose, recording.camera)

    def _new_journal(self, keep: Keep, first: LivePose) -> Journal:
        origin = self.origin or (first.index, first.timestamp_s)
        about = About(
            keep.body,
            fingerprint(self._body),
            self._source.name,
            str(self._source.fps),
            self._size,
            origin if self._from_zero else None,
            len(self._recordings),
            keep.footage(),
        )
        return Journal(keep.file, about, self._body, keep.say)

    def save(self) -> list[Path]:
        """Write the motion files of those who were seen, each in another place if its own refuses.

        :raises NoPersonError: nobody was seen.
        :raises OutputError: a file is not in its own place; says where the recording is.
        """
        if self._journal is not None:
            self._journal.close()
        seen = [recording for recording in self._recordings if recording.first is not None]
        origin = self.origin or min(
            (recording.first for recording in seen if recording.first), default=None
        )
        motions = {
            each.path: each.result(origin if self._from_zero else None)
            for each in seen or self._recordings[:1]
        }
        elsewhere = self._saved(motions)
        if self._journal is not None:
            self._journal.remove()  # which may have been what has filled the disk
        moved = [_moved(motions[path], path, other) for path, other in elsewhere.items()]
        if problems := [problem for problem in moved if problem]:
            raise OutputError("; ".join(problems))
        return list(motions)

    def _saved(self, motions: dict[Path, Motion]) -> dict[Path, Path]:
        """Save motions, and return where those are that could not be saved where they should be.

        :raises OutputError: one cannot be saved anywhere.
        """
        elsewhere = {}
        for path, motion in motions.items():
            try:
                motion.save(path)
            except OutputError as error:
                try:
                    elsewhere[path] = saved_elsewhere(path, motion.save)
                except OutputError:
                    raise OutputError(f"{error}; {self.whereabouts}") from error
        return elsewhere

    @property
    def whereabouts(self) -> str:
        """Say where the recording is while it is not finished."""
        kept = None if self._journal is None else self._journal.path
        if kept is None:
            return "the recording is lost"
        return f"what was recorded is in {kept}: finish it with scope live {kept}"

    @property
    def seconds(self) -> float:
        """Duration so far."""
        return max(recording.seconds for recording in self._recordings)

    @property
    def camera(self) -> Camera | None:
        """The camera as it is known now; None before somebody was seen."""
        return self._recordings[0].camera


def _moved(motion: Motion, path: Path, other: Path) -> str:
    """Save a motion where it should be after all, and remove the other file; say why not."""
    try:
        motion.save(path)
    except OutputError as error:
        return f"{error}; the recording is in {other}"
    remove(other)
    return ""


@dataclass(frozen=True)
class _Source:
    """The source of a recording that was not finished."""

    name: str
    fps: Fraction


@dataclass(frozen=True)
class _LastCamera:
    """The camera as it was known last."""

    camera: Camera


def unfinished_recording(
    journal: Path, paths: Callable[[int], Sequence[Path]]
) -> tuple[PeopleRecording, About]:
    """Read a recording that was not finished, and return it to be saved.

    :param paths: gives a file for each of some people.
    :raises InputError: it cannot be read.
    :raises NoPersonError: there is no whole pose.
    :raises UsageError: its body has changed.
    """
    about = read_about(journal)
    body = load_body(about.body)
    records = read_records(journal, about, body)
    if not records:
        raise NoPersonError(f"{journal} ends before its first pose, so nothing can be finished")
    source = _Source(about.source, Fraction(about.fps))
    found = PeopleRecording(paths(about.people), body, source, from_zero=about.origin is not None)
    found.origin = about.origin
    for recording in found._recordings:
        recording.begin(_LastCamera(records[-1][1]), about.size)
    for pose, _ in records:
        found._recordings[pose.person].send(pose, 0.0)
    return found, about
