# SPDX-License-Identifier: GPL-3.0-or-later
"""The decoder of video files: frames in order, upright, with square pixels, in SDR and not
interlaced.

PyAV decodes all of them. OpenCV's packages contain further copies of FFmpeg, which are older, lack
decoders and differ from platform to platform; none of them is given a file to read.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, cast

import cv2
import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Float64Array, Uint8Array
from ...errors import VideoError
from ...footage import MAX_PIXELS
from .deinterlace import FIELD_CODECS, deinterlaced
from .guards import check_size, utf8_name
from .hdr import hdr_rgb

if TYPE_CHECKING:
    import av
    from av.container import InputContainer

# Formats that footage comes in. Others may name further files, or devices.
_FORMATS = (
    "mov,matroska,webm,avi,mpegts,mpeg,mpegvideo,flv,asf,ogg,mxf,gif,apng,mjpeg,h264,hevc,m4v,av1,"
    "obu,ivf,yuv4mpegpipe,dv,wtv,nut,gxf,rm,webp_pipe,nsv,jpeg_pipe,vc1,dnxhd,h263,h261,vvc"
)
_ONLY = {"protocol_whitelist": "file", "format_whitelist": _FORMATS}
_MIN_SEEK_S = 20.0  # start from which seeking is tried
# Where Android's phones write at how many frames per second they recorded.
_RECORDED_RATE = "com.android.capture.fps"
_MAX_RATE = 10_000.0
_TIMED_PACKETS = 2000  # from whose times the usual frame rate is estimated
_FIELD = 0.75  # of the time between frames; a packet that is nearer is a second field
_DAMAGED_PACKETS = 4096  # in a row, after which no more are tried
# Degrees clockwise by which an image has to be rotated to be upright.
_ROTATIONS = {90: cv2.ROTATE_90_CLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_COUNTERCLOCKWISE}
DEFAULT_FPS = Fraction(30)  # where footage has no rate; the most common one
_STANDARD_RATES = [Fraction(n) for n in (24, 25, 30, 48, 50, 60, 120, 240)]
_STANDARD_RATES += [Fraction(n * 1000, 1001) for n in (24, 30, 48, 60, 120, 240)]
MEASURED_WITHIN = 0.03  # of the rate that was meant


def _size(width: float, height: float, aspect: float) -> tuple[int, int]:
    """Calculate width and height of an image with square pixels, its side with the coarser pixels
    stretched.
    """
    if abs(aspect - 1) <= 1e-3:
        return round(width), round(height)
    return (
        (round(width * aspect), round(height))
        if aspect > 1
        else (round(width), round(height / aspect))
    )


def next_time(before: float | None, given: float | None, period: float) -> float:
    """Return the time of a frame in seconds, later than that of the frame before.

    :param before: time of the frame before; None for the first one.
    :param given: in the container; some repeat one, and some have none.
    :param period: of the frame rate, in seconds.
    """
    if given is None:
        return 0.0 if before is None else before + period
    if before is None or given > before:
        return given
    # A repeated time must not move the frames after it; where the times stand still, they advance
    # by the frame rate.
    share = next(
        (step for late, step in ((0.25, 0.5), (0.75, 0.25)) if before - given < late * period), 1.0
    )
    return before + share * period


def upright(
    path: Path, image: Uint8Array, aspect: float, clockwise_deg: int, is_mirrored: bool = False
) -> Uint8Array:
    """Stretch an image (H, W, 3) of a file or stream until its pixels are square; mirror it before
    and rotate it after.

    :param aspect: width of a pixel over its height.
    :param clockwise_deg: a multiple of 90; others do not rotate.
    :param is_mirrored: whether top and bottom are exchanged before the rotation, of which every
        mirroring consists.
    :raises VideoError: it is too large or too long (see `guards`).
    """
    if is_mirrored:
        image = cast(Uint8Array, cv2.flip(image, 0))
    height, width = image.shape[:2]
    size = _size(width, height, aspect)
    check_size(path, *size)
    if size != (width, height):
        image = cast(Uint8Array, cv2.resize(image, size, interpolation=cv2.INTER_LINEAR))
    rotation = _ROTATIONS.get(clockwise_deg % 360)
    return image if rotation is None else cast(Uint8Array, cv2.rotate(image, rotation))


def open_with_pyav(path: Path) -> tuple[type[Exception], InputContainer | None]:
    """Open a file with PyAV, which is imported here because not every installation has it.

    :return: the base of PyAV's exceptions, and the container; None if PyAV cannot open the file.
    :raises VideoError: PyAV is not installed.
    """
    try:
        import av
    except ImportError as error:
        raise VideoError(
            f"{path} is a video, HEIC or AVIF, which needs the package 'av' that is not installed; "
            "install it, or give JPEG or PNG images"
        ) from error
    try:
        with utf8_name(path) as name:
            container = av.open(name, options=_ONLY, container_options=_ONLY)
    except (av.error.FFmpegError, OSError, ValueError):
        return av.error.FFmpegError, None
    for stream in container.streams.video:  # whose images may be larger than the container says
        if stream.codec_context:
            stream.codec_context.options = {"max_pixels": str(MAX_PIXELS)}
    return av.error.FFmpegError, container


def film_of(path: Path, container: InputContainer) -> av.VideoStream:
    """Return the stream of moving images: of several, the largest one, for the others are previews.

    The picture of a cover, as files of music have, is none of them.

    :raises VideoError: there is none that can be decoded, or its images are too large or too long.
    """
    from av.stream import Disposition

    def rank(stream: av.VideoStream) -> tuple[bool, int, bool]:
        is_default = bool(stream.disposition & Disposition.default)
        if not stream.codec_context:  # FFmpeg knows no decoder for it
            return False, 0, is_default
        return stream.frames != 1, (stream.width or 0) * (stream.height or 0), is_default

    films = [s for s in container.streams.video if not s.disposition & Disposition.attached_pic]
    film = max(films, key=rank, default=None)  # the first of equal ones
    if film is None and container.streams.audio:
        raise VideoError(f"{path} contains only audio; choose the file with the video")
    if film is None or not film.codec_context:
        raise _undecodable(path)
    check_size(path, *_size(film.width, film.height, float(film.sample_aspect_ratio or 1)))
    return film


def _undecodable(path: Path) -> VideoError:
    return VideoError(
        f"{path} is not a video or image that can be decoded; copy it again if it may be "
        "incomplete, or convert it to an H.264 .mp4"
    )


def rgb(frame: av.VideoFrame, matrix: str | None = None) -> Uint8Array:
    """Convert a frame to RGB (H, W, 3) of SDR.

    :param matrix: that of the YUV of SDR, as PyAV names it; None: the one that the frame states.
    """
    tone_mapped = hdr_rgb(frame)
    if tone_mapped is not None:
        return tone_mapped
    image = frame.to_ndarray(format="rgb24", src_colorspace=matrix, dst_colorspace=matrix)
    return cast(Uint8Array, image)


def orientation(frame: av.VideoFrame) -> tuple[int, bool]:
    """Return by how many degrees clockwise, and whether mirrored, a decoded frame's display matrix
    shows it.
    """
    return -round(frame.rotation) % 360, _is_mirrored(frame)


def _is_mirrored(frame: av.VideoFrame) -> bool:
    """Whether a frame's display matrix mirrors it, which PyAV's angle of rotation does not say."""
    matrix = frame.side_data.get("DISPLAYMATRIX")
    if matrix is None:
        return False
    a, b, _, c, d = np.frombuffer(cast(memoryview, matrix), np.int32, 5).astype(float)
    return bool(a * d < b * c)


def decode_items(path: Path, numbers: Collection[int]) -> dict[int, Uint8Array]:
    """Decode items of a HEIF file (see `heif`).

    PyAV's stream ids are the item numbers. Of several streams with one id, the first is the item;
    the others belong to an animation.

    :return: (h, w, 3) uint8 RGB by item number; for a damaged file, the items that could be
        decoded; nothing where all together have more than `MAX_PIXELS`.
    :raises VideoError: PyAV is not installed.
    """
    pictures: dict[int, Uint8Array] = {}
    pixels_left = MAX_PIXELS
    failure, container = open_with_pyav(path)
    if container is None:
        return pictures
    with container:
        streams = {
            stream.id: stream
            for stream in reversed(container.streams.video)
            if stream.id in numbers
        }
        for stream in streams.values():
            # There may be hundreds of streams, each with its own threads.
            stream.codec_context.thread_count = 1
        try:
            for packet in container.demux(list(streams.values())) if streams else ():
                for frame in cast("list[av.VideoFrame]", packet.decode()):
                    pixels_left -= frame.width * frame.height
                    if pixels_left < 0:
                        return {}
                    if packet.stream.id not in pictures:
                        pictures[packet.stream.id] = rgb(frame)
                if len(pictures) == len(streams):
                    break
        except (failure, OSError, ValueError):
            pass
    return pictures


class PyavReader:
    """A video file, decoded by PyAV, in which frames are read in order.

    ``rate``: frames per second, 0 if the container does not say; ``average_rate``: the same over
    the whole file, which differs where the frame rate varies; ``recorded_rate``: at which a phone
    says that it recorded slow motion, 0 if it does not; ``frame_count`` according to the container;
    ``is_counted``: whether the container counts frames, so that ``average_rate`` is true;
    ``counts_frames_alone``: the same, and not also those that are lacking, as AVI does;
    ``shown_s``: for how many seconds it is shown, None if unknown. A video that was cut
    without re-encoding holds more frames than it shows. ``may_have_field_packets``: whether a
    packet may be one of the two fields of a frame, as in AVCHD. ``is_mirrored``,
    ``clockwise_deg``: whether the last frame that was read had to be mirrored, and by how much it
    was rotated then.

    :raises VideoError: PyAV is not installed or cannot open the file, or its images are too large
        or too long (see `guards`).
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._failure, container = open_with_pyav(path)
        if container is None:
            raise _undecodable(path)
        try:
            self._stream = film_of(path, container)
        except VideoError:
            container.close()
            raise
        self._container = container
        self._stream.thread_type = "AUTO"
        self._decoded = self._decode()
        self._frames = self._whole(self._decoded)
        self._start = self._stream.start_time or 0  # in units of the stream
        self.may_have_field_packets = False
        self.is_mirrored = False
        self.clockwise_deg = 0
        # Width of a pixel over its height.
        self._aspect = float(self._stream.sample_aspect_ratio or 1)
        self.rate = float(self._stream.guessed_rate or self._stream.average_rate or 0)
        self.average_rate = float(self._stream.average_rate or self.rate)
        self.recorded_rate = _recorded_rate(container)
        duration_s = (container.duration or 0) / 1e6
        self.is_counted = self._stream.frames > 0
        self.counts_frames_alone = self.is_counted and container.format.name != "avi"
        self.frame_count = float(self._stream.frames or round(duration_s * self.rate))
        if self._stream.duration and self._stream.time_base:
            self.shown_s: float | None = float(self._stream.duration * self._stream.time_base)
        else:
            late = (container.start_time or 0) if "matroska" in container.format.name else 0
            length_s = ((container.duration or 0) - late) / 1e6
            self.shown_s = length_s if length_s > 0 else None

    def _whole(
        self, frames: Iterator[av.VideoFrame], before: av.VideoFrame | None = None
    ) -> Iterator[av.VideoFrame]:
        """Iterate over frames as whole images; ``before``: the frame before them, by which fields
        are completed.
        """
        return (
            frames
            if self._stream.codec_context.name in FIELD_CODECS
            else deinterlaced(frames, before)
        )

    def _decode(self) -> Iterator[av.VideoFrame]:
        """Decode from where the container is; what is damaged is left out."""
        damaged = 0
        packets = self._container.demux(self._stream)
        while damaged < _DAMAGED_PACKETS:
            try:
                packet = next(packets, None)
                if packet is None:
                    return
                for frame in packet.decode():
                    self.may_have_field_packets |= (
                        frame.interlaced_frame
                        and self._stream.codec_context.name not in FIELD_CODECS
                    )
                    yield frame
                damaged = 0
            except EOFError:  # the decoder has given its last frame
                return
            # PyAV's, at a stream that begins later, in a recording of television for instance
            except IndexError:
                packets = self._container.demux(self._stream)
                damaged = damaged + 1
            except (self._failure, OSError, ValueError):
                damaged += 1

    def _time(self, frame: av.VideoFrame) -> float | None:
        base = self._stream.time_base
        if frame.pts is None or not base:
            return None
        milliseconds = (frame.pts - self._start) * (base.numerator / base.denominator) * 1000
        return milliseconds / 1000

    def read(self) -> tuple[float | None, Uint8Array] | None:
        """Decode the next frame.

        :return: time in seconds, None if the container has none, and the upright image (H, W, 3)
            uint8 RGB; None at the end, or where decoding fails.
        """
        frame = next(self._frames, None)
        if frame is None:
            return None
        self.clockwise_deg, self.is_mirrored = shown = orientation(frame)
        # This holds also where it states another matrix, so that a tag alone changes no result.
        image = rgb(frame, "ITU601")
        return self._time(frame), upright(self._path, image, self._aspect, *shown)

    def skip_to(
        self, seconds: float, fps: Fraction, is_even: bool = True
    ) -> tuple[int, float | None]:
        """Skip to the first frame at or after a time, which has to be called before the first frame
        is read.

        :param fps: rate by which a time is converted to an index.
        :param is_even: whether the index follows from the time; else packets are counted.
        :return: index of the frame that is read next, or the number of frames if the video ends
            before; and the time of the frame before, None if it was not decoded.
        """
        if seconds > _MIN_SEEK_S and self._seek(seconds - _MIN_SEEK_S / 2):
            frame = next(self._decoded, None)
            time = None if frame is None else self._time(frame)
            if frame is not None and time is not None and time < seconds:
                frames = itertools.chain([frame], self._decoded)
                index = round(time * fps)
                if not is_even:
                    stated_fps = exact_fps(self.rate) if self.may_have_field_packets else None
                    index = _frames_before(self._path, cast(int, frame.pts), stated_fps)
                return self._skip(frames, index, seconds, fps)
            self._seek(0.0)
        return self._skip(self._decoded, 0, seconds, fps)

    def _seek(self, seconds: float) -> bool:
        """Go to a keyframe before a time; return whether that was possible."""
        base = self._stream.time_base
        if not base:
            return False
        try:
            self._container.seek(int(seconds / base) + self._start, stream=self._stream)
        except (self._failure, OSError, ValueError):
            return False
        self._decoded = self._decode()
        self._frames = self._whole(self._decoded)
        return True

    def _skip(
        self, frames: Iterator[av.VideoFrame], index: int, seconds: float, fps: Fraction
    ) -> tuple[int, float | None]:
        """Skip frames, the first of which has an index; return as `skip_to`."""
        before: av.VideoFrame | None = None
        before_s: float | None = None
        for frame in frames:
            time = next_time(before_s, self._time(frame), float(1 / fps))
            if time >= seconds - 1e-6:
                self._frames = self._whole(itertools.chain([frame], frames), before)
                break
            before = frame
            before_s = time
            index += 1
        return index, before_s

    def close(self) -> None:
        """Close the file."""
        self._container.close()


def count_frames(path: Path) -> int:
    """Return how many frames a video file has, without decoding them; 0 if it cannot be read.

    :raises VideoError: PyAV is not installed.
    """
    failure, container = open_with_pyav(path)
    if container is None:
        return 0
    try:
        with container:
            stream = film_of(path, container)
            return sum(1 for packet in container.demux(stream) if packet.size)
    except (failure, VideoError):
        return 0


def _frames_before(path: Path, pts: int, interlaced_fps: Fraction | None) -> int:
    """Return how many frames of a video file are shown before a time, without decoding them.

    :param pts: the time in units of the stream.
    :param interlaced_fps: see `_frame_times`.
    """
    times_s: list[float] = []
    for packet in _packets(path):
        if packet.dts is not None and packet.dts >= pts:
            break
        first = packet.stream.start_time or 0
        if packet.pts is not None and first <= packet.pts < pts:
            times_s.append(packet.pts * float(packet.time_base or 0))
    return len(_frame_times(times_s, interlaced_fps))


def _packets(path: Path) -> Iterator[av.Packet[av.VideoStream]]:
    """Iterate over the packets of the film in a file, which are not decoded, up to a damaged one;
    none if it cannot be read.

    :raises VideoError: PyAV is not installed, or there is no film in the file.
    """
    failure, container = open_with_pyav(path)
    if container is not None:
        with container, suppress(failure, OSError, ValueError, EOFError, IndexError):
            yield from container.demux(film_of(path, container))


def _frame_times(times_s: ArrayLike, interlaced_fps: Fraction | None) -> Float64Array:
    """Return the times of frames (n,) in order, from those of packets, in seconds.

    In AVCHD, the two fields of an interlaced frame may be packets of their own, half a frame apart.

    :param interlaced_fps: stated rate of interlaced frames; None if they are not interlaced.
    """
    ordered_s = np.sort(np.asarray(times_s, dtype=np.float64))
    if interlaced_fps is None:
        return ordered_s
    frames_s: list[float] = []
    for time_s in ordered_s:
        if not frames_s or time_s - frames_s[-1] > _FIELD * float(1 / interlaced_fps):
            frames_s.append(time_s)
    return np.array(frames_s)


def exact_fps(fps: float) -> Fraction | None:
    """Convert a float frame rate to the rational that it stands for; None if it is not a rate (0,
    NaN, 90000).

    A ratio of small integers survives the conversion to float and is returned as it is (30000/1001,
    2997/100). A rate averaged over a file's duration is not such a ratio; it becomes the standard
    rate within 0.001 %, if there is one.
    """
    if not 0.01 < fps <= 1000:  # also False for NaN
        return None
    simple = Fraction(fps).limit_denominator(1001)
    if abs(simple - Fraction(fps)) < Fraction(fps) / 10**11:
        return simple
    nearest = min(_STANDARD_RATES, key=lambda rate: abs(rate - Fraction(fps)))
    if abs(nearest - Fraction(fps)) < nearest / 10**5:
        return nearest
    return Fraction(fps).limit_denominator(100_000)


def _recorded_rate(container: InputContainer) -> float:
    """Return at how many frames per second a phone says that it recorded; 0 if it does not."""
    try:
        rate = float(container.metadata.get(_RECORDED_RATE, 0))
    except ValueError:
        return 0.0
    return rate if 0.0 < rate <= _MAX_RATE else 0.0


def packet_rates(
    path: Path, stated_fps: Fraction, may_have_field_packets: bool
) -> tuple[Fraction, Fraction]:
    """Return the frame rate that most frames of a video have, and the average one, from the times
    of its first packets, which are not decoded.

    :param stated_fps: rate where they have no times.
    :param may_have_field_packets: see `PyavReader`.
    :raises VideoError: PyAV is not installed, or there is no video in the file.
    """
    times_s: list[float] = []
    for packet in _packets(path):
        if packet.pts is not None and packet.time_base:
            times_s.append(float(packet.pts * packet.time_base))
        if len(times_s) == _TIMED_PACKETS:
            break
    steps_s = np.diff(_frame_times(times_s, stated_fps if may_have_field_packets else None))
    steps_s = steps_s[steps_s > 1e-4]
    if not len(steps_s):
        return stated_fps, stated_fps
    usual = nearest_fps(float(1 / np.median(steps_s)))
    average = exact_fps(float(1 / np.mean(steps_s)))
    return usual or stated_fps, average or stated_fps


def nearest_fps(measured: float) -> Fraction | None:
    """Return the frame rate that a measured one stands for; None if it is none.

    Containers round times to milliseconds, so a standard rate counts as such within 3 %.
    """
    standard = min(_STANDARD_RATES, key=lambda rate: abs(rate - measured))
    if abs(standard - measured) < MEASURED_WITHIN * measured:
        return standard
    return exact_fps(round(measured, 2))
