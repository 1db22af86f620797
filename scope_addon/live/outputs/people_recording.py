# SPDX-License-Identifier: GPL-3.0-or-later
"""The recordings of a live capture's people, a motion file each, that begin together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ....solver import Body
from ...capture.camera.intrinsics import Camera
from ..people import LivePeople
from ..pose import LivePose
from ..sources import Source
from .recording import Recording


class PeopleRecording:
    """Keeps every pose.

    :param paths: a file for each person.
    :param from_zero: whether frame numbers and times begin with 0, rather than with those of the
        source.
    """

    def __init__(
        self, paths: Sequence[Path], body: Body, source: Source, *, from_zero: bool = False
    ) -> None:
        self._recordings = [Recording(path, body, source) for path in paths]
        self._from_zero = from_zero
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
        for recording, session in zip(self._recordings, people.sessions, strict=True):
            recording.begin(session, size)

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Keep a pose in which the person is seen."""
        if not self._is_over:
            self._recordings[pose.person].send(pose, latency_ms)

    def save(self) -> list[Path]:
        """Write the motion files of those who were seen.

        :raises NoPersonError: nobody was seen.
        :raises OutputError: a file cannot be written.
        """
        seen = [recording for recording in self._recordings if recording.first is not None]
        origin = self.origin or min(
            (recording.first for recording in seen if recording.first), default=None
        )
        return [
            each.save(origin if self._from_zero else None) for each in seen or self._recordings[:1]
        ]

    @property
    def seconds(self) -> float:
        """Duration so far."""
        return max(recording.seconds for recording in self._recordings)

    @property
    def camera(self) -> Camera | None:
        """The camera as it is known now; None before somebody was seen."""
        return self._recordings[0].camera
