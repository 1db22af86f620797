# SPDX-License-Identifier: GPL-3.0-or-later
"""Decoders of video files: frames in order, upright and with square pixels.

OpenCV decodes most files. Its packages have no decoder for AV1 and HEIC, which PyAV decodes.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Collection, Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

# OpenCV reads this when it first opens a video. -8 silences ffmpeg's messages, because Scope reports errors itself.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import VideoError
from .file_names import utf8_name
from .image_size import check_size

if TYPE_CHECKING:
    import av
    from av.container import InputContainer

# Formats that footage comes in. Others may name further files, or devices.
_FORMATS = (
    "mov", "matroska", "webm", "avi", "mpegts", "mpeg", "mpegvideo", "flv", "asf", "ogg", "mxf", "gif", "apng", "mjpeg",
    "h264", "hevc", "m4v", "av1", "obu", "ivf", "yuv4mpegpipe", "dv", "wtv", "nut", "gxf", "rm", "webp_pipe", "nsv",
)  # fmt: skip
_ONLY = {"protocol_whitelist": "file", "format_whitelist": ",".join(_FORMATS)}
_MIN_SEEK_S = 20.0  # start from which seeking is tried
_AV1 = ("av01", "AV01")
# Degrees clockwise by which an image has to be rotated to be upright.
_ROTATIONS = {90: cv2.ROTATE_90_CLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_COUNTERCLOCKWISE}


class FrameReader(Protocol):
    """Decoder of one file."""

    rate: float  # frames per second according to the container; 0 if it does not say
    frame_count: float  # according to the container

    def read(self) -> tuple[float, NDArray[np.uint8]] | None:
        """Decode the next frame.

        :return: time in seconds and the upright image (H, W, 3) uint8 RGB; None at the end, or where decoding fails.
        """

    def skip_to(self, seconds: float, fps: Fraction) -> int:
        """Skip to the first frame at or after a time.

        :param fps: rate by which an index is converted to a time.
        :return: index of the frame that is read next; the number of frames if the video ends before.
        """

    def close(self) -> None:
        """Close the file."""


def open_reader(path: Path) -> FrameReader:
    """Open the file with the first reader that can decode it.

    :raises VideoError: no reader can.
    """
    reader = OpencvReader(path)
    if reader.codec not in _AV1:
        return reader
    reader.close()
    return PyavReader(path)


def _size(width: float, height: float, aspect: float) -> tuple[int, int]:
    """Calculate width and height of an image with square pixels, its side with the coarser pixels stretched."""
    if abs(aspect - 1) <= 1e-3:
        return round(width), round(height)
    return (round(width * aspect), round(height)) if aspect > 1 else (round(width), round(height / aspect))


def _upright(path: Path, image: NDArray[np.uint8], aspect: float, clockwise_deg: int) -> NDArray[np.uint8]:
    """Stretch an image of a file until pixels are square, then rotate it.

    :raises VideoError: it is too large or too long (see `image_size`).
    """
    height, width = image.shape[:2]
    size = _size(width, height, aspect)
    check_size(path, *size)
    if size != (width, height):
        image = cast(NDArray[np.uint8], cv2.resize(image, size, interpolation=cv2.INTER_LINEAR))
    rotation = _ROTATIONS.get(clockwise_deg % 360)
    return image if rotation is None else cast(NDArray[np.uint8], cv2.rotate(image, rotation))


class OpencvReader:
    """cv2.VideoCapture with rotation and pixel aspect applied here, because OpenCV versions differ in applying them.

    :raises VideoError: OpenCV cannot open the file, or its images are too large or too long (see `image_size`).
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with utf8_name(path) as name:
            self._capture = cv2.VideoCapture(name, cv2.CAP_FFMPEG)
        if not self._capture.isOpened():
            raise VideoError(
                f"{path} is not a video or image that can be decoded; copy it again if it may be incomplete, or "
                "convert it to an H.264 .mp4"
            )
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        self._rotation_deg = round(self._get(cv2.CAP_PROP_ORIENTATION_META))
        num, den = self._get(cv2.CAP_PROP_SAR_NUM), self._get(cv2.CAP_PROP_SAR_DEN)
        self._aspect = num / den if num > 0 and den > 0 else 1.0
        check_size(
            path, *_size(self._get(cv2.CAP_PROP_FRAME_WIDTH), self._get(cv2.CAP_PROP_FRAME_HEIGHT), self._aspect)
        )
        self._grabbed = False
        self._bgr: NDArray[np.uint8] | None = None  # reused for every frame: allocating memory takes time
        self.rate, self.frame_count = self._get(cv2.CAP_PROP_FPS), self._get(cv2.CAP_PROP_FRAME_COUNT)

    @property
    def codec(self) -> str:
        """The FourCC of the video stream."""
        code = int(self._get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF
        return code.to_bytes(4, "little").decode("ascii", "replace")

    def _get(self, prop: int) -> float:
        return float(self._capture.get(prop))

    def read(self) -> tuple[float, NDArray[np.uint8]] | None:
        """See `FrameReader`."""
        ok, decoded = self._capture.retrieve(self._bgr) if self._grabbed else self._capture.read(self._bgr)
        self._grabbed = False
        if not ok or decoded is None:
            return None
        self._bgr = cast(NDArray[np.uint8], decoded)
        image = cv2.cvtColor(_upright(self._path, self._bgr, self._aspect, self._rotation_deg), cv2.COLOR_BGR2RGB)
        return self._get(cv2.CAP_PROP_POS_MSEC) / 1000, cast(NDArray[np.uint8], image)

    def skip_to(self, seconds: float, fps: Fraction) -> int:
        """See `FrameReader`.

        Seeks if the container reports where the seek has led, which saves decoding; else reads frame by frame.
        """
        if seconds > _MIN_SEEK_S:
            early = seconds - _MIN_SEEK_S / 2
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
        """Skip from the frame that was just grabbed. The next ``read`` gives the frame whose index is returned."""
        while time < seconds - 1e-6 and self._capture.grab():
            stamp = self._get(cv2.CAP_PROP_POS_MSEC) / 1000
            index, time = index + 1, stamp if stamp > time else time + float(1 / fps)
        self._grabbed = True
        return index

    def close(self) -> None:
        """See `FrameReader`."""
        self._capture.release()


def _open_with_pyav(path: Path) -> tuple[type[Exception], InputContainer | None]:
    """Open a file with PyAV, which is imported here because few files need it.

    :return: the base of PyAV's exceptions, and the container; None if PyAV cannot open the file.
    :raises VideoError: PyAV is not installed.
    """
    try:
        import av
    except ImportError as error:
        raise VideoError(
            f"{path} is AV1 or HEIC, which needs the package 'av' that is not installed; install it, or convert a "
            "video to H.264 .mp4, an image to JPEG"
        ) from error
    try:
        with utf8_name(path) as name:
            container = av.open(name, options=_ONLY, container_options=_ONLY)
    except (av.error.FFmpegError, OSError, ValueError):
        return av.error.FFmpegError, None
    return av.error.FFmpegError, container


def _rgb(frame: av.VideoFrame) -> NDArray[np.uint8]:
    return cast(NDArray[np.uint8], frame.to_ndarray(format="rgb24"))


def presented_duration_s(path: Path) -> float | None:
    """Read for how many seconds a video is shown; None if that is unknown.

    A video that was cut without re-encoding holds more frames than it shows. OpenCV also counts the frames that an edit
    list leaves out, and in Matroska those before the start.
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


def decode_items(path: Path, numbers: Collection[int], max_pixels: int) -> dict[int, NDArray[np.uint8]]:
    """Decode items of a HEIF file (see `heif`).

    PyAV's stream ids are the item numbers. Of several streams with one id, the first is the item; the others belong to
    an animation.

    :param numbers: of the items to decode.
    :param max_pixels: the limit for all items together, beyond which nothing is returned.
    :return: (h, w, 3) uint8 RGB by item number; for a damaged file, the items that could be decoded.
    :raises VideoError: PyAV is not installed.
    """
    pictures: dict[int, NDArray[np.uint8]] = {}
    pixels_left = max_pixels
    failure, container = _open_with_pyav(path)
    if container is None:
        return pictures
    with container:
        streams = {stream.id: stream for stream in reversed(container.streams.video) if stream.id in numbers}
        for stream in streams.values():
            stream.codec_context.thread_count = 1  # there may be hundreds of streams, each with its own threads
        try:
            for packet in container.demux(list(streams.values())) if streams else ():
                for frame in cast("list[av.VideoFrame]", packet.decode()):
                    pixels_left -= frame.width * frame.height
                    if pixels_left < 0:
                        return {}
                    if packet.stream.id not in pictures:
                        pictures[packet.stream.id] = _rgb(frame)
                if len(pictures) == len(streams):
                    break
        except (failure, OSError, ValueError):
            pass
    return pictures


class PyavReader:
    """PyAV's decoders, for AV1.

    :raises VideoError: PyAV is not installed or cannot open the file, or its images are too large or too long (see
        `image_size`).
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._failure, container = _open_with_pyav(path)
        if container is None:
            raise VideoError(f"{path} is not a video that can be decoded; convert it to an H.264 .mp4")
        self._container = container
        self._stream = self._container.streams.video[0]
        self._stream.thread_type = "AUTO"
        self._frames: Iterator[av.VideoFrame] = self._container.decode(self._stream)
        self._start_s = float((self._stream.start_time or 0) * (self._stream.time_base or 0))
        self._aspect = float(self._stream.sample_aspect_ratio or 1)
        check_size(path, *_size(self._stream.width, self._stream.height, self._aspect))
        self.rate, self.frame_count = float(self._stream.average_rate or 0), float(self._stream.frames)

    def _next(self) -> av.VideoFrame | None:
        try:
            return next(self._frames, None)
        except (self._failure, OSError, ValueError):  # damaged: the video ends here
            return None

    def _time(self, frame: av.VideoFrame) -> float:
        return 0.0 if frame.time is None else float(frame.time) - self._start_s

    def read(self) -> tuple[float, NDArray[np.uint8]] | None:
        """See `FrameReader`."""
        frame = self._next()
        if frame is None:
            return None
        image = _upright(self._path, _rgb(frame), self._aspect, -round(frame.rotation))
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
