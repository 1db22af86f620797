# SPDX-License-Identifier: GPL-3.0-or-later
"""The options of a capture, each declared once. Standard library only: no bpy, no numpy, no other
part of Scope.

The arguments of the command line (`command_line.arguments`), the request to the worker
(`job.request`), and the properties of the panel and of the preferences (`ui.declared_properties`)
are made from these records. The dataclasses in `capture` declare what the pipeline reads:
`capture.options.CaptureOptions` has their fields. To add an option, add a field to one of these, or
a record to `output` or `live`.
"""

from __future__ import annotations

from .capture import CAPTURE_OPTIONS, NETWORK_OPTIONS
from .live import LIVE_OPTIONS
from .output import IMPORT_OPTIONS, OUTPUT_OPTIONS, REPORT_OPTIONS
from .record import Argument, Choice, Option, Place, Property, Section

# In the order of the command line's help.
OPTIONS: tuple[Option, ...] = (
    *CAPTURE_OPTIONS,
    *OUTPUT_OPTIONS,
    *NETWORK_OPTIONS,
    *IMPORT_OPTIONS,
    *LIVE_OPTIONS,
    *REPORT_OPTIONS,
)

__all__ = [
    "OPTIONS",
    "Argument",
    "Choice",
    "Option",
    "Place",
    "Property",
    "Section",
    "option",
    "options_at",
]


def options_at(place: Place) -> tuple[Option, ...]:
    """Return the options that apply at a place; if several places are combined, at all of them."""
    return tuple(option for option in OPTIONS if place in option.places)


def option(name: str) -> Option:
    """Return the option with this name.

    :raises KeyError: there is no such option.
    """
    for each in OPTIONS:
        if each.name == name:
            return each
    raise KeyError(name)
