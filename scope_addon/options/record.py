# SPDX-License-Identifier: GPL-3.0-or-later
"""The record that declares an option, and its appearance on the command line and in Blender.

Blender loads this when it starts, and makes named tuples in a third of the time of dataclasses.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import Field, field, fields
from pathlib import Path
from types import NoneType
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints


class Place(enum.Flag):
    """Where an option applies."""

    COMMAND_LINE = enum.auto()
    WORKER = enum.auto()  # part of the request to the worker process
    CAPTURE = enum.auto()  # a field of CaptureOptions
    PANEL = enum.auto()  # a property of the scene
    PREFERENCES = enum.auto()  # a property of the extension's preferences
    EXPORT = enum.auto()  # a property of the export operator
    IMPORT = enum.auto()  # an argument of the command that imports motion files
    LIVE = enum.auto()  # an argument of the command that captures a camera or stream
    LIVE_WORKER = enum.auto()  # part of the request to the worker process of a live capture
    LIVE_PANEL = enum.auto()  # a property of the scene for live captures


class Section(enum.Enum):
    """A group of options that the panel draws one below the other, in the order of their
    declaration.
    """

    PERSON = enum.auto()
    FOOTAGE = enum.auto()
    MOTION = enum.auto()
    SCENE = enum.auto()


class Choice(NamedTuple):
    """One value of an option. A .blend file stores its ``number``, which therefore must never
    change.
    """

    value: str
    label: str
    description: str
    number: int

    @property
    def identifier(self) -> str:
        """Identifier of the value in Blender."""
        return self.value.upper()


class Argument(NamedTuple):
    """Appearance of an option on the command line, where it does not follow from the option's name
    and type.

    :param flag: such as ``--fov``; by default the option's name, with prefix ``no-`` if the option
        is on by default.
    :param parse: converts the argument's text to the option's value; its ValueError says what the
        argument must be.
    :param default_text: how the help describes the default; by default its value.
    :param inherited: whether a batch passes the argument on to the process of each clip.
    :param bare: the value of the flag alone, where none of the choices follows it; empty: one has
        to.
    :param repeated: whether the flag may be given several times; the value is then a tuple of what
        it was given with.
    """

    flag: str = ""
    metavar: str | None = None
    help: str = ""
    parse: Callable[[str], Any] | None = None
    default_text: str | None = None
    inherited: bool = True
    bare: str = ""
    repeated: bool = False


class Property(NamedTuple):
    """Appearance of an option in Blender, where it does not follow from the option's name and type.

    ``default``, ``minimum`` and ``maximum`` are in ``unit``; if it is empty, in the option's own
    unit.

    :param value: returns the option's value, given the properties of the panel or of the
        preferences.
    :param keywords: further arguments of Blender's property, such as ``subtype``.
    :param section: where the panel draws it; None: the panel's code says where.
    """

    name: str = ""
    label: str = ""
    description: str = ""
    unit: str = ""
    default: Any = None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Choice, ...] = ()
    value: Callable[[Any], Any] | None = None
    keywords: dict[str, Any] = {}
    section: Section | None = None


class Option(NamedTuple):
    """One option of a capture. A default of None means that the option is not set.

    :param value_type: type of the value, or of its elements if ``several``; in requests, a Path is
        a string.
    :param choices: the strings that are allowed; empty if all are.
    :param decides_result: False if the option does not change the result of a capture.
    """

    name: str
    value_type: type | tuple[type, ...]
    default: Any
    places: Place
    help: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Choice, ...] = ()
    several: bool = False
    decides_result: bool = True
    argument: Argument = Argument()
    blender: Property = Property()

    @property
    def flag(self) -> str:
        """Flag on the command line, such as ``--shape-keys``."""
        negated = "no-" if self.default is True else ""
        return self.argument.flag or f"--{negated}{self.name.replace('_', '-')}"

    @property
    def values(self) -> tuple[str, ...]:
        """The strings that are allowed; empty if all are."""
        return tuple(choice.value for choice in self.choices)

    def type_error(self, value: object) -> str:
        """Describe what is wrong with a value's type or choice; empty if nothing is."""
        if value is None and self.default is None:
            return ""
        if self.several:
            if not isinstance(value, list | tuple):
                return f"must be a list, not {value!r}"
            return next(filter(None, map(self._element_error, value)), "")
        return self._element_error(value)

    def range_error(self, value: object) -> str:
        """Describe the allowed range if a number, or an element of a list, is outside of it; empty
        otherwise.
        """
        for each in value if isinstance(value, list | tuple) else (value,):
            if isinstance(each, int | float) and not isinstance(each, bool):
                low = self.minimum is None or each >= self.minimum
                high = self.maximum is None or each <= self.maximum
                if not (low and high):
                    return f"must be {self._range_text()}, not {each:g}"
        return ""

    def _range_text(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        if self.maximum is None:
            return f"at least {self.minimum:g}{unit}"
        if self.minimum is None:
            return f"at most {self.maximum:g}{unit}"
        return f"from {self.minimum:g} to {self.maximum:g}{unit}"

    def _element_error(self, value: object) -> str:
        allowed = self.value_type if isinstance(self.value_type, tuple) else (self.value_type,)
        wanted: set[type] = {str if t is Path else t for t in allowed}
        if float in wanted:
            wanted.add(int)
        if not isinstance(value, tuple(wanted)) or (isinstance(value, bool) and bool not in wanted):
            return f"must be {' or '.join(sorted(t.__name__ for t in wanted))}, not {value!r}"
        if isinstance(value, str) and self.choices and value not in self.values:
            return f"must be one of {', '.join(self.values)}, not {value!r}"
        return ""


def declared(default: Any, places: Place, help: str, **details: Any) -> Any:
    """Declare an option as a field of a frozen dataclass, which gives its name and type.

    :param details: the further fields of the `Option`.
    """
    return field(default=default, metadata={"places": places, "help": help, "details": details})


def options_of(declaration: type) -> tuple[Option, ...]:
    """Return the options that a dataclass declares, in their order: its fields, and the `Option`
    records among its class variables.
    """
    types = get_type_hints(declaration)
    by_name = {each.name: each for each in fields(declaration)}
    return tuple(
        _option(by_name[name], types[name]) if name in by_name else getattr(declaration, name)
        for name in declaration.__annotations__
    )


def _option(declared_field: Field[Any], annotation: Any) -> Option:
    """Return the option that a field declares; ``X | None`` is X, ``Sequence[X]`` several X."""
    types = [each for each in get_args(annotation) if each is not NoneType] or [annotation]
    return Option(
        declared_field.name,
        types[0] if len(types) == 1 else tuple(types),
        declared_field.default,
        declared_field.metadata["places"] | Place.CAPTURE,
        declared_field.metadata["help"],
        several=get_origin(annotation) is Sequence,
        **declared_field.metadata["details"],
    )
