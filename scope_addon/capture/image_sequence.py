# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbered pictures as a video: a folder, a pattern (walk_####.png, walk_%04d.png), or the first one with a rate."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from ...solver.errors import VideoError
from ..footage import LAST_NUMBER, PICTURE_SUFFIXES, is_sequence, pictures_in, sequence_pattern

_NUMBER_SIGN = re.compile(r"#+|%0?\d*d")


def find_pictures(path: Path, rate_given: bool) -> list[Path]:
    """The pictures of a sequence in order of their numbers; empty where the path is no sequence.

    A folder or a pattern is one. A single picture stands for itself, unless a rate is given and others follow it.

    :raises VideoError: a folder's pictures differ in more than their last number.
    """
    if path.is_dir():
        found = pictures_in(path)
        if len(found) > 1 and not is_sequence(found):
            kinds = {sequence_pattern(p): p.name for p in reversed(found)}
            raise VideoError(
                f"{path} holds pictures that are no numbered sequence ({', '.join(sorted(kinds.values())[:3])}, …); "
                "give the pattern of the one that is meant, such as walk_####.png, or a single picture"
            )
        return found
    sign = _NUMBER_SIGN.search(path.name)
    if sign and not path.exists() and path.parent.is_dir():
        return _matching(path.parent, path.name[: sign.start()], path.name[sign.end() :], first=0)
    number = LAST_NUMBER.search(path.stem)
    if rate_given and number and path.is_file() and cv2.haveImageReader(str(path)):
        before, after = path.stem[: number.start()], path.stem[number.end() :] + path.suffix
        found = _matching(path.parent, before, after, first=int(number.group()))
        return found if len(found) > 1 else []
    return []


class PictureReader:
    """The pictures one after the other, as ``video`` reads a file: ``read``, ``skip_to``, ``close``."""

    def __init__(self, pictures: list[Path], fps: Fraction) -> None:
        self._pictures, self._fps, self._next = pictures, fps, 0

    def read(self) -> tuple[float, np.ndarray] | None:
        """Next picture: seconds and RGB; None after the last one, or where one cannot be decoded."""
        if self._next >= len(self._pictures):
            return None
        data = np.frombuffer(self._pictures[self._next].read_bytes(), np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
        if image is None:
            return None
        time = float(self._next / self._fps)
        self._next += 1
        return time, cv2.cvtColor(image, cv2.COLOR_BGR2RGB)

    def skip_to(self, seconds: float, fps: Fraction) -> int:
        """Go to the first picture at or after that time; returns its index."""
        while self._next < len(self._pictures) and float(self._next / fps) < seconds - 1e-6:
            self._next += 1
        return self._next

    def close(self) -> None:
        """Nothing is open between two pictures."""


def _matching(folder: Path, before: str, after: str, first: int) -> list[Path]:
    name = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
    numbered = [(int(m.group(1)), p) for p in folder.iterdir() if (m := name.fullmatch(p.name))]
    return [p for number, p in sorted(numbered) if number >= first and p.suffix.lower() in PICTURE_SUFFIXES]
