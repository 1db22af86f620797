# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading JSON files that people have written or edited, and maps, which Scope writes as JSON files
itself.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..solver.errors import InputError
from .atomic_write import write_result
from .errors import OutputError
from .untrusted.files import check_regular

LARGEST_JSON_BYTES = 1_000_000
# that every reader of JSON holds exactly; 10**400 fits no float (RFC 7493, 2.2)
LARGEST_WHOLE_NUMBER = 1 << 53


def read_json_object(
    path: Path,
    error: type[InputError],
    what: str,
    advice: str,
    largest_bytes: int = LARGEST_JSON_BYTES,
) -> dict[str, Any]:
    """Read a file that holds one JSON object and is not too large.

    :param error: class of what is raised.
    :param what: what the file should be, for the messages, e.g. ``bone map``.
    :param advice: how to correct a file that is something else.
    :raises InputError: as `error`, when the file cannot be read or is something else.
    """
    check_regular(path, error, what, largest_bytes)
    try:
        text = path.read_text("utf-8-sig")  # some editors write a byte order mark
        content = json.loads(text, parse_int=_parse_whole_number)
    except OSError as failure:
        raise error(
            f"{path}: the {what} cannot be read ({failure.strerror}); choose another file"
        ) from failure
    except (ValueError, RecursionError) as failure:
        raise error(
            f"{path} is not {_article(what)} {what}: it is not JSON ({failure}); {advice}"
        ) from failure
    if not isinstance(content, dict):
        raise error(
            f"{path} is not {_article(what)} {what}: it does not hold a JSON object; {advice}"
        )
    return content


def load_map(path: Path, what: str) -> dict[str, Any]:
    """Read what `save_map` wrote.

    :param what: the map's kind, e.g. ``bone map``.
    :raises InputError: the file cannot be read or is something else.
    """
    content = read_json_object(path, InputError, what, "choose one that Scope saved")
    if content.get("format") != f"scope {what}" or content.get("version") != 1:
        raise InputError(
            f"{path}: this JSON file is not a Scope {what}, version 1; choose another file"
        )
    return content


def save_map(path: Path, what: str, **content: Any) -> None:
    """Write a map as JSON, atomically. Only a map of its kind is overwritten, whatever it holds, or
    an empty file.

    :param what: the map's kind, e.g. ``bone map``.
    :raises OutputError: the file cannot be written, or is something else.
    """
    if path.is_file() and not _is_map_or_empty(path, what):
        raise OutputError(
            f"{path} is not {_article(what)} {what}, so it is not overwritten; choose another name"
        )
    text = json.dumps(
        {"format": f"scope {what}", "version": 1, **content}, indent=2, ensure_ascii=False
    )
    # Half of a surrogate pair, which JSON's escapes can hold and UTF-8 cannot, becomes such an
    # escape.
    writable_text = text.encode("utf-8", "backslashreplace").decode()
    write_result(path, writable_text + "\n")


def _is_map_or_empty(path: Path, what: str) -> bool:
    try:
        return (
            path.stat().st_size == 0
            or read_json_object(path, InputError, what, "")["format"] == f"scope {what}"
        )
    except (OSError, InputError, KeyError):
        return False


def _article(noun: str) -> str:
    return "an" if noun.startswith(tuple("aeiou")) else "a"


def _parse_whole_number(digits: str) -> int:
    number = int(digits)
    if abs(number) > LARGEST_WHOLE_NUMBER:
        raise ValueError(f"it has a number of {len(digits)} digits")
    return number
