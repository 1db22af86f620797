# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of a capture on a command line, made from their declarations: for one clip and for a folder of them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...solver.body import Body
from ...solver.loaders.body_file import body_with_hands
from ..errors import UsageError
from ..options import Option, Place, options_at

if TYPE_CHECKING:
    from ..capture.options import CaptureOptions


def path_argument(text: str) -> Path:
    """Convert an argument to a path. An empty one, such as an unset variable of the shell, is refused.

    :raises ArgumentTypeError: it is empty; it would mean the current folder.
    """
    if not text:
        raise argparse.ArgumentTypeError("the name is empty; give that of a file or folder")
    return Path(text)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add an argument for each option of the command line."""
    for option in options_at(Place.COMMAND_LINE):
        if option.value_type is bool:
            parser.add_argument(option.flag, action="store_true", help=option.argument.help or option.help)
        else:
            _add_valued(parser, option)


def _add_valued(parser: argparse.ArgumentParser, option: Option) -> None:
    argument, parsed = option.argument, option.argument.parse is not None
    default = _default(option)
    text = argument.default_text or (str(default) if default else "")
    kind = (
        str
        if parsed or isinstance(option.value_type, tuple)
        else path_argument
        if option.value_type is Path
        else option.value_type
    )
    parser.add_argument(
        option.flag,
        type=kind,
        choices=None if parsed else option.values or None,
        default=default,
        metavar=argument.metavar,
        help=(argument.help or option.help) + (f" (default: {text})" if text else ""),
    )


def body_and_options(args: argparse.Namespace) -> tuple[Body, CaptureOptions]:
    """Load the body and convert the arguments to the options of a capture.

    :raises ScopeError: an argument has an impossible value, or there is no such body.
    """
    from ...solver.loaders.body_file import load_body
    from ..capture.options import capture_options, check_options

    values = option_values(args)
    options = capture_options(values)
    body = load_body(body_with_hands(values["body"]) if values["hands"] else values["body"])
    check_options(body, options)
    return body, options


def option_values(args: argparse.Namespace) -> dict[str, Any]:
    """Return the value of each option of the command line by the option's name.

    :raises UsageError: an argument cannot be parsed.
    """
    return {option.name: _value(option, _given(option, args)) for option in options_at(Place.COMMAND_LINE)}


def non_default_arguments(args: argparse.Namespace) -> dict[str, str | None]:
    """Return the arguments that differ from their defaults, for a process that captures one clip of a batch.

    Flag to text, None where the flag takes no value.
    """
    given: dict[str, str | None] = {}
    for option in options_at(Place.COMMAND_LINE):
        value = _given(option, args)
        if value != _default(option) and option.argument.inherited:
            given[option.flag] = None if option.value_type is bool else str(value)
    return given


def _given(option: Option, args: argparse.Namespace) -> Any:
    return getattr(args, option.flag.lstrip("-").replace("-", "_"))


def _default(option: Option) -> Any:
    """What argparse returns where the argument is not given."""
    if option.value_type is bool:
        return False
    return None if option.several else option.default


def _value(option: Option, given: Any) -> Any:
    if option.value_type is bool:
        return given != option.default  # --no-smoothing turns off what is on by default
    if given is None or option.argument.parse is None:
        return option.default if given is None else given
    try:
        return option.argument.parse(given)
    except ValueError as error:
        raise UsageError(f"{option.flag} {error}, not {given!r}") from error
