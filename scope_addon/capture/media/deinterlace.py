# SPDX-License-Identifier: GPL-3.0-or-later
"""Deinterlacing: a frame of two fields, filmed one after the other, becomes an image of one moment.

FFmpeg's bwdif keeps the lines of the first field, and interpolates the others from their neighbours
and, where nothing moves, from the frames before and after. One frame goes in and one comes out, at
the same time. Frames that are not marked as interlaced are left alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import av


# Whose decoders give each field as a frame of its own, half as high, and mark it as interlaced.
FIELD_CODECS = ("hevc", "vvc")


def deinterlaced(
    frames: Iterable[av.VideoFrame], before: av.VideoFrame | None = None
) -> Iterator[av.VideoFrame]:
    """Iterate over frames, those marked as interlaced deinterlaced; no frame is added, left out or
    moved in time.

    :param frames: in order of presentation.
    :param before: the frame before the first of them, which is not returned; None if there is none.
    """
    bwdif: _Bwdif | None = None
    for frame in frames:
        if bwdif is not None and not bwdif.fits(frame):
            yield from bwdif.finish()
            bwdif = before = None
        if bwdif is None:
            if not frame.interlaced_frame:
                before = frame
                yield frame
                continue
            bwdif = _Bwdif(frame, before)
        yield from bwdif.add(frame)
    if bwdif is not None:
        yield from bwdif.finish()


class _Bwdif:
    """The filter, for frames of one size and format; it gives each when it has the next one.

    Where it fails, as for images of less than four lines, frames are returned as they are.
    """

    def __init__(self, first: av.VideoFrame, before: av.VideoFrame | None) -> None:
        from av import FFmpegError
        from av.filter import Graph

        self._failures = (FFmpegError, OSError, ValueError)
        self._kind = _kind(first)
        # Frames that the filter was given and has not returned yet.
        self._waiting: deque[av.VideoFrame] = deque()
        self._not_shown = 0  # frames that come first and are not part of the result
        self._graph: Graph | None = Graph()
        try:
            width, height, _ = self._kind
            base = first.time_base or Fraction(1, 1000)
            source = self._graph.add_buffer(
                width=width, height=height, format=first.format, time_base=base
            )
            bwdif = self._graph.add("bwdif", "mode=send_frame:parity=auto:deint=interlaced")
            self._graph.link_nodes(source, bwdif, self._graph.add("buffersink")).configure()
        except self._failures:
            self._graph = None
            return
        if before is not None and self.fits(before):
            self._not_shown = 1
            self._push(before)

    def fits(self, frame: av.VideoFrame) -> bool:
        """Return whether the frame has the size and format that the filter was made for."""
        return _kind(frame) == self._kind

    def add(self, frame: av.VideoFrame) -> Iterator[av.VideoFrame]:
        """Add the next frame; yield those that are ready."""
        self._push(frame)
        yield from self._ready()

    def finish(self) -> Iterator[av.VideoFrame]:
        """Yield the frames that are left."""
        self._push(None)
        yield from self._ready()
        self._graph = None
        yield from self._ready()

    def _push(self, frame: av.VideoFrame | None) -> None:
        if frame is not None:
            self._waiting.append(frame)
        try:
            if self._graph is not None:
                self._graph.vpush(frame)
        except self._failures:
            self._graph = None

    def _ready(self) -> Iterator[av.VideoFrame]:
        while self._waiting and (frame := self._pull()) is not None:
            given = self._waiting.popleft()
            frame.pts = given.pts
            frame.time_base = given.time_base
            if self._not_shown:
                self._not_shown -= 1
            else:
                yield frame

    def _pull(self) -> av.VideoFrame | None:
        """Return what becomes of the frame that has waited longest: itself without a filter; None
        if not ready.
        """
        try:
            if self._graph is not None:
                return self._graph.vpull()
        except (BlockingIOError, EOFError):
            return None
        except self._failures:
            self._graph = None
        return self._waiting[0]


def _kind(frame: av.VideoFrame) -> tuple[int, int, str]:
    return frame.width, frame.height, frame.format.name
