# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading JSON files that people have written or edited."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..solver.errors import InputError
from ..solver.loaders.regular_file import check_regular

LARGEST_JSON_BYTES = 1_000_000
_LARGEST_WHOLE_NUMBER = 1 << 53  # that every reader of JSON holds exactly; 10**400 fits no float (RFC 7493, 2.2)


def read_json_object(path: Path, error: type[InputError], what: str, advice: str) -> dict[str, Any]:
    """Read a file that holds one JSON object and is not larger than `LARGEST_JSON_BYTES`.

    :param error: class of what is raised.
    :param what: what the file should be, for the messages, e.g. ``bone map``.
    :param advice: how to correct a file that is something else.
    :raises InputError: as `error`, when the file cannot be read or is something else.
    """
    check_regular(path, error, what, LARGEST_JSON_BYTES)
    article = "an" if what.startswith(tuple("aeiou")) else "a"
    try:
        text = path.read_text("utf-8-sig")  # some editors write a byte order mark
        content = json.loads(text, parse_int=_parse_whole_number)
    except OSError as failure:
        raise error(f"{path}: the {what} cannot be read ({failure.strerror}); choose another file") from failure
    except (ValueError, RecursionError) as failure:
        raise error(f"{path} is not {article} {what}: it is not JSON ({failure}); {advice}") from failure
    if not isinstance(content, dict):
        raise error(f"{path} is not {article} {what}: it does not hold a JSON object; {advice}")
    return content


def _parse_whole_number(digits: str) -> int:
    number = int(digits)
    if abs(number) > _LARGEST_WHOLE_NUMBER:
        raise ValueError(f"it has a number of {len(digits)} digits")
    return number
