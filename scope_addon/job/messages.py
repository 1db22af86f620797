# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker's messages, checked before anything acts on them.

The worker decodes footage of others with libraries in C. What it writes after one of them has gone
wrong may be anything.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from ...solver.errors import ScopeError

LONGEST_LINE = 16 << 20  # bytes; a report of 10 people has some 100 kB
_LARGEST_NUMBER = 1 << 53
_LARGEST_SIDE = 4096  # of a preview, in pixels
_LONGEST_TEXT = 2000


class WorkerFailedError(ScopeError):
    """The worker reported an error, ended without a result, or sent what is no message."""


def is_number(value: object) -> bool:
    """Return whether it is an integer from 0."""
    return type(value) is int and 0 <= value < _LARGEST_NUMBER


def _is_side(value: object) -> bool:
    return type(value) is int and 0 < value <= _LARGEST_SIDE


def is_text(value: object) -> bool:
    """Return whether it is a text of moderate length."""
    return isinstance(value, str) and len(value) <= _LONGEST_TEXT


def _is_name(value: object) -> bool:
    """Whether it is the name of a file in the job's folder, not a way to another."""
    return (
        isinstance(value, str)
        and 0 < len(value) < 200
        and value.isprintable()
        and not set(value) & set('/\\:"*?<>|')
    )


def _are_names(value: object) -> bool:
    return (
        isinstance(value, list)
        and bool(value)
        and all(_is_name(name) and name.endswith(".npz") for name in value)
    )


def _is_report(value: object) -> bool:
    if not isinstance(value, dict):
        return False
    warnings = value.get("warnings", [])
    rates = value.get("fps", {})
    if not isinstance(warnings, list) or not isinstance(rates, dict):
        return False
    are_finite = all(
        type(rate) in (int, float) and 0 <= rate < _LARGEST_NUMBER for rate in rates.values()
    )
    return are_finite and all(isinstance(text, str) for text in warnings)


# The fields that a message must have, by its event, and what they may be.
Fields = dict[str, dict[str, Callable[[object], bool]]]
WARM_UP_FIELDS: Fields = {
    "progress": {"stage": is_text, "done": is_number, "total": is_number},
    "result": {},
}
CAPTURE_FIELDS: Fields = WARM_UP_FIELDS | {
    "preview": {"file": _is_name, "width": _is_side, "height": _is_side, "frame": is_number},
    "result": {"motions": _are_names, "report": _is_report},
}


def is_result(content: object) -> bool:
    """Return whether it has what the message of a finished capture must have: names of motions and
    a report.
    """
    return isinstance(content, dict) and all(
        is_(content.get(field)) for field, is_ in CAPTURE_FIELDS["result"].items()
    )


def parse_message(line: bytes, fields: Fields = CAPTURE_FIELDS) -> dict[str, Any] | None:
    """Read a line of the worker.

    :param fields: what the messages of this job have.
    :return: the message; None for a line that is none, such as a library may print, or one of an
        unknown event.
    :raises WorkerFailedError: the line is too long, or a message lacks what its event needs.
    """
    if len(line) > LONGEST_LINE:
        raise unreadable(f"a line of more than {LONGEST_LINE >> 20} MB")
    try:
        message = json.loads(line)
    except (ValueError, RecursionError):
        return None
    event = message.get("event") if isinstance(message, dict) else None
    if event == "error":
        return {"event": "error", "message": _one_line(message.get("message"))}
    if not isinstance(event, str) or event not in fields:
        return None
    for field, is_valid in fields[event].items():
        if not is_valid(message.get(field)):
            raise unreadable(f"{event} without a valid {field}")
    return dict(message)


def _one_line(text: object) -> str:
    said = " ".join(text.split()) if isinstance(text, str) else ""
    return said[:_LONGEST_TEXT] or "the worker process failed"


def unreadable(what: str) -> WorkerFailedError:
    """Return the error for a message that cannot be used."""
    return WorkerFailedError(
        f"the worker process sent a message that cannot be used ({what}); try again"
    )
