# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbered pictures as a video: a folder, a pattern (walk_####.png, walk_%04d.png), or the first one with a rate."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from ...errors import VideoError
from ...footage import LAST_NUMBER, is_sequence, numbered, numbered_from, pictures_in, sequence_pattern
from .still_images import read_picture

_NUMBER_SIGN = re.compile(r"#+|%0?\d*d")


@dataclass(frozen=True)
class PictureSequence:
    """Numbered pictures in order, and the place of each in time: picture k is shown at ``places[k]`` / fps seconds.

    Places follow from the numbers, so that time goes on where pictures are missing; numbers in steps of ten are taken
    for ones in steps of one. Where more than half are missing the numbers count something else, and are only an order.
    """

    paths: list[Path]
    places: list[int]
    warnings: list[str]

    @classmethod
    def of(cls, paths: list[Path], name: str) -> PictureSequence:
        """Of pictures in order of their last numbers; ``name`` is what warnings call them."""
        found = [LAST_NUMBER.search(path.stem) for path in paths]
        numbers = [int(match.group()) if match else 0 for match in found]
        step = math.gcd(*(number - numbers[0] for number in numbers)) or 1
        places = [(number - numbers[0]) // step for number in numbers]
        missing = places[-1] + 1 - len(paths)
        if missing <= 0:
            return cls(paths, places, [])
        between = f"{name}: {missing} numbers between {numbers[0]} and {numbers[-1]} have no picture"
        if 2 * missing > places[-1] + 1:
            return cls(paths, list(range(len(paths))), [f"{between}, so the pictures were taken one after the other"])
        return cls(paths, places, [f"{between}; the time that they would take is left for them"])

    def time(self, index: int, fps: Fraction) -> float:
        """Seconds at which a picture is shown."""
        return float(self.places[index] / fps)


def find_sequence(path: Path, rate_given: bool) -> PictureSequence | None:
    """The pictures of a sequence; None where the path is no sequence.

    A folder or a pattern is one. A single picture stands for itself, unless a rate is given and others follow it.

    :raises VideoError: a folder's pictures differ in more than their last number.
    """
    found: list[Path] = []
    if path.is_dir():
        found = pictures_in(path)
        if len(found) > 1 and not is_sequence(found):
            kinds = {sequence_pattern(p): p.name for p in reversed(found)}
            raise VideoError(
                f"{path} holds pictures that are no numbered sequence ({', '.join(sorted(kinds.values())[:3])}, …); "
                "give the pattern of the one that is meant, such as walk_####.png, or a single picture"
            )
    elif (sign := _NUMBER_SIGN.search(path.name)) and not path.exists() and path.parent.is_dir():
        found = numbered(path.parent, path.name[: sign.start()], path.name[sign.end() :])
    elif rate_given and path.is_file():
        following = numbered_from(path)
        found = following if len(following) > 1 else []
    return PictureSequence.of(found, path.name) if found else None


class SequenceReader:
    """The pictures one after the other, as ``video`` reads a file: ``read``, ``skip_to``, ``close``."""

    def __init__(self, sequence: PictureSequence, fps: Fraction) -> None:
        self._sequence, self._fps, self._next = sequence, fps, 0

    def read(self) -> tuple[float, np.ndarray] | None:
        """Next picture: seconds and RGB; None after the last one, or where one cannot be decoded."""
        if self._next >= len(self._sequence.paths):
            return None
        picture = read_picture(self._sequence.paths[self._next])
        if picture is None:
            return None
        time = self._sequence.time(self._next, self._fps)
        self._next += 1
        return time, picture.rgb

    def skip_to(self, seconds: float, fps: Fraction) -> int:
        """Go to the first picture at or after that time; returns its index."""
        while self._next < len(self._sequence.paths) and self._sequence.time(self._next, fps) < seconds - 1e-6:
            self._next += 1
        return self._next

    def close(self) -> None:
        """Nothing is open between two pictures."""
