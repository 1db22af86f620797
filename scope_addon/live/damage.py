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

A picture all of whose packets were lost is replaced by the one before, and FFmpeg says nothing of
that, or of all those that build on it. But every picture of H.264 has a ``frame_num``: it grows by
one after a picture on which others build, and gaps in it are losses, unless the stream announces
them or has them all the time, as of an encoder that counts otherwise.

Source: ITU-T H.264, 7.3.1 and 7.3.2.1 (NAL units, sequence parameter sets), 7.3.3 (slice headers),
7.4.3 (frame_num).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import islice
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import av

_ANNOUNCED = 2  # packets from the one that is called corrupt to the first one after the loss
# nal_unit_type
_SLICE = 1
_IDR_SLICE = 5
_PARAMETERS = 7
_BUILT_ON = 0x60  # nal_ref_idc in the first byte, not zero where other pictures build on this one
_MAX_UNITS = 64  # of a packet that are looked at; one has some parameters and slices
_HEAD_BYTES = 64  # of a slice, more than what comes before its frame_num
# pictures, and gaps among them from which these are no losses
_RECENT = 16
_MANY = 8
_PARAMETER_BYTES = 1024  # of a sequence parameter set, which may have scaling lists
# profile_idc of those whose parameters tell more of colours and scaling.
_HIGH_PROFILES = (100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135)


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


class FrameNumbers:
    """Follows the numbers of a stream's pictures.

    :param extradata: of the stream: in .mp4 and alike, the parameters and how the length of a NAL
        unit is stored.
    """

    def __init__(self, extradata: bytes | None = None) -> None:
        self._length_bytes = 0  # of a NAL unit's length; 0: they begin with a start code instead
        self._bits: int | None = None  # of frame_num; None before they are known
        self._has_planes = self._may_miss = False
        self._last: int | None = None  # of the last picture on which others build
        self._gaps: deque[bool] = deque(maxlen=_RECENT)  # of the last pictures
        data = extradata or b""
        if data[:1] == b"\x01" and len(data) > 6:
            self._length_bytes = (data[4] & 3) + 1
            self._read_parameters(data[8:])
        else:
            self.has_gap(data)

    def has_gap(self, data: bytes) -> bool:
        """Note a packet, and return whether pictures are missing before that of the packet."""
        for unit in islice(self._units(data), _MAX_UNITS):
            kind = unit[0] & 31
            if kind == _PARAMETERS:
                self._read_parameters(unit)
            elif kind in (_SLICE, _IDR_SLICE) and self._bits is not None:
                return self._is_gap(unit, begins=kind == _IDR_SLICE)
        return False

    def has_picture(self, data: bytes) -> bool:
        """Return whether a packet contains a picture, or part of one, rather than parameters
        alone.
        """
        return any(
            unit[0] & 31 in (_SLICE, _IDR_SLICE) for unit in islice(self._units(data), _MAX_UNITS)
        )

    def _is_gap(self, unit: bytes, *, begins: bool) -> bool:
        assert self._bits is not None
        bits = _Bits(unit[1:_HEAD_BYTES])
        try:
            for _ in ("first_mb_in_slice", "slice_type", "pic_parameter_set_id"):
                bits.exp_golomb()
            bits.take(2 if self._has_planes else 0)
            number = bits.take(self._bits)
        except IndexError:
            return False
        last = self._last
        following = 1 << self._bits
        is_gap = last is not None and number not in (last, (last + 1) % following)
        if unit[0] & _BUILT_ON:
            self._last = number
        elif is_gap or last is None:
            self._last = (number - 1) % following
        if begins or last is None or self._may_miss:
            return False
        self._gaps.append(is_gap)
        return is_gap and not (len(self._gaps) == _RECENT and sum(self._gaps) >= _MANY)

    def _units(self, data: bytes) -> Iterator[bytes]:
        """Yield the beginnings of NAL units, up to the first slice at least."""
        if self._length_bytes:
            at = 0
            while (start := at + self._length_bytes) < len(data):
                at = start + max(int.from_bytes(data[at:start], "big"), 1)
                yield data[start:at]
            return
        at = data.find(b"\x00\x00\x01")
        while 0 <= at < len(data) - 3:
            following = data.find(b"\x00\x00\x01", at + 3)
            if following != at + 3:  # an empty one has no type
                yield data[at + 3 : following if following >= 0 else None]
            at = following

    def _read_parameters(self, unit: bytes) -> None:
        """Read a sequence parameter set, as far as it is needed; a damaged one changes nothing."""
        if len(unit) < 4:
            return
        bits = _Bits(unit[4:_PARAMETER_BYTES])
        try:
            bits.exp_golomb()  # seq_parameter_set_id
            has_planes = False
            if unit[1] in _HIGH_PROFILES:
                has_planes = _skip_colours(bits)
            number_bits = bits.exp_golomb() + 4
            _skip_order(bits)
            bits.exp_golomb()  # max_num_ref_frames
            may_miss = bits.take(1) == 1
        except IndexError:
            return
        if number_bits <= 16:
            self._bits = number_bits
            self._has_planes = has_planes
            self._may_miss = may_miss


def _skip_colours(bits: _Bits) -> bool:
    """Skip what a high profile says of colours and scaling; return whether colours are separate
    pictures.
    """
    is_444 = bits.exp_golomb() == 3
    has_planes = is_444 and bits.take(1) == 1
    bits.exp_golomb()  # bit_depth_luma_minus8
    bits.exp_golomb()  # bit_depth_chroma_minus8
    bits.take(1)  # qpprime_y_zero_transform_bypass_flag
    if bits.take(1):  # seq_scaling_matrix_present_flag
        for k in range(12 if is_444 else 8):
            if bits.take(1):
                _skip_scaling_list(bits, 16 if k < 6 else 64)
    return has_planes


def _skip_scaling_list(bits: _Bits, size: int) -> None:
    last = 8
    following = 8
    for _ in range(size):
        if following:
            following = (last + bits.signed_exp_golomb()) % 256
        last = following or last


def _skip_order(bits: _Bits) -> None:
    """Skip how the order of pictures is coded."""
    kind = bits.exp_golomb()  # pic_order_cnt_type
    if kind == 0:
        bits.exp_golomb()  # log2_max_pic_order_cnt_lsb_minus4
    elif kind == 1:
        bits.take(1)  # delta_pic_order_always_zero_flag
        bits.exp_golomb()  # offset_for_non_ref_pic
        bits.exp_golomb()  # offset_for_top_to_bottom_field
        for _ in range(bits.exp_golomb()):
            bits.exp_golomb()


class _Bits:
    """Reads bits of a NAL unit, without the bytes that keep start codes from appearing in it.

    Reading beyond the end is an IndexError.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data.replace(b"\x00\x00\x03", b"\x00\x00")
        self._at = 0

    def take(self, count: int) -> int:
        """Return the next bits as a number."""
        value = 0
        for _ in range(count):
            value = value << 1 | self._data[self._at >> 3] >> (7 - (self._at & 7)) & 1
            self._at += 1
        return value

    def exp_golomb(self) -> int:
        """Return the next number, 0 or more, in Exp-Golomb code."""
        zeros = 0
        while self.take(1) == 0:
            zeros += 1
        return (1 << zeros) - 1 + self.take(zeros)

    def signed_exp_golomb(self) -> int:
        """Return the next signed number in Exp-Golomb code."""
        value = self.exp_golomb()
        return (value + 1) // 2 if value % 2 else -(value // 2)
