# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of a video file one after the other, upright and with square pixels, by whatever can decode it.

OpenCV reads nearly everything; its packages carry no decoder for AV1, which PyAV reads, as it does pictures of phones.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Collection, Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

# Read by OpenCV when it first opens a video. -8 silences ffmpeg's own notes: what matters is said in our words. A
# playlist that calls itself .mp4 may not reach for the network: footage is read from files and from nowhere else.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
os.environ.setdefault("OPENCV_FFMPEG_CAPTURE_OPTIONS", "protocol_whitelist;file")

import cv2
import numpy as np

from ...errors import VideoError

if TYPE_CHECKING:
    import av
    from av.container import InputContainer

_PROTOCOLS = {"protocol_whitelist": "file"}
_WORTH_A_JUMP_S = 20.0
_AV1 = ("av01", "AV01")
# Degrees clockwise by which a picture is to be turned.
_TURN = {90: cv2.ROTATE_90_CLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_COUNTERCLOCKWISE}


class FrameReader(Protocol):
    """What decodes a file."""

    rate: float  # frames a second as the container says; 0 where it does not
    frame_count: float  # what the container claims

    def read(self) -> tuple[float, np.ndarray] | None:
        """Next frame: seconds and upright RGB; None at the end, or where decoding stops."""

    def skip_to(self, seconds: float, fps: Fraction) -> int:
        """Go on to the first frame at or after that time; returns its index, or where the video ends."""

    def close(self) -> None:
        """Let go of the file."""


def open_reader(path: Path) -> FrameReader:
    """The first reader that can decode the file.

    :raises VideoError: none can.
    """
    reader = OpencvReader(path)
    if reader.codec not in _AV1:
        return reader
    reader.close()
    return PyavReader(path)


def _upright(image: np.ndarray, aspect: float, clockwise_deg: int) -> np.ndarray:
    """With square pixels, the shorter side stretched so that no detail is lost, and turned."""
    if abs(aspect - 1) > 1e-3:
        height, width = image.shape[:2]
        size = (round(width * aspect), height) if aspect > 1 else (width, round(height / aspect))
        image = cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
    turn = _TURN.get(clockwise_deg % 360)
    return image if turn is None else cv2.rotate(image, turn)


class OpencvReader:
    """cv2.VideoCapture with rotation and pixel aspect applied here: which backends do it varies between versions."""

    def __init__(self, path: Path) -> None:
        self._capture = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG)
        if not self._capture.isOpened():
            raise VideoError(
                f"{path} is not a video or picture that can be decoded; copy it again if it may be incomplete, or "
                "convert it to an H.264 .mp4"
            )
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        self._turn = round(self._get(cv2.CAP_PROP_ORIENTATION_META))
        num, den = self._get(cv2.CAP_PROP_SAR_NUM), self._get(cv2.CAP_PROP_SAR_DEN)
        self._aspect = num / den if num > 0 and den > 0 else 1.0
        self._grabbed = False
        self._bgr: np.ndarray | None = None  # decoded into again and again: new memory takes time
        self.rate, self.frame_count = self._get(cv2.CAP_PROP_FPS), self._get(cv2.CAP_PROP_FRAME_COUNT)

    @property
    def codec(self) -> str:
        """Four letters that name it."""
        code = int(self._get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF
        return code.to_bytes(4, "little").decode("ascii", "replace")

    def _get(self, prop: int) -> float:
        return self._capture.get(prop)

    def read(self) -> tuple[float, np.ndarray] | None:
        """See `FrameReader`."""
        ok, image = self._capture.retrieve(self._bgr) if self._grabbed else self._capture.read(self._bgr)
        self._grabbed = False
        if not ok or image is None:
            return None
        self._bgr = image
        image = _upright(image, self._aspect, self._turn)
        return self._get(cv2.CAP_PROP_POS_MSEC) / 1000, cv2.cvtColor(image, cv2.COLOR_BGR2RGB)

    def skip_to(self, seconds: float, fps: Fraction) -> int:
        """See `FrameReader`.

        A jump saves decoding what comes before, where the container knows where it leads; else frame by frame.
        """
        if seconds > _WORTH_A_JUMP_S:
            early = seconds - _WORTH_A_JUMP_S / 2
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, int(early * fps))
            index = round(self._get(cv2.CAP_PROP_POS_FRAMES))
            landed = self._capture.grab()
            time = self._get(cv2.CAP_PROP_POS_MSEC) / 1000
            if landed and time < seconds and abs(time - index / fps) < 0.5 / fps:
                return self._grab_to(seconds, index, time, fps)
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
        if not self._capture.grab():
            return 0
        return self._grab_to(seconds, 0, self._get(cv2.CAP_PROP_POS_MSEC) / 1000, fps)

    def _grab_to(self, seconds: float, index: int, time: float, fps: Fraction) -> int:
        """From the frame that was just grabbed. The next ``read`` gives the frame whose index is returned."""
        while time < seconds - 1e-6 and self._capture.grab():
            stamp = self._get(cv2.CAP_PROP_POS_MSEC) / 1000
            index, time = index + 1, stamp if stamp > time else time + float(1 / fps)
        self._grabbed = True
        return index

    def close(self) -> None:
        """See `FrameReader`."""
        self._capture.release()


def _open_with_pyav(path: Path) -> tuple[type[Exception], InputContainer | None]:
    """What PyAV raises, and the file, opened; None where it is nothing that it knows. Imported here: few files need it.

    :raises VideoError: PyAV is missing.
    """
    try:
        import av
    except ImportError as error:
        raise VideoError(
            f"{path} is AV1 or HEIC, which needs the package 'av' that is not installed; install it, or convert a "
            "video to H.264 .mp4, a picture to JPEG"
        ) from error
    try:
        container = av.open(str(path.absolute()), options=_PROTOCOLS, container_options=_PROTOCOLS)
    except (av.error.FFmpegError, OSError, ValueError):
        return av.error.FFmpegError, None
    return av.error.FFmpegError, container


def presented_s(path: Path) -> float | None:
    """How long a video is shown: less than it holds where it was cut without being coded anew; None if it is not known.

    OpenCV counts frames that an edit list leaves out, and in Matroska those before the first one.
    """
    try:
        _, container = _open_with_pyav(path)
    except VideoError:
        return None
    if container is None:
        return None
    with container:
        stream = next(iter(container.streams.video), None)
        if stream is not None and stream.duration and stream.time_base:
            return float(stream.duration * stream.time_base)
        late = (container.start_time or 0) if "matroska" in container.format.name else 0
        length_s = ((container.duration or 0) - late) / 1e6
        return length_s if length_s > 0 else None


def decode_items(path: Path, numbers: Collection[int], most_pixels: int) -> dict[int, np.ndarray]:
    """The coded pictures of a HEIF file (`heif`) by item, (h, w, 3) RGB; of a damaged file, those that were decoded.

    Gives up at ``most_pixels`` in all. PyAV's streams bear the numbers of the items, of which the first counts: what
    moves in an animation has a number of its own, which may be the same.

    :raises VideoError: PyAV is missing.
    """
    pictures: dict[int, np.ndarray] = {}
    failure, container = _open_with_pyav(path)
    if container is None:
        return pictures
    with container:
        streams = {stream.id: stream for stream in reversed(container.streams.video) if stream.id in numbers}
        for stream in streams.values():
            stream.codec_context.thread_count = 1  # each has threads of its own, and there are hundreds of streams
        try:
            for packet in container.demux(list(streams.values())) if streams else ():
                for frame in cast("list[av.VideoFrame]", packet.decode()):
                    most_pixels -= frame.width * frame.height
                    if most_pixels < 0:
                        return {}
                    if packet.stream.id not in pictures:
                        pictures[packet.stream.id] = frame.to_ndarray(format="rgb24")
                if len(pictures) == len(streams):
                    break
        except (failure, OSError, ValueError):
            pass
    return pictures


class PyavReader:
    """PyAV's decoders: AV1 and more."""

    def __init__(self, path: Path) -> None:
        self._failure, container = _open_with_pyav(path)
        if container is None:
            raise VideoError(f"{path} is not a video that can be decoded; convert it to an H.264 .mp4")
        self._container = container
        self._stream = self._container.streams.video[0]
        self._stream.thread_type = "AUTO"
        self._frames: Iterator[av.VideoFrame] = self._container.decode(self._stream)
        self._start_s = float((self._stream.start_time or 0) * (self._stream.time_base or 0))
        self._aspect = float(self._stream.sample_aspect_ratio or 1)
        self.rate, self.frame_count = float(self._stream.average_rate or 0), float(self._stream.frames)

    def _next(self) -> av.VideoFrame | None:
        try:
            return next(self._frames, None)
        except (self._failure, OSError, ValueError):  # damaged: what came before counts
            return None

    def _time(self, frame: av.VideoFrame) -> float:
        return 0.0 if frame.time is None else float(frame.time) - self._start_s

    def read(self) -> tuple[float, np.ndarray] | None:
        """See `FrameReader`."""
        frame = self._next()
        if frame is None:
            return None
        image = _upright(frame.to_ndarray(format="rgb24"), self._aspect, -round(frame.rotation))
        return self._time(frame), image

    def skip_to(self, seconds: float, fps: Fraction) -> int:
        """See `FrameReader`."""
        index, time, frame = 0, -1.0, self._next()
        while frame is not None:
            stamp = self._time(frame)
            time = stamp if stamp > time else time + float(1 / fps)
            if time >= seconds - 1e-6:
                self._frames = itertools.chain([frame], self._frames)
                break
            index, frame = index + 1, self._next()
        return index

    def close(self) -> None:
        """See `FrameReader`."""
        self._container.close()
