# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos and pictures as a sequence of upright RGB frames with square pixels and presentation timestamps.

    with open_video("dance.mp4") as video:
        for frame in video:            # decoded ahead in a thread, a few frames at most in memory
            frame.index, frame.timestamp_s, frame.image_rgb
    video.warnings                     # what the user should hear: stopped early, changed size, ...

``open_video("dance.mp4", VideoRange(start_s=60, end_s=90, fps=Fraction(25)))`` gives a part of it, or fewer frames;
index and time of each frame stay those of the whole video.

OpenCV says the frame rate as a float; ``video.fps`` is the rational the container meant (30000/1001, not 29.97003).
"""

from __future__ import annotations

import queue
import re
import stat
import threading
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from ...errors import VideoError
from .frame import Frame
from .frame_readers import FrameReader, open_reader, presented_s
from .image_sequence import PictureSequence, SequenceReader, find_sequence
from .quicktime import focal_35mm
from .still_images import is_picture, read_picture
from .video_range import FootageRange, VideoRange

cv2.setLogLevel(0)  # silent: failures are reported by exception, in one sentence

STILL_FPS = Fraction(30)  # a picture has no rate; one frame of the commonest does no harm in a scene
_AHEAD = 4  # decoded frames waiting: a 4K frame takes 25 MB
_STANDARD_RATES = [Fraction(n) for n in (24, 25, 30, 48, 50, 60, 120, 240)]
_STANDARD_RATES += [Fraction(n * 1000, 1001) for n in (24, 30, 48, 60, 120, 240)]


@dataclass
class Video:
    """Footage that was opened and whose first frame was decoded. Each iteration starts at the first frame of the range.

    ``frame_count`` is what the container claims of the whole and may be wrong; ``expected_frames`` is what follows
    from it for the range. ``fps`` is of the frames that come out, ``source_fps`` of those in the file. ``focal_35mm``
    is in mm on a 36 × 24 mm frame.
    """

    path: Path
    width: int
    height: int
    fps: Fraction
    frame_count: int
    focal_35mm: float | None = None
    warnings: list[str] = field(default_factory=list)
    wanted: VideoRange = field(default_factory=VideoRange)
    _source_fps: Fraction | None = field(default=None, repr=False)
    _sequence: PictureSequence | None = field(default=None, repr=False)
    _still: np.ndarray | None = field(default=None, repr=False)
    _decoders: list[_Decoder] = field(default_factory=list, repr=False)

    @property
    def source_fps(self) -> Fraction:
        """Frame rate of the file."""
        return self._source_fps or self.fps

    @property
    def expected_frames(self) -> int:
        """How many frames an iteration gives, as far as the container is right."""
        if self._sequence is not None:
            times = [self._sequence.time(k, self.fps) for k in range(self.frame_count)]
            return max(1, sum(self.wanted.start_s - 1e-6 <= t <= self.wanted.end_s + 1e-6 for t in times))
        length = self.frame_count / self.source_fps
        start, end = Fraction(self.wanted.start_s), Fraction(min(self.wanted.end_s, float(length)))
        return max(1, round((min(end, length) - start) * self.fps))

    def __iter__(self) -> Iterator[Frame]:
        if self._still is not None:
            yield Frame(0, 0.0, self._still)
            return
        decoder = _Decoder(self)
        self._decoders.append(decoder)
        with closing(decoder):
            yield from decoder

    def close(self) -> None:
        """Stop every decoding thread of this video; an iteration under way ends."""
        while self._decoders:
            self._decoders.pop().close()

    def __enter__(self) -> Video:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_video(path: str | Path, wanted: FootageRange | None = None) -> Video:
    """Open a video or a picture (JPEG, HEIC, PNG, WebP, TIFF, ...; 16-bit and alpha too) and decode its first frame.

    Numbered pictures are a video as well (`image_sequence`); what is wanted then says their rate, else it is 30.

    :raises VideoError: it does not exist, is not a file, holds nothing that can be decoded, or ends before the range.
    """
    path = Path(path)
    wanted = wanted or VideoRange()
    sequence = find_sequence(path, wanted.fps is not None)
    if sequence:
        return _open_sequence(path, sequence, wanted)
    if path.is_dir():
        raise VideoError(
            f"{path} is a folder without a picture; give a video, a picture or a folder of pictures,"
            " or capture a folder of videos with scope batch"
        )
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):  # opening a pipe would wait for a writer
            raise VideoError(f"{path} is a pipe or a device, and footage is read from files; save it as one first")
        with path.open("rb"):
            pass
    except FileNotFoundError as error:
        web = re.match(r"\w{2,}:[/\\]", str(path))
        what = "download it first, because footage is read from files" if web else "check the path"
        raise VideoError(f"{path} does not exist; {what}") from error
    except OSError as error:
        raise VideoError(f"{path} cannot be read ({error.strerror}); check its permissions") from error
    if found.st_size == 0:
        raise VideoError(f"{path} is empty (0 bytes); export or download it again")
    return _open_still(path, wanted) if is_picture(path) else _open_moving(path, wanted)


def _open_sequence(path: Path, sequence: PictureSequence, asked: FootageRange) -> Video:
    fps = asked.fps or STILL_FPS
    wanted = asked.at_rate(fps)
    first = read_picture(sequence.paths[0])
    if first is None:
        raise _damaged(sequence.paths[0])
    height, width = first.rgb.shape[:2]
    count = len(sequence.paths)
    video = Video(path, width, height, fps, count, first.focal_35mm, wanted=replace(wanted, fps=None))
    video._sequence = sequence
    video.warnings += sequence.warnings
    if asked.fps is None and count > 1:
        video.warnings.append(
            f"{path.name}: pictures have no frame rate, so 30 a second were taken; another is said by --fps on the "
            "command line"
        )
    return video


def _open_still(path: Path, asked: FootageRange) -> Video:
    picture = read_picture(path)
    if picture is None:
        raise _damaged(path)
    height, width = picture.rgb.shape[:2]
    video = Video(path, width, height, STILL_FPS, 1, picture.focal_35mm, _still=picture.rgb)
    if asked != VideoRange():
        video.warnings.append(f"{path.name} is a single picture: a start, an end or a frame rate changes nothing")
    if picture.length > 1:
        video.warnings.append(
            f"{path.name} is an animation of {picture.length} pictures, of which the first alone was captured; "
            "convert it to an .mp4 or a .gif for all of them"
        )
    return video


def _damaged(picture: Path) -> VideoError:
    return VideoError(f"{picture} is a picture that cannot be decoded; it may be damaged, so export it again, as JPEG")


def _open_moving(path: Path, asked: FootageRange) -> Video:
    with closing(open_reader(path)) as reader:
        first = reader.read()
        if first is None:
            raise VideoError(f"{path} opens but no frame of it can be decoded; convert it to H.264 .mp4 and try again")
        fps = exact_fps(reader.rate) or _fps_from_timestamps(reader)
        count = reader.frame_count
    height, width = first[1].shape[:2]
    shown_s = presented_s(path)
    claimed = shown_s * fps if shown_s else count
    frame_count = max(1, round(claimed)) if 0 < claimed < 1e9 else 1
    wanted = asked.at_rate(fps)
    video = Video(path, width, height, fps, frame_count, focal_35mm(path), wanted=wanted)
    if wanted.start_s > 0 and count > 0 and wanted.start_s * fps > frame_count + fps:
        raise VideoError(
            f"{path} lasts {frame_count / float(fps):.1f} s, but the start is at {wanted.start_s:g} s; start earlier"
        )
    if wanted.fps is not None:
        video._source_fps = fps
        video.fps = min(wanted.fps, fps)
        if wanted.fps > fps:
            video.warnings.append(
                f"{path.name} has {float(fps):g} frames per second; {float(wanted.fps):g} would repeat some, "
                "so all were used once"
            )
    return video


def exact_fps(fps: float) -> Fraction | None:
    """The rational behind a float frame rate; None if it is no frame rate (0, NaN, a clock's 90000).

    A ratio of small numbers comes through a float unharmed and is taken as it is (30000/1001, 2997/100). A rate
    averaged over a file's duration is not such a ratio: it becomes the standard rate within 0.001 % if there is one.
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


def _fps_from_timestamps(reader: FrameReader) -> Fraction:
    """Rate from the first second or so of frames, for a container that does not say."""
    times: list[float] = []
    while len(times) < 30 and (got := reader.read()) is not None:
        times.append(got[0])
    steps = np.diff(times)
    steps = steps[steps > 0]
    return (exact_fps(round(1 / float(np.median(steps)), 2)) if len(steps) else None) or STILL_FPS


class _Decoder:
    """Decodes a video in a thread of its own into a bounded queue, so that decoding overlaps with inference."""

    def __init__(self, video: Video) -> None:
        self._video = video
        self._queue: queue.Queue[Frame | BaseException | None] = queue.Queue(_AHEAD)
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
            source = SequenceReader(sequence, self._video.fps) if sequence else open_reader(self._video.path)
            with closing(source) as reader:
                self._decode(reader)
            self._put(None)
        except Exception as error:  # carried to the thread that iterates, which raises it
            self._put(error)

    def _decode(self, reader: FrameReader | SequenceReader) -> None:
        video, index, time = self._video, 0, 0.0
        chooser = video.wanted.chooser()
        resized = False
        first = index = reader.skip_to(video.wanted.start_s, video.source_fps) if video.wanted.start_s > 0 else 0
        while not self._stop.is_set() and (got := reader.read()) is not None:
            # Some containers have no timestamps, others repeat one: time then goes on at the frame rate.
            time = got[0] if index == first or got[0] > time else time + float(1 / video.source_fps)
            image = got[1]
            if time > video.wanted.end_s + 1e-6:
                break
            if image.shape[:2] != (video.height, video.width):
                image, resized = cv2.resize(image, (video.width, video.height)), True
            for frame in chooser.choose(Frame(index, time, image)):
                self._put(frame)
            index += 1
        for frame in chooser.rest():
            self._put(frame)
        if self._stop.is_set():
            return
        if resized:
            self._warn(f"the picture size changes within {video.path.name}; all frames were scaled to the first")
        # Both tests: a container that counts frames from its duration is wrong for a variable frame rate.
        missing = video.frame_count - index
        last = min(float((video.frame_count - 1) / video.source_fps), video.wanted.end_s)
        if missing > max(1, video.frame_count // 50) and time < 0.95 * last:
            self._warn(
                f"decoding {video.path.name} stopped after {index} of about {video.frame_count} frames; "
                "the file may be damaged or incomplete"
            )

    def _warn(self, text: str) -> None:
        if text not in self._video.warnings:
            self._video.warnings.append(text)
