# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes videos with PyAV: H.264, or MPEG-4 Part 2 where its FFmpeg has been built without x264."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arrays import Uint8Array
from ...errors import OutputError
from .guards import utf8_name

if TYPE_CHECKING:
    import av

# Codec, and its options: visually without loss at a size and speed that suit a preview. No
# B-frames: MP4 takes its duration from the times of decoding, which B-frames put before those of
# showing, by seconds at a variable rate.
_CODECS = (("libx264", {"preset": "veryfast", "crf": "20", "bf": "0"}), ("mpeg4", {"qscale": "4"}))
_LARGEST = 65535  # of numerator and denominator of MPEG-4's clock
# Ticks per second, about as many as MPEG-4's clock can have, for images whose times are given.
_TICKS = 60000
# A file that can be read up to its last second at any time, and is an ordinary one when it is
# closed. FFmpeg cannot do that before 7.1.
_GROWING = {
    "movflags": "hybrid_fragmented",
    "frag_duration": "1000000",  # microseconds
    "flush_packets": "1",  # nothing waits in memory for more
}


class VideoWriter:
    """A video that is being written, as a context. Leaving it without an error, or `close`,
    completes the file.

    :raises OutputError: PyAV is not installed, or the file cannot be written.
    """

    def __init__(
        self,
        temporary: Path,
        fps: Fraction,
        width: int,
        height: int,
        path: Path,
        *,
        growing: bool = False,
    ) -> None:
        """Open the file.

        :param width: in pixels, even; ``height`` likewise.
        :param path: the name to use in messages.
        :param growing: whether what a killed process leaves of the file can be read.
        """
        try:
            import av
        except ImportError as error:
            raise OutputError(
                f"cannot write {path}: it needs the package 'av', which is not installed; choose a "
                ".png or .jpg overlay"
            ) from error
        self._av = av
        self._path = path
        self._failures = (av.error.FFmpegError, OSError, ValueError)
        # A name that is not UTF-8 is opened by a link to the file, with the first image.
        temporary.touch()
        self._name = ExitStack()
        try:
            name = self._name.enter_context(utf8_name(temporary))
            options = _GROWING if growing else {}
            self._container: av.container.OutputContainer = av.open(
                name, "w", container_options=options
            )
        except self._failures as error:
            self._name.close()
            raise self._refused() from error
        rate = _rate(fps)
        # A clock that has every time of the rate.
        self._clock = Fraction(1, rate.numerator * max(1, _TICKS // rate.numerator))
        self._last = -1
        self._stream = self._add_stream(rate, width, height)

    def _add_stream(self, rate: Fraction, width: int, height: int) -> Any:
        for codec, options in _CODECS:
            if codec not in self._av.codecs_available:
                continue
            stream: Any = self._container.add_stream(codec, rate=rate, options=options)
            stream.width = width
            stream.height = height
            stream.pix_fmt = "yuv420p"
            return stream
        self.abandon()
        raise OutputError(
            f"cannot write {self._path}: no video encoder was found; choose a .png or .jpg overlay"
        )

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: object) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()

    def write(self, image: Uint8Array, time_s: float | None = None) -> None:
        """Append an image.

        :param image: (H, W, 3) uint8 RGB.
        :param time_s: when it is shown, after the one before by at least a tick; given for every
            image, or for none.
        :raises OutputError: the system refused.
        """
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
        if time_s is not None:
            self._stream.codec_context.time_base = frame.time_base = self._clock
            self._last = frame.pts = max(self._last + 1, round(time_s / self._clock))
        try:
            self._container.mux(self._stream.encode(frame))
        except self._failures as error:
            raise self._refused() from error

    def close(self) -> None:
        """Write what is left, and the index.

        :raises OutputError: the system refused.
        """
        try:
            self._container.mux(self._stream.encode())
            self._container.close()
        except self._failures as error:
            self.abandon()
            raise self._refused() from error
        self._name.close()

    def abandon(self) -> None:
        """Close the file, which then is of no use."""
        with self._name, suppress(*self._failures):
            self._container.close()

    def _refused(self) -> OutputError:
        return OutputError(
            f"could not finish writing {self._path}; free some space or choose another folder"
        )


def _rate(fps: Fraction) -> Fraction:
    """Return the nearest rate that every codec can state."""
    return fps.limit_denominator(_LARGEST) if fps <= _LARGEST else Fraction(_LARGEST)
