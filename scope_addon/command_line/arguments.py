# SPDX-License-Identifier: GPL-3.0-or-later
"""Command-line arguments made from the declared options, for one clip and for a folder of clips."""

from __future__ import annotations

import os
import re
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...solver.body import Body
from ..errors import UsageError
from ..footage import is_url
from ..options import OPTIONS, Option, Place, options_at
from ..options.body_choice import chosen_body
from ..output_paths import SUFFIXES

if TYPE_CHECKING:
    from ..capture.options import CaptureOptions

BODY_SUFFIXES = (".npz", ".pkl", ".pickle")
_NEGATIVE = re.compile(r"-\.?[0-9]")  # the beginning of a number below zero
_LONGEST_SHOWN = 60  # characters of a value in a message


def path_argument(text: str) -> Path:
    """Convert an argument to a path.

    :raises ArgumentTypeError: it is empty, as an unset variable of the shell is, which would mean
        the current folder; or an address.
    """
    if not text:
        raise ArgumentTypeError("the path is empty; give a file or folder")
    if is_url(text):  # of which a path would lose a slash
        raise ArgumentTypeError(
            f"{text} is an address, and files are needed here; download it first"
        )
    return Path(text)


def add_outputs(parser: ArgumentParser, default: str) -> None:
    """Add the argument for the files that a command writes.

    :param default: what it writes without one, for the help.
    """
    parser.add_argument(
        "-o",
        "--output",
        action="append",
        type=path_argument,
        default=[],
        metavar="OUT",
        help=f"result file, may be repeated; its suffix selects the format: {', '.join(SUFFIXES)}"
        f" (default: {default})",
    )


def add_options(parser: ArgumentParser, place: Place = Place.COMMAND_LINE) -> None:
    """Add an argument for each option of the command line, or of one of its commands."""
    for option in options_at(place):
        if option.value_type is bool:
            parser.add_argument(
                option.flag, action="store_true", help=option.argument.help or option.help
            )
        else:
            _add_valued(parser, option)


def with_bare_values(argv: Sequence[str]) -> list[str]:
    """Give the flags that may come without a value theirs: argparse would take what follows, such
    as the footage. And join numbers below zero with their flags, since argparse takes a list of
    them, such as -0.4,auto, for a flag.

    :raises UsageError: a text is empty, as an unset variable of the shell is, which would mean that
        its option is not given.
    """
    flags = {option.flag for option in OPTIONS if option.value_type is not bool}
    may_be_left_out = {option.flag for option in OPTIONS if option.default == ""}
    bare = {option.flag: option for option in OPTIONS if option.argument.bare}
    out = list(argv)
    joined: list[int] = []
    for k, text in enumerate(argv):
        if text == "--":
            break
        flag, has_value, value = text.partition("=")
        value = value if has_value else argv[k + 1] if k + 1 < len(argv) else "missing"
        if flag in may_be_left_out and not value.strip():
            raise UsageError(f"{flag} is empty; give a value, or leave it out")
        if text in bare and (k + 1 == len(argv) or argv[k + 1] not in bare[text].values):
            out[k] = f"{text}={bare[text].argument.bare}"
        elif text in flags and k + 1 < len(argv) and _NEGATIVE.match(argv[k + 1]):
            out[k] = f"{text}={argv[k + 1]}"
            joined.append(k + 1)
    return [text for k, text in enumerate(out) if k not in joined]


def _add_valued(parser: ArgumentParser, option: Option) -> None:
    argument = option.argument
    default = _default(option)
    text = argument.default_text or (str(default) if default else "")
    parser.add_argument(
        option.flag,
        action="append" if argument.repeated else "store",
        type=_argument_type(option),
        choices=None if argument.parse is not None else option.values or None,
        default=default,
        metavar=argument.metavar,
        help=(argument.help or option.help) + (f" (default: {text})" if text else ""),
    )


def _argument_type(option: Option) -> Callable[[str], Any]:
    """Return the function by which argparse converts the argument's text."""
    if option.argument.parse is not None or isinstance(option.value_type, tuple):
        return str
    return path_argument if option.value_type is Path else option.value_type


def body_and_options(args: Namespace) -> tuple[Body, CaptureOptions]:
    """Load the body and convert the arguments to the options of a capture.

    :raises ScopeError: an argument has an invalid value, or the body does not exist.
    """
    from ..capture.options import capture_options, check_options
    from ..untrusted.body_file import load_body

    values = option_values(args)
    options = capture_options(values)
    body = load_body(chosen_body(values))
    check_options(body, options, has_views=bool(getattr(args, "views", ())))
    return body, options


def option_values(args: Namespace, place: Place = Place.COMMAND_LINE) -> dict[str, Any]:
    """Return the value of each option of the command line, or of one of its commands, by the
    option's name.

    :raises UsageError: an argument cannot be parsed.
    """
    return {option.name: _value(option, _argument(option, args)) for option in options_at(place)}


def values_in_range(args: Namespace, place: Place) -> dict[str, Any]:
    """Return the value of each option of a command, by the option's name.

    :raises UsageError: an argument cannot be parsed, or a number is out of its range.
    """
    values = option_values(args, place)
    for option in options_at(place):
        if problem := option.range_error(values[option.name]):
            raise UsageError(f"{option.flag} {problem}")
    return values


def non_default_arguments(args: Namespace) -> dict[str, str | None]:
    """Return the arguments that differ from their defaults, for the process that captures one clip
    of a batch.

    :return: flag to text; None for a flag that takes no value.
    """
    arguments: dict[str, str | None] = {}
    for option in options_at(Place.COMMAND_LINE):
        value = _argument(option, args)
        if value != _default(option) and option.argument.inherited:
            if option.argument.repeated:
                (value,) = value  # a batch takes one rig
            arguments[option.flag] = None if option.value_type is bool else _text(option, value)
    return arguments


def _text(option: Option, value: Any) -> str:
    """Return an argument's text for a process that may have another current folder."""
    is_file = option.value_type is Path or (
        option.name == "body" and Path(value).suffix.lower() in BODY_SUFFIXES
    )
    return os.path.abspath(value) if is_file else str(value)


def _argument(option: Option, args: Namespace) -> Any:
    return getattr(args, option.flag.lstrip("-").replace("-", "_"))


def _default(option: Option) -> Any:
    """Return what argparse returns for an argument that is not given."""
    if option.value_type is bool:
        return False
    return None if option.several or option.argument.repeated else option.default


def _value(option: Option, given: Any) -> Any:
    if option.value_type is bool:
        return given != option.default  # --no-smoothing turns off smoothing, which is on by default
    if option.argument.repeated:
        return tuple(given or ())
    if given is None or option.argument.parse is None:
        return option.default if given is None else given
    try:
        return option.argument.parse(given)
    except ValueError as error:
        raise UsageError(f"{option.flag} {error}, not {_quoted(given)}") from error


def _quoted(given: object) -> str:
    """Return a value for a message, of which it must not take more than a line."""
    text = repr(given)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}…"
