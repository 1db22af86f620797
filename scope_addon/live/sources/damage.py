# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pictures of a stream show what the camera saw: none that lost packets, and none that build
on such a picture.

Most pictures say only what has changed since those before. When one of them is lost or damaged, all
later ones are wrong where somebody moves, until the next key frame, which needs no other picture.

FFmpeg says which pictures it has concealed in part, but not which ones build on them. Pictures of
which nothing came are known by the numbers of the others in H.264; FFmpeg's decoder of H.265 knows
them, and gives no picture that builds on one. For all codecs but H.264, the demultiplexer of
transport streams tells of lost packets: it calls the picture corrupt that ended two pictures before
the first one after the loss. The one between may be damaged or not, and streams that were joined
look the same, but continue with a key frame.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .h264_headers import FrameNumbers

if TYPE_CHECKING:
    import av

_ANNOUNCED = 2  # packets from the one that is called corrupt to the first one after the loss


class Damage:
    """Follows the packets of a stream, in order, and the pictures that are decoded from them.

    :param codec: FFmpeg's name of it.
    :param extradata: of the stream.
    """

    def __init__(self, codec: str, extradata: bytes | None) -> None:
        self._numbers = FrameNumbers(extradata) if codec == "h264" else None
        self._hides_them = codec == "hevc"
        self._until_loss = 0  # packets; 0: none is announced
        self._waiting = 0  # packets of which no picture has come yet
        # Pictures that the decoder keeps, to put them in order; None before the first one.
        self._delay: int | None = None
        self.is_broken = False  # what is decoded now builds on a damaged picture
        self._has_key = False

    def observe(self, packet: av.Packet[Any]) -> None:
        """Note a packet that is going to be decoded."""
        if self._numbers is not None:
            if self._numbers.has_gap(bytes(packet)):
                self._break()
        elif packet.is_keyframe:
            self._until_loss = 0
        elif self._until_loss:
            self._until_loss -= 1
            if not self._until_loss:
                self._break()
        if packet.is_corrupt and not self._until_loss and self._numbers is None:
            self._until_loss = _ANNOUNCED
        self._has_key = self._has_key or packet.is_keyframe

    def fail(self, packet: av.Packet[Any]) -> bool:
        """Note that a packet could not be decoded; return whether a picture is missing
        therefore.
        """
        if self._numbers is not None and not self._numbers.has_picture(bytes(packet)):
            return False
        self._break()
        return True

    @property
    def is_doubtful(self) -> bool:
        """Whether only the next packet tells if the pictures of this one are damaged."""
        return self._until_loss == 1

    def is_hidden(self, frames: list[av.VideoFrame]) -> bool:
        """Return whether the decoder has left out a damaged picture itself, from what it gives for
        a packet.
        """
        self._waiting += 1 - len(frames)
        if frames and self._delay is None:
            self._delay = self._waiting
        if not self._hides_them or self._delay is None or self._waiting <= self._delay:
            return False
        self._waiting -= 1  # it never comes
        return True

    def is_in(self, frame: av.VideoFrame) -> bool:
        """Return whether a picture is damaged."""
        from av.video.frame import PictureType

        if frame.is_corrupt:
            self._break()
        elif (
            self._has_key
            and frame.key_frame
            and frame.pict_type in (PictureType.I, PictureType.NONE)
        ):
            self.is_broken = False
        return self.is_broken

    def _break(self) -> None:
        self.is_broken = True
        self._has_key = False
