# SPDX-License-Identifier: GPL-3.0-or-later
"""Where frames come from: a camera, a stream, or a file that is played in real time."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from ..capture.media.frame_readers import upright
from ..capture.media.image_size import check_size
from ..capture.media.video import open_video
from ..errors import OfflineError, VideoError
from .clock import Clock

if TYPE_CHECKING:
    import av
    from av.container import InputContainer

SCHEMES = ("http", "https", "rtsp", "rtsps", "rtmp", "rtmps", "srt", "udp", "rtp", "tcp")
# What a stream may open in turn, such as the segments of a playlist: never a file of this computer.
_PROTOCOLS = "http,https,httpproxy,tcp,tls,udp,rtp,rtmp,rtmps,rtsp,rtsps,srt,srtp,crypto"
_FORMATS = (
    "rtsp,rtp,sdp,mpjpeg,mjpeg,jpeg_pipe,hls,dash,flv,live_flv,mpegts,mpeg,mov,matroska,webm,avi,h264,hevc,m4v,ogg,asf,"
    "nut"
)
STALLED_S = 5.0  # without a frame, after which a stream counts as interrupted
DEFAULT_FPS = Fraction(30)
CAMERA_SIZE = (1280, 720)


@dataclass(frozen=True)
class Picture:
    """One frame: its index and time in the source, when it came (seconds of the clock), and the (H, W, 3) RGB image."""

    index: int
    timestamp_s: float
    arrived_s: float
    image_rgb: NDArray[np.uint8]


class Source(Protocol):
    """A source of frames that can be opened again."""

    name: str  # for messages and the motion file
    ends: bool  # whether the end of its frames is the end of the capture, rather than an interruption
    fps: Fraction  # nominal
    focal_35mm: float | None

    def pictures(self, clock: Clock) -> Iterator[Picture]:
        """Open the source and yield its frames as they come; their number begins with 0, their time anywhere.

        :raises VideoError: the source cannot be opened, or fails.
        """


def is_stream(text: str) -> bool:
    """Return whether the source that a text names is on the network, rather than a camera or a file."""
    return re.match(r"[A-Za-z][\w+.-]+:", text) is not None and "//" in text


def open_source(text: str, *, online: bool = True) -> Source:
    """Return the source that a text names: a camera's number or device, a URL, or a file.

    :param online: whether the network may be used.
    :raises VideoError: it is none of these, or a stream that may not be used.
    """
    if re.fullmatch(r"\d{1,3}", text):
        return CameraSource(int(text))
    if re.match(r"/dev/video\d+$", text):
        return CameraSource(text)
    if is_stream(text):
        scheme = text.partition(":")[0]
        if scheme.lower() not in SCHEMES:
            raise VideoError(f"{text}: '{scheme}' is not a kind of stream that can be read; use {', '.join(SCHEMES)}")
        if not online:
            raise OfflineError
        return StreamSource(text)
    return FileSource(Path(text))


class FileSource:
    """A video, played at its own speed."""

    ends = True

    def __init__(self, path: Path) -> None:
        """Check the file.

        :raises VideoError: it cannot be used.
        """
        self._path, self.name = path, path.name
        with open_video(path) as video:
            self.fps, self.focal_35mm = video.fps, video.focal_35mm

    def pictures(self, clock: Clock) -> Iterator[Picture]:
        """See `Source`."""
        with open_video(self._path) as video:
            began_s = clock.now()
            for frame in video:
                due_s = began_s + frame.timestamp_s
                clock.sleep(due_s - clock.now())
                yield Picture(frame.index, frame.timestamp_s, max(due_s, clock.now()), frame.image_rgb)


class StreamSource:
    """A stream from the network."""

    ends = False

    def __init__(self, url: str) -> None:
        self._url, self.name = url, re.sub(r"//[^/@]*@", "//", url)  # without a password
        self.fps = DEFAULT_FPS
        self.focal_35mm: float | None = None

    def pictures(self, clock: Clock) -> Iterator[Picture]:
        """See `Source`.

        :raises VideoError: it cannot be opened, carries no video, or was interrupted.
        """
        import av

        container = self._open()
        with container:
            stream = next(iter(container.streams.video), None)
            if stream is None:
                raise VideoError(f"{self.name} carries no video; check the address")
            stream.thread_type = "SLICE"  # decoding in several frames' threads delays each of them
            if stream.average_rate and 1 <= stream.average_rate <= 240:
                self.fps = Fraction(stream.average_rate)
            try:
                for index, frame in enumerate(container.decode(stream)):
                    now_s = clock.now()
                    yield Picture(index, now_s, now_s, self._image(frame, float(stream.sample_aspect_ratio or 1)))
            except (av.error.FFmpegError, OSError, ValueError) as error:
                raise VideoError(f"{self.name} was interrupted ({_reason(error)})") from error

    def _open(self) -> InputContainer:
        import av

        options = {"protocol_whitelist": _PROTOCOLS, "format_whitelist": _FORMATS}
        options |= {"fflags": "nobuffer", "flags": "low_delay", "probesize": "500000", "analyzeduration": "1000000"}
        if self._url.startswith("rtsp"):
            options["rtsp_transport"] = "tcp"
        try:
            return av.open(
                self._url, options=options, container_options=options, timeout=(STALLED_S, STALLED_S), mode="r"
            )
        except (av.error.FFmpegError, OSError, ValueError) as error:
            raise VideoError(
                f"{self.name} cannot be opened ({_reason(error)}); check the address, and whether its server runs"
            ) from error

    def _image(self, frame: av.VideoFrame, aspect: float) -> NDArray[np.uint8]:
        """Return the frame as it is to be shown; phones send what they film upright as rotated."""
        check_size(Path(self.name), frame.width, frame.height)
        image = cast(NDArray[np.uint8], frame.to_ndarray(format="rgb24"))
        return upright(Path(self.name), image, aspect, -round(frame.rotation))


class CameraSource:
    """A camera of this computer, by number or device."""

    ends = False

    def __init__(self, device: int | str) -> None:
        """Check that the device exists, where that can be seen from its name.

        :raises VideoError: it does not.
        """
        self._device, self.name = device, f"camera {device}"
        self.fps = DEFAULT_FPS
        self.focal_35mm: float | None = None
        path = f"/dev/video{device}" if isinstance(device, int) else device
        if sys.platform.startswith("linux") and not os.path.exists(path):
            found = sorted(str(p) for p in Path("/dev").glob("video*"))
            advice = f"choose one of {', '.join(found)}" if found else "connect a camera, or choose a stream or a file"
            raise VideoError(f"{self.name} does not exist; {advice}")

    def pictures(self, clock: Clock) -> Iterator[Picture]:
        """See `Source`.

        :raises VideoError: it cannot be opened, or gives no more frames.
        """
        capture = self._open()
        try:
            index = 0
            while True:
                ok, bgr = capture.read()
                now_s = clock.now()
                if not ok or bgr is None:
                    raise VideoError(f"{self.name} gives no more frames; check that it is plugged in")
                yield Picture(index, now_s, now_s, cast(NDArray[np.uint8], cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)))
                index += 1
        finally:
            capture.release()

    def _open(self) -> Any:
        capture = cv2.VideoCapture(self._device)
        if not capture.isOpened():
            raise VideoError(
                f"{self.name} cannot be opened; check that it is plugged in, that no other program uses it, and that "
                "this one may use cameras"
            )
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))  # uncompressed, USB carries 10 frames/s
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, CAMERA_SIZE[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, CAMERA_SIZE[1])
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        rate = capture.get(cv2.CAP_PROP_FPS)
        self.fps = Fraction(round(rate)) if 1 <= rate <= 240 else DEFAULT_FPS
        return capture


def _reason(error: Exception) -> str:
    text = str(getattr(error, "strerror", None) or error).lower()
    return f"nothing came for {STALLED_S:g} s" if "immediate exit" in text else text  # as FFmpeg calls a timeout
