# SPDX-License-Identifier: GPL-3.0-or-later
"""A stream from the network, read by FFmpeg."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Uint8Array
from ..capture.media.frame_readers import orientation, rgb, upright
from ..capture.media.guards import check_size
from ..errors import VideoError
from ..footage import display_address
from ..notices import Notice
from .damage import Damage
from .source import LEAP_S, Clock, Picture, Playback, Source

if TYPE_CHECKING:
    import av
    from av.container import InputContainer
    from av.video.stream import VideoStream

SCHEMES = ("http", "https", "rtsp", "rtsps", "rtmp", "rtmps", "srt", "udp", "rtp", "tcp")
# What a stream may open in turn, such as the segments of a playlist: never a file of this computer.
_PROTOCOLS = "http,https,httpproxy,tcp,tls,udp,rtp,rtmp,rtmps,rtsp,rtsps,srt,srtp,crypto"
_FORMATS = (
    "rtsp,rtp,sdp,mpjpeg,mjpeg,jpeg_pipe,hls,dash,flv,live_flv,mpegts,mpeg,mov,matroska,webm,"
    "avi,h264,hevc,m4v,ogg,asf,"
    "nut"
)
# whose pieces come whole, long after they were filmed
_PLAYLISTS = ("hls", "dash")
_NO_TIMESTAMPS = 0x80  # FFmpeg's AVFMT_NOTIMESTAMPS, of formats whose times it makes up
STALLED_S = 5.0  # without data, after which a stream counts as interrupted
# for which a stream that is joined in the middle is left out until its next key frame
KEY_FRAME_S = 10.0
# for which damaged pictures are left out, as key frames of most cameras are not farther apart
DAMAGED_S = 4.0
# without a picture, after which a stream counts as interrupted
UNREADABLE_S = KEY_FRAME_S + STALLED_S


class StreamSource(Source):
    """A stream from the network."""

    def __init__(self, url: str) -> None:
        self._url = url
        self.name = display_address(url)
        self.warnings: list[Notice] = []

    def pictures(self, clock: Clock) -> Iterator[Picture | None]:
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
            if stream.codec_context.name == "h264":  # in several threads, it does not notice damage
                stream.codec_context.thread_count = 1
            if stream.average_rate and 1 <= stream.average_rate <= 240:
                self.fps = Fraction(stream.average_rate)
            is_fetched = _is_fetched(container)
            has_times = not container.format.flags & _NO_TIMESTAMPS
            playback = Playback(clock)
            sent = SentTimes()
            last_s = -np.inf
            try:
                index = 0
                for frame in self._frames(container, stream, clock):
                    if frame is None:
                        yield None
                        continue
                    image_rgb = self._image(frame, float(stream.sample_aspect_ratio or 1))
                    arrived_s = clock.now()
                    filmed_s = sent.at(frame.time if has_times else None, arrived_s)
                    # what is sent while it is filmed comes when it is to be shown
                    if is_fetched and frame.time is not None:
                        if not 0.0 <= frame.time - last_s <= LEAP_S:  # another programme begins
                            playback = Playback(clock)
                        last_s = frame.time
                        filmed_s = arrived_s = playback.wait(last_s)
                    yield Picture(index, filmed_s, arrived_s, image_rgb)
                    index += 1
            except (av.error.FFmpegError, OSError, ValueError) as error:
                raise VideoError(f"{self.name} was interrupted ({_reason(error)})") from error

    def _frames(
        self, container: InputContainer, stream: VideoStream, clock: Clock
    ) -> Iterator[av.VideoFrame | None]:
        """Yield what can be decoded, from the first key frame on; None for a frame that is damaged
        and left out.

        Frames before it continue pictures that never came, and some decoders show them on grey.

        :raises VideoError: nothing could be decoded for a while.
        """
        import av

        has_begun = False
        began_s = clock.now()
        seen_s = began_s
        damaged_s: float | None = None  # since when pictures have been damaged
        damage = Damage(stream.codec_context.name, stream.codec_context.extradata)
        held: list[av.VideoFrame] = []  # until it is known whether they are damaged
        for packet in container.demux(stream):
            now_s = clock.now()
            # streams may have none
            has_begun = has_begun or packet.is_keyframe or now_s - began_s > KEY_FRAME_S
            frames: list[av.VideoFrame] = []
            if has_begun:
                damage.observe(packet)
                yield from [None if damage.is_broken else frame for frame in held]
                held = []
                try:
                    frames = packet.decode()
                    is_missing = damage.is_hidden(frames) and packet.dts is not None
                except av.error.InvalidDataError:
                    is_missing = damage.fail(packet)
                if is_missing:
                    yield None
            if frames:
                seen_s = now_s
            elif now_s - seen_s > UNREADABLE_S:
                raise VideoError(
                    f"{self.name} was interrupted (no image could be decoded for "
                    f"{UNREADABLE_S:g} s)"
                )
            for frame in frames:
                is_intact = not damage.is_in(frame)
                damaged_s = None if is_intact else now_s if damaged_s is None else damaged_s
                if is_intact and damage.is_doubtful:
                    held.append(frame)
                else:
                    yield frame if damaged_s is None or now_s - damaged_s > DAMAGED_S else None

    def _open(self) -> InputContainer:
        import av

        options = {"protocol_whitelist": _PROTOCOLS, "format_whitelist": _FORMATS}
        # Without FFmpeg's "nobuffer", which throws away packets that define the format: the first
        # key frame, too.
        options |= {"flags": "low_delay", "probesize": "500000", "analyzeduration": "1000000"}
        if self._url.startswith("rtsp"):
            options["rtsp_transport"] = "tcp"
        try:
            return av.open(
                self._url,
                options=options,
                container_options=options,
                timeout=(STALLED_S, STALLED_S),
                mode="r",
            )
        except (av.error.FFmpegError, OSError, ValueError) as error:
            raise VideoError(
                f"{self.name} cannot be opened ({_reason(error)}); check the address, and whether "
                "its server runs"
            ) from error

    def _image(self, frame: av.VideoFrame, aspect: float) -> Uint8Array:
        """Return the frame as it is to be shown; phones send what they film upright as rotated, and
        may mirror it.
        """
        check_size(Path(self.name), frame.width, frame.height)
        return upright(Path(self.name), rgb(frame), aspect, *orientation(frame))


class SentTimes:
    """When the frames of a stream were filmed, by the clock and up to a constant: a relay sends
    several at once, and a network delays some, which their own times do not show.

    Times that go away from the clock by more than `KEY_FRAME_S`, as those of a sender that counts
    them wrongly, are not used any more: what comes at once is hardly longer. From there on, it is
    when frames arrive, by the same constant, so that no time is left out or comes twice.
    """

    def __init__(self) -> None:
        self._offset_s = 0.0  # of the clock
        self._ahead_s = 0.0  # of the last frame, of when it arrived
        self._last_s = -np.inf
        self._are_wrong = False

    def at(self, time_s: float | None, arrived_s: float) -> float:
        """Return when the next frame was filmed, or without usable times when it arrived.

        :param time_s: its own time; None if it has none.
        """
        if time_s is None or self._are_wrong:
            return arrived_s + self._ahead_s
        if not 0.0 < time_s - self._last_s <= LEAP_S:  # another programme begins
            self._offset_s = arrived_s - time_s
        self._last_s = time_s
        ahead_s = self._offset_s + time_s - arrived_s
        self._are_wrong = abs(ahead_s) > KEY_FRAME_S
        if not self._are_wrong:
            self._ahead_s = ahead_s
        return arrived_s + self._ahead_s


def _is_fetched(container: InputContainer) -> bool:
    """Return whether a stream comes as fast as it can be read, like a file, and has times."""
    has_times = not container.format.flags & _NO_TIMESTAMPS
    return has_times and (container.format.name in _PLAYLISTS or container.size > 0)


def _reason(error: Exception) -> str:
    text = str(getattr(error, "strerror", None) or error).lower()
    # as FFmpeg calls a timeout
    return f"nothing came for {STALLED_S:g} s" if "immediate exit" in text else text
