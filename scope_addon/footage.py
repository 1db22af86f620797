# SPDX-License-Identifier: GPL-3.0-or-later
"""Which files are footage, by their names. Imports nothing of ours, so that menus and command lines can ask."""

import re
from pathlib import Path

VIDEO_SUFFIXES = (
    *(".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".wmv", ".mts", ".m2ts", ".ts", ".3gp", ".gif"),
)
PICTURE_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".bmp", ".avif", ".heic", ".heif")
FOOTAGE_SUFFIXES = VIDEO_SUFFIXES + PICTURE_SUFFIXES
LAST_NUMBER = re.compile(r"(\d+)(?!.*\d)")


def sequence_pattern(picture: Path) -> str:
    """The name of a picture but for its last number: the same for all pictures of one numbered sequence."""
    return LAST_NUMBER.sub("#", picture.stem) + picture.suffix.lower()


def pictures_in(folder: Path) -> list[Path]:
    """The pictures in a folder, frame 10 after frame 9."""
    found = [p for p in folder.iterdir() if p.suffix.lower() in PICTURE_SUFFIXES and not p.name.startswith(".")]
    return sorted((p for p in found if p.is_file()), key=_in_order)


def is_sequence(pictures: list[Path]) -> bool:
    """Whether pictures of a folder are a numbered sequence: several, whose names differ in their last number alone."""
    return len(pictures) > 1 and len({sequence_pattern(p) for p in pictures}) == 1


def numbered(folder: Path, before: str, after: str, first: int = 0) -> list[Path]:
    """The pictures in a folder whose names are a number from ``first`` on between these, in its order."""
    name = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
    found = [(int(m.group(1)), p) for p in folder.iterdir() if (m := name.fullmatch(p.name))]
    return [p for number, p in sorted(found) if number >= first and p.suffix.lower() in PICTURE_SUFFIXES]


def numbered_from(first: Path) -> list[Path]:
    """A picture and those of the same name but for a higher last number; nothing where it has no number."""
    number = LAST_NUMBER.search(first.stem)
    if number is None:
        return []
    before, after = first.stem[: number.start()], first.stem[number.end() :] + first.suffix
    return numbered(first.parent, before, after, int(number.group()))


def _in_order(path: Path) -> list[tuple[int, int, str]]:
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", path.name)]
