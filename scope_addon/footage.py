# SPDX-License-Identifier: GPL-3.0-or-later
"""Recognize footage by file names, and show these. Standard library only: menus and command lines
load it quickly.
"""

import math
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

VIDEO_SUFFIXES = (
    ".mp4",
    ".mov",
    ".m4v",
    ".avi",
    ".mkv",
    ".webm",
    ".mpg",
    ".mpeg",
    ".wmv",
    ".mts",
    ".m2ts",
    ".ts",
    ".3gp",
    ".gif",
)
PICTURE_SUFFIXES = (
    ".jpg",
    ".jpeg",
    ".png",
    ".webp",
    ".tif",
    ".tiff",
    ".bmp",
    ".avif",
    ".heic",
    ".heif",
)
FOOTAGE_SUFFIXES = VIDEO_SUFFIXES + PICTURE_SUFFIXES
# of an image, 134 million: more than footage has; a few bytes of a file can declare any number
MAX_PIXELS = 1 << 27
# The size of a file is limited to what its image may take, with four channels of 16 bits.
MAX_PICTURE_BYTES = 8 * MAX_PIXELS
LAST_NUMBER = re.compile(r"(\d+)(?!.*\d)")
# An address in a text, to the end of a word: a password may have any character but a space.
# Taken for a path, it has a single slash; a drive of Windows has one letter.
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://?")
_ADDRESS = re.compile(rf"{_SCHEME.pattern}[^\s'\"<>)]+")
_HOST = re.compile(r"(\[[^]]*\]|[^/?#@:]*)(:\d+)?([/?#]|$)")
_AFTER_PATH = re.compile(r"[?#;&]")
# Control characters, ends of lines, and marks of the direction of writing.
_UNSHOWN = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
# Surrogates that are not Python's escapes of bytes.
_NO_BYTE = re.compile("[\ud800-\udc7f\udd00-\udfff]")
NUMBER_SIGN = re.compile(r"#+|%0?\d*d")  # stands for the number in a pattern of names


def sequence_pattern(picture: Path) -> str:
    """Return the picture's name with its last number replaced by #: the same for all pictures of a
    sequence.
    """
    return LAST_NUMBER.sub("#", picture.stem) + picture.suffix.lower()


def pictures_in(folder: Path) -> list[Path]:
    """Return the pictures in a folder in natural order: frame 10 comes after frame 9."""
    found = [
        p
        for p in folder.iterdir()
        if p.suffix.lower() in PICTURE_SUFFIXES and not p.name.startswith(".")
    ]
    return sorted((p for p in found if p.is_file()), key=_natural_order)


def is_sequence(pictures: list[Path]) -> bool:
    """Return whether these pictures are one numbered sequence: their names differ in the last
    number only.
    """
    return len(pictures) > 1 and len({sequence_pattern(p) for p in pictures}) == 1


def numbered_places(numbers: Sequence[int]) -> list[int]:
    """Return the places of numbered pictures, from 0 on; numbers in constant steps, such as tens,
    count as consecutive.

    :param numbers: in increasing order.
    """
    step = math.gcd(*(number - numbers[0] for number in numbers)) or 1
    return [(number - numbers[0]) // step for number in numbers]


def picture_slots(numbers: Sequence[int]) -> list[int]:
    """Return the slot of each numbered picture: it is shown at slot / rate seconds.

    A missing picture leaves a gap in time. If more than half of the numbers are missing, they only
    give the order.

    :param numbers: in increasing order.
    """
    places = numbered_places(numbers)
    missing = places[-1] + 1 - len(places)
    return list(range(len(places))) if 2 * missing > places[-1] + 1 else places


def numbered(folder: Path, before: str, after: str, first: int = 0) -> list[Path]:
    """Return the pictures in a folder named ``before``, a number, ``after``, in order of the
    number.

    :param first: smallest number.
    """
    name = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
    found = [(int(m.group(1)), p) for p in folder.iterdir() if (m := name.fullmatch(p.name))]
    return [
        p for number, p in sorted(found) if number >= first and p.suffix.lower() in PICTURE_SUFFIXES
    ]


def numbered_from(first: Path) -> list[Path]:
    """Return a picture and those that continue its sequence; empty if its name has no number."""
    parts = _around_number(first)
    if parts is None:
        return []
    before, number, after = parts
    return numbered(first.parent, before, after, number)


def sequence_from(first: Path) -> list[Path]:
    """Return the pictures of a captured sequence from its first one on, counted by the last number
    of their names that others continue: a pattern such as ``#_1080p.png`` has one elsewhere.
    """
    for number in reversed([*re.finditer(r"\d+", first.stem)]):
        before = first.stem[: number.start()]
        after = first.stem[number.end() :] + first.suffix
        found = numbered(first.parent, before, after, int(number.group()))
        if len(found) > 1:
            return found
    return [first]


def continued(pictures: Iterable[Path]) -> set[Path]:
    """Return the pictures that continue the sequence of another of them."""
    sequences: dict[tuple[Path, str, str], list[tuple[int, Path]]] = {}
    for picture in pictures:
        parts = _around_number(picture)
        if parts is not None:
            before, number, after = parts
            sequences.setdefault((picture.parent, before, after), []).append((number, picture))
    return {picture for found in sequences.values() for _, picture in sorted(found)[1:]}


def _around_number(picture: Path) -> tuple[str, int, str] | None:
    """Return what a picture's name has before its last number, the number, and what is after it;
    None without a number.
    """
    number = LAST_NUMBER.search(picture.stem)
    if number is None:
        return None
    before = picture.stem[: number.start()]
    return before, int(number.group()), picture.stem[number.end() :] + picture.suffix


def files_of_footage(path: Path) -> list[Path]:
    """Return every file that footage may be read from: a video or picture and those that continue
    its sequence, the pictures of a pattern such as ``walk_####.png``, or all files of a folder.
    """
    if path.is_dir():
        return [each for each in path.iterdir() if each.is_file()]
    if path.is_file():
        return [path, *numbered_from(path)]
    sign = NUMBER_SIGN.search(path.name)
    if sign is None or not path.parent.is_dir():
        return []
    return numbered(path.parent, path.name[: sign.start()], path.name[sign.end() :])


def is_url(text: object) -> bool:
    """Return whether a text is the address of a file or folder in a store, such as
    ``s3://bucket/clips``.
    """
    return isinstance(text, str) and "://" in text


def display_text(foreign: str | Path) -> str:
    """Return a name or message in one line, as people may see it.

    Each character that moves the cursor, ends the line or turns the direction of writing becomes
    U+FFFD, and so do bytes that are not UTF-8: names may have them, and could otherwise forge a
    message or hide a part of one. Of addresses, only what `display_address` leaves is shown.
    """
    text = _ADDRESS.sub(lambda found: display_address(found[0]), unicode_text(foreign))
    return _UNSHOWN.sub("\N{REPLACEMENT CHARACTER}", text)


def display_address(address: str) -> str:
    """Return an address without what it may have of a secret: name and password before the host,
    whatever characters these have, and all after the path.
    """
    found = _SCHEME.match(address)
    if found is None:
        return address
    rest = address[found.end() :]
    public = rest.rpartition("@")[2] if has_login(rest) else rest
    return found[0] + _AFTER_PATH.split(public, maxsplit=1)[0]


def has_login(rest: str) -> bool:
    """Return whether an address has a name or password; it may have an ``@`` in its path.

    :param rest: of the address, after ``://``.
    """
    return "@" in rest and not _HOST.match(rest)


def unicode_text(path: str | Path) -> str:
    """Return a path as text for other programs: bytes that are not UTF-8 become U+FFFD.

    Old discs and archives hold such names, and Python keeps the bytes as lone surrogates. Text with
    them can name a file, but cannot be printed, or be part of JSON or of Blender's names. The
    escapes of JSON also give lone surrogates that stand for no byte.
    """
    if is_utf8(path):
        return str(path)
    text = _NO_BYTE.sub("\N{REPLACEMENT CHARACTER}", str(path))
    # Not by the system's encoding, which may lack other letters of the text.
    as_bytes = text.encode("utf-8", sys.getfilesystemencodeerrors())
    return as_bytes.decode("utf-8", "replace")


def json_text(value: object, indent: int | None = None) -> str:
    """Return JSON in ASCII, in which file names are as in `unicode_text`."""
    import json  # here, because Blender loads this module when it starts

    return json.dumps(
        json.loads(unicode_text(json.dumps(value, ensure_ascii=False))), indent=indent
    )


def is_utf8(path: str | Path) -> bool:
    """Return whether a path's characters are all of Unicode."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return False
    return True


def _natural_order(path: Path) -> list[tuple[int, int, str]]:
    return [
        (0, int(part), "") if part.isdecimal() else (1, 0, part)
        for part in re.split(r"(\d+)", path.name)
    ]
