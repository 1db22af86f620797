# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage as a sequence of upright RGB frames with square pixels and presentation timestamps.

    with open_video("dance.mp4") as video:
        for frame in video:            # decoded ahead in a thread; at most a few frames in memory
            frame.index, frame.timestamp_s, frame.image_rgb
    video.warnings                     # for the user: decoding stopped early, the frame size
                                       changed, ...

``open_video("dance.mp4", VideoRange(start_s=60, end_s=90, fps=Fraction(25)))`` gives a part of it
at a lower rate; the index and time of each frame are still those of the whole video.
"""

from __future__ import annotations

import math
import queue
import re
import stat
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import cast

import cv2
import numpy as np

from ...arrays import Uint8Array
from ...errors import VideoError, unreadable
from ...notices import Notice, notice
from .frame import Frame
from .frame_readers import (
    DEFAULT_FPS,
    PyavReader,
    count_frames,
    exact_fps,
    next_time,
    packet_rates,
)
from .image_sequence import PictureSequence, SequenceReader, find_sequence
from .quicktime import focal_35mm
from .still_images import is_picture, read_picture
from .video_range import FootageRange, FrameSampler, VideoRange

cv2.setLogLevel(0)  # silent: failures are reported as exceptions

# How lists of other files begin (ffconcat, HLS, DASH, SDP), which FFmpeg opens by their content,
# whatever the name.
_LISTS = (b"ffconcat", b"#EXTM3U", b"<?xml", b"<MPD", b"v=0", b"[playlist]")
_VARYING = Fraction(2, 100)  # of the rate, by which the average differs where it varies
_SAME_S = 1e-6  # within which a frame is at a time, as in decoding
_ONE_MISSING = 0.5  # frames, from which at least one is missing, or too many
_SLOW_MOTION = 1.5  # recorded rate over that at which it plays; less is rounding, or a film's 24
_LOST_S = 1.0  # at the end of a video whose container counts the frames
# A step from one frame to the next that is no uneven rate but a gap: by both.
_GAP_S = 0.5
_GAP_FRAMES = 10
# Of a frame; a fifth of what videos of calls and surveillance have at their lowest quality.
_LEAST_BYTES = 100
_PIECE_BYTES = 1 << 20
_QUEUED_FRAMES = 4  # decoded ahead; a 4K frame takes 25 MB


@dataclass(frozen=True)
class StatedRate:
    """How many frames a second a file has, and how it times them."""

    usual_fps: Fraction
    average_fps: Fraction  # over the whole file; another one where the rate varies
    is_even: bool = True  # a frame's time tells its number
    is_counted: bool = False  # the container counts the frames
    # How many times as fast as it plays the footage was recorded, according to the file.
    recorded_speed: float = 1.0


@dataclass
class Video:
    """Open footage, whose first frame could be decoded. Each iteration starts at the first frame of
    the range.

    ``width``, ``height`` in pixels of the upright frames; ``frame_count`` of the whole footage
    according to the container, which may be wrong; ``fps``: rational rate of the frames that an
    iteration yields, ``source_fps`` of those in the file; ``focal_35mm`` in mm on a 36 × 24 mm
    frame, or None; ``wanted``: the range.
    """

    path: Path
    width: int
    height: int
    fps: Fraction
    frame_count: int
    focal_35mm: float | None = None
    warnings: list[Notice] = field(default_factory=list)
    wanted: VideoRange = field(default_factory=VideoRange)
    rate: StatedRate | None = field(default=None, repr=False)  # None: even, at ``fps``
    _sequence: PictureSequence | None = field(default=None, repr=False)
    _still: Uint8Array | None = field(default=None, repr=False)
    _is_part: bool = field(default=False, repr=False)  # see `frames_from`
    _bytes: int | None = field(default=None, repr=False)  # of the file when it was opened
    _decoders: list[_Decoder] = field(default_factory=list, repr=False)

    @property
    def is_still(self) -> bool:
        """Whether this is a single picture, which has no times."""
        return self._still is not None

    @property
    def source_fps(self) -> Fraction:
        """Frame rate of the file, frames per second."""
        return self.rate.usual_fps if self.rate else self.fps

    @property
    def average_fps(self) -> Fraction:
        """Frame rate over the whole file, which differs from `source_fps` where the rate varies."""
        return self.rate.average_fps if self.rate else self.fps

    @property
    def recorded_speed(self) -> float:
        """How many times as fast as it plays the footage was recorded, according to the file."""
        return self.rate.recorded_speed if self.rate else 1.0

    @property
    def expected_frames(self) -> int:
        """Number of frames that an iteration yields, if the container's frame count is right."""
        if self._sequence is not None:
            return max(1, len(self._wanted_slots()))
        # Where the rate varies, there can be more frames than at the usual rate, and all count.
        rate = float(self.average_fps)
        first = max(0, math.ceil((self.wanted.start_s - _SAME_S) * rate))
        last = self.frame_count - 1
        if self.wanted.end_s < last / rate:
            last = math.floor((self.wanted.end_s + _SAME_S) * rate)
        steps = (last - first) * float(self._expected_rate) / rate
        # As `FrameSampler` does: no frame half a step before a sample's time is it.
        return max(1, math.ceil(steps - 0.5 - _SAME_S) + 1)

    @property
    def length_s(self) -> float:
        """For how many seconds the range is shown, to a whole frame, if the container is right."""
        slots = self._wanted_slots()
        if slots:
            return (slots[-1] - slots[0] + 1) / float(self.fps)
        return self.expected_frames / float(self._expected_rate)

    @property
    def _expected_rate(self) -> Fraction:
        """Number of frames per second of those that are expected."""
        rate = self.average_fps
        return rate if self.wanted.fps is None else min(self.wanted.fps, rate)

    def _wanted_slots(self) -> list[int]:
        """Return the slots of a sequence's pictures in the range; none of other footage."""
        if self._sequence is None:
            return []
        start_s = self.wanted.start_s - _SAME_S
        end_s = self.wanted.end_s + _SAME_S
        return [slot for slot in self._sequence.slots if start_s <= float(slot / self.fps) <= end_s]

    @property
    def most_frames(self) -> int:
        """Number of frames that an iteration yields at most: what the container says, or, where its
        bytes can hardly hold so many, what is counted in it. A few bytes can claim years.
        """
        expected = self.expected_frames
        if self._sequence is not None or self._bytes is None:
            return expected
        if self._bytes >= _LEAST_BYTES * expected:
            return expected
        return max(1, min(expected, count_frames(self.path)))

    def __iter__(self) -> Iterator[Frame]:
        if self._still is not None:
            yield Frame(0, 0.0, self._still)
            return
        decoder = _Decoder(self)
        self._decoders.append(decoder)
        with closing(decoder):
            yield from decoder

    def frames_from(self, start_s: float) -> Iterator[Frame]:
        """Iterate over the frames of the range from a time on, which is sought where that saves
        decoding.

        Their indices may differ from those of the whole iteration by a constant, where the frame
        rate varies or frames are missing. Whether images and times are the same depends on the
        file: one that does not mark its keyframes well gives other images at first, and one that
        repeats times at a keyframe other times there. The caller has to compare.

        :param start_s: within the range; it must have no frame rate of its own.
        """
        return iter(replace(self, wanted=replace(self.wanted, start_s=start_s), _is_part=True))

    def gap_notices(self, times_s: Sequence[float]) -> list[Notice]:
        """Say where frames are lacking inside the range, as where a part of a file is damaged; of
        the pictures of a sequence, their numbers tell.

        :param times_s: of all frames that an iteration has yielded.
        """
        if self._sequence is not None:
            return []
        begins_s = np.array([self.wanted.start_s, *times_s])
        lengths_s = np.diff(begins_s)
        is_gap = lengths_s > max(_GAP_S, _GAP_FRAMES / float(self.fps))
        if not is_gap.any():
            return []
        found = notice(
            "frames_lacking",
            footage=self.path.name,
            times=begins_s[:-1][is_gap].tolist(),
            longest_s=float(lengths_s.max()),
        )
        return [found]

    def close(self) -> None:
        """Stop the decoding threads of this video; a running iteration ends."""
        while self._decoders:
            self._decoders.pop().close()

    def __enter__(self) -> Video:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def no_frames_error(video: Video) -> VideoError:
    """Return the error for a range without frames."""
    return VideoError(
        f"{video.path} has no frames between the given start and end; change one of them"
    )


def open_video(path: str | Path, wanted: FootageRange | None = None) -> Video:
    """Open a video or a picture (JPEG, HEIC, PNG, WebP, TIFF, ..., also 16-bit and with alpha);
    decode its first frame.

    Image sequences (see `image_sequence`) count as videos, with the rate of ``wanted``, or else 30.

    :param wanted: the range of frames and their rate; None for all.
    :raises VideoError: it does not exist, is not a file, is a list of files, holds nothing that can
        be decoded, holds images that are too large or too long (see `guards`), or ends before
        the range.
    :raises UsageError: a timecode of the range does not exist at the footage's rate.
    """
    path = Path(path)
    wanted = wanted or VideoRange()
    sequence = find_sequence(path, wanted.fps is not None)
    if sequence:
        return _open_sequence(path, sequence, wanted)
    if path.is_dir():
        raise VideoError(
            f"{path} is a folder that contains no images; give a video, an image or a folder of "
            "images, or capture a folder of videos with scope batch"
        )
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):  # opening a pipe would wait for a writer
            raise VideoError(
                f"{path} is a pipe or a device, and footage is read from files; save "
                "it as one first"
            )
        with path.open("rb") as file:
            head = file.read(64)
    except FileNotFoundError as error:
        web = re.match(r"\w{2,}:[/\\]", str(path))
        advice = (
            "download it first, because footage is read from files" if web else "check the path"
        )
        raise VideoError(f"{path} does not exist; {advice}") from error
    except OSError as error:
        raise VideoError(
            f"{path} cannot be read ({error.strerror}); check its permissions"
        ) from error
    if status.st_size == 0:
        raise VideoError(f"{path} is empty (0 bytes); export or download it again")
    if head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(_LISTS):
        raise VideoError(f"{path} is a playlist or other text, not footage; give a video itself")
    if is_picture(path):
        return _open_still(path, wanted)
    video = _open_moving(path, wanted)
    video._bytes = status.st_size
    return video


def _open_sequence(path: Path, sequence: PictureSequence, requested: FootageRange) -> Video:
    fps = requested.fps or DEFAULT_FPS
    wanted = requested.at_rate(fps)
    first = read_picture(sequence.paths[0])
    if first is None:
        raise _damaged(sequence.paths[0])
    width, height = wanted.view.size(first.rgb.shape[1], first.rgb.shape[0])
    count = len(sequence.paths)
    video = Video(
        path, width, height, fps, count, first.focal_35mm, wanted=replace(wanted, fps=None)
    )
    video._sequence = sequence
    video.warnings += sequence.warnings
    if requested.fps is None and count > 1:
        video.warnings.append(notice("assumed_frame_rate", footage=path.name))
    return video


def _open_still(path: Path, requested: FootageRange) -> Video:
    picture = read_picture(path)
    if picture is None:
        raise _damaged(path)
    image = requested.view.show(picture.rgb)
    height, width = image.shape[:2]
    wanted = VideoRange(view=requested.view)
    video = Video(
        path, width, height, DEFAULT_FPS, 1, picture.focal_35mm, wanted=wanted, _still=image
    )
    if picture.length > 1:
        video.warnings.append(
            notice("first_of_animation", footage=path.name, images=picture.length)
        )
    return video


def _damaged(picture: Path) -> VideoError:
    return VideoError(
        f"{picture} is an image that cannot be decoded; it may be damaged, so export "
        "it again as JPEG"
    )


def _open_moving(path: Path, requested: FootageRange) -> Video:
    with closing(PyavReader(path)) as reader:
        first = reader.read()
        if first is None:
            raise VideoError(
                f"{path} can be opened, but none of its frames can be decoded; "
                "convert it to H.264 .mp4"
            )
        rate = _stated_rate(path, reader)
        count = reader.frame_count
        claimed = reader.shown_s * rate.average_fps if reader.shown_s else count
        flip = ("Y" if reader.clockwise_deg % 180 == 0 else "X") if reader.is_mirrored else ""
    frame_count = max(1, round(claimed)) if 0 < claimed < 1e9 else 1
    wanted = requested.at_rate(rate.usual_fps)
    if (
        wanted.start_s > 0
        and count > 0
        and wanted.start_s * rate.average_fps > frame_count + rate.usual_fps
    ):
        raise VideoError(
            f"{path} lasts {frame_count / float(rate.average_fps):.1f} s, but the start is at "
            f"{wanted.start_s:g} s; start earlier"
        )
    width, height = requested.view.size(first[1].shape[1], first[1].shape[0])
    fps = rate.usual_fps if wanted.fps is None else min(wanted.fps, rate.usual_fps)
    video = Video(path, width, height, fps, frame_count, focal_35mm(path), wanted=wanted, rate=rate)
    video.warnings += _rate_notices(path.name, rate)
    if flip:
        video.warnings.append(notice("mirrored", footage=path.name, axis=flip))
    if wanted.fps is not None:
        video.warnings += _sampling_notices(path.name, rate.usual_fps, wanted.fps)
    return video


def _stated_rate(path: Path, reader: PyavReader) -> StatedRate:
    """Return the rate of a file, counted in its packets where the container does not state it, or
    where it varies.
    """
    stated_fps = exact_fps(reader.rate)
    fps = stated_fps or DEFAULT_FPS
    average_fps = exact_fps(reader.average_rate) if reader.is_counted else None
    if stated_fps is None or average_fps is None or _varies(average_fps, fps):
        usual_fps, packets_fps = packet_rates(path, fps, reader.may_have_field_packets)
        average_fps = average_fps or packets_fps
        if stated_fps is None or _varies(average_fps, fps):
            fps = usual_fps
    if not _varies(average_fps, fps):
        average_fps = fps
    # Frames that an even rate would have and the file has not, or the reverse: a phone leaves some
    # out, also where its rate counts as constant.
    missing_frames = abs(float(fps) * (reader.shown_s or 0.0) - reader.frame_count)
    recorded_speed = reader.recorded_rate / float(fps)
    return StatedRate(
        fps,
        average_fps,
        is_even=reader.counts_frames_alone and missing_frames < _ONE_MISSING,
        is_counted=reader.is_counted,
        recorded_speed=recorded_speed if recorded_speed > _SLOW_MOTION else 1.0,
    )


def _rate_notices(footage: str, rate: StatedRate) -> list[Notice]:
    if not _varies(rate.average_fps, rate.usual_fps):
        return []
    found = notice(
        "variable_frame_rate",
        footage=footage,
        rate=float(rate.usual_fps),
        average=float(rate.average_fps),
    )
    return [found]


def _sampling_notices(footage: str, fps: Fraction, wanted_fps: Fraction) -> list[Notice]:
    """Say how frames of footage at a rate are not what was wanted."""
    found = []
    sampled_fps = min(wanted_fps, fps)
    even_fps = fps / round(fps / sampled_fps)
    rates = {"rate": float(fps), "wanted": float(wanted_fps)}
    if _varies(sampled_fps, even_fps):
        found.append(notice("uneven_frames", footage=footage, **rates, even=float(even_fps)))
    if wanted_fps > fps:
        found.append(notice("frame_rate_above_footage", footage=footage, **rates))
    return found


def _varies(average_fps: Fraction, fps: Fraction) -> bool:
    return abs(average_fps - fps) > _VARYING * fps


class _Decoder:
    """Decodes a video in its own thread into a bounded queue, so that decoding and inference
    overlap.
    """

    def __init__(self, video: Video) -> None:
        self._video = video
        self._queue: queue.Queue[Frame | BaseException | None] = queue.Queue(_QUEUED_FRAMES)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="scope-decode", daemon=True)
        self._thread.start()

    def __iter__(self) -> Iterator[Frame]:
        while not self._stop.is_set():
            try:
                item = self._queue.get(timeout=0.1)
            except queue.Empty:
                continue
            if item is None:
                return
            if isinstance(item, BaseException):
                raise item
            yield item

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        if self in self._video._decoders:
            self._video._decoders.remove(self)

    def _put(self, item: Frame | BaseException | None) -> None:
        while not self._stop.is_set():
            try:
                self._queue.put(item, timeout=0.1)
                return
            except queue.Full:
                continue

    def _run(self) -> None:
        try:
            sequence = self._video._sequence
            source = (
                SequenceReader(sequence, self._video.fps)
                if sequence
                else PyavReader(self._video.path)
            )
            with closing(source) as reader:
                self._decode(reader)
            self._put(None)
        except Exception as error:  # raised again by the thread that iterates
            self._put(error)

    def _decode(self, reader: PyavReader | SequenceReader) -> None:
        video = self._video
        index = 0
        time: float | None = None
        sampler = FrameSampler(video.wanted.fps)
        resized = False
        if video.wanted.start_s > 0:
            # Indices have to be those of the whole footage, whichever part is chosen.
            is_even = video._is_part or video.rate is None or video.rate.is_even
            index, time = reader.skip_to(video.wanted.start_s, video.source_fps, is_even)
        while not self._stop.is_set() and (decoded := reader.read()) is not None:
            time = next_time(time, decoded[0], float(1 / video.source_fps))
            image = video.wanted.view.show(decoded[1])
            if time > video.wanted.end_s + _SAME_S:
                break
            if image.shape[:2] != (video.height, video.width):
                image = cast(Uint8Array, cv2.resize(image, (video.width, video.height)))
                resized = True
            for frame in sampler.add(Frame(index, time, image)):
                self._put(frame)
            index += 1
        for frame in sampler.flush():
            self._put(frame)
        if self._stop.is_set():
            return
        if resized:
            self._warn(notice("frame_size_changes", footage=video.path.name))
        self._warn_of_end(index, time or 0.0)

    def _warn_of_end(self, index: int, time: float) -> None:
        """Warn if the file ended early, or was still being written.

        :param index: of the frame that would have come next.
        :raises VideoError: it ended early because the disk or the server does not give it.
        """
        video = self._video
        if self._ended_early(index, time):
            if video._bytes is not None:
                _check_readable(video.path)
            self._warn(
                notice(
                    "decoding_stopped",
                    footage=video.path.name,
                    decoded=index,
                    total=video.frame_count,
                )
            )
        if time <= video.wanted.end_s and self._has_grown():
            self._warn(notice("growing_file", footage=video.path.name))

    def _ended_early(self, index: int, time: float) -> bool:
        """Return whether a frame of the range was left out at its end; see `_warn_of_end`."""
        video = self._video
        if video._sequence is not None:  # whose pictures are counted
            return (
                index < video.frame_count
                and video._sequence.time(index, video.fps) <= video.wanted.end_s + _SAME_S
            )
        # Both tests: a container that counts frames from its duration is wrong for a variable frame
        # rate.
        missing = video.frame_count - index
        last = min(float((video.frame_count - 1) / video.average_fps), video.wanted.end_s)
        if video.rate is not None and video.rate.is_counted and last - time > _LOST_S:
            return missing > 1
        return missing > max(1, video.frame_count // 50) and time < 0.95 * last

    def _has_grown(self) -> bool:
        """Return whether the file is still being written, as .mkv and .ts files are by
        recorders.
        """
        try:
            return (
                self._video._bytes is not None
                and self._video.path.stat().st_size > self._video._bytes
            )
        except OSError:  # removed, or a network folder that is gone: everything was read
            return False

    def _warn(self, warning: Notice) -> None:
        if warning not in self._video.warnings:
            self._video.warnings.append(warning)


def _check_readable(path: Path) -> None:
    """Read a file to its end, because FFmpeg reports a disk or server that fails as it reports
    damaged data, and a capture of a part would count as finished.

    :raises VideoError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            while file.read(_PIECE_BYTES):
                pass
    except OSError as error:
        raise unreadable(path, error) from error


@contextmanager
def opencv_in_one_thread() -> Iterator[None]:
    """Leave the cores to stages and networks that run in parallel; OpenCV's threads would wait for
    one another.
    """
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)
