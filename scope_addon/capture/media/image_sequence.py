# SPDX-License-Identifier: GPL-3.0-or-later
"""Image sequences as footage: a folder, a pattern (walk_####.png, walk_%04d.png), or the first
picture and a rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from ...arrays import Uint8Array
from ...errors import VideoError
from ...footage import (
    LAST_NUMBER,
    NUMBER_SIGN,
    is_sequence,
    numbered,
    numbered_from,
    numbered_places,
    picture_slots,
    pictures_in,
    sequence_pattern,
)
from ...notices import Notice, notice
from .still_images import read_picture


@dataclass(frozen=True)
class PictureSequence:
    """Numbered pictures in order: picture k is shown at ``slots[k]`` / fps seconds; see
    `picture_slots`.
    """

    paths: list[Path]
    slots: list[int]
    warnings: list[Notice]

    @classmethod
    def from_numbers(cls, paths: list[Path], numbers: list[int], name: str) -> PictureSequence:
        """Derive the slots from the numbers of the pictures.

        :param paths: pictures, ordered by their numbers.
        :param numbers: of each.
        :param name: of the sequence, for warnings.
        """
        slots = picture_slots(numbers)
        places = numbered_places(numbers)
        missing = places[-1] + 1 - len(paths)
        leaves_gaps = missing > 0 and slots == places
        if not missing:  # but the numbers may be in constant steps
            missing = numbers[-1] + 1 - numbers[0] - len(paths)
        if missing <= 0:
            return cls(paths, slots, [])
        warning = notice(
            "missing_images" if leaves_gaps else "consecutive_images",
            footage=name,
            missing=missing,
            first=numbers[0],
            last=numbers[-1],
        )
        return cls(paths, slots, [warning])

    def time(self, index: int, fps: Fraction) -> float:
        """Calculate at how many seconds a picture is shown."""
        return float(self.slots[index] / fps)


def find_sequence(path: Path, rate_given: bool) -> PictureSequence | None:
    """Find the pictures of a sequence; None if the path is not a sequence.

    A folder of pictures or a pattern is a sequence. A single picture is one only if a rate is given
    and numbered pictures follow it.

    :raises VideoError: a folder's pictures differ in more than their last number.
    """
    found: list[Path] = []
    numbers: list[int] = []
    if path.is_dir():
        found = pictures_in(path)
        if len(found) > 1 and not is_sequence(found):
            kinds = {sequence_pattern(p): p.name for p in reversed(found)}
            raise VideoError(
                f"{path} contains images that do not form one numbered sequence "
                f"({', '.join(sorted(kinds.values())[:3])}, …); "
                "give the pattern you mean, such as walk_####.png, or a single image"
            )
    elif (sign := NUMBER_SIGN.search(path.name)) and not path.exists() and path.parent.is_dir():
        after = path.name[sign.end() :]
        found = numbered(path.parent, path.name[: sign.start()], after)
        numbers = [int(p.name[sign.start() :].removesuffix(after)) for p in found]
    elif rate_given and path.is_file():
        following = numbered_from(path)
        found = following if len(following) > 1 else []
    if not found:
        return None
    return PictureSequence.from_numbers(found, numbers or _last_numbers(found), path.name)


def _last_numbers(paths: list[Path]) -> list[int]:
    """Return the last number of each file name, 0 where there is none."""
    found = [LAST_NUMBER.search(path.stem) for path in paths]
    return [int(match.group()) if match else 0 for match in found]


class SequenceReader:
    """Reads the pictures in order, with the interface of `PyavReader` that decoding needs."""

    def __init__(self, sequence: PictureSequence, fps: Fraction) -> None:
        self._sequence = sequence
        self._fps = fps
        self._next = 0

    def read(self) -> tuple[float, Uint8Array] | None:
        """Read the next picture.

        :return: time in seconds and the upright image (H, W, 3) uint8 RGB; None after the last one,
            or if the picture cannot be decoded.
        """
        if self._next >= len(self._sequence.paths):
            return None
        picture = read_picture(self._sequence.paths[self._next])
        if picture is None:
            return None
        time = self._sequence.time(self._next, self._fps)
        self._next += 1
        return time, picture.rgb

    def skip_to(self, seconds: float, fps: Fraction, is_even: bool = True) -> tuple[int, None]:
        """Skip to the first picture at or after a time, and return its index, which is exact."""
        while (
            self._next < len(self._sequence.paths)
            and self._sequence.time(self._next, fps) < seconds - 1e-6
        ):
            self._next += 1
        return self._next, None

    def close(self) -> None:
        """Do nothing: no file is open between two pictures."""
