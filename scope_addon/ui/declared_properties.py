# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's properties of the declared options, and the options' values from these properties."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..options import Choice, Option, Place, options_at

_FIXED: set[str] = set()  # not animatable: a keyframe on a setting would only confuse
# Since 4.5, a property says whether its path may begin with "//", the folder of the .blend.
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()
_Class = TypeVar("_Class", bound=type)


def with_options(place: Place) -> Callable[[_Class], _Class]:
    """Decorate a class of properties: it gets one property for each option of ``place``."""

    def add(cls: _Class) -> _Class:
        for option in options_at(place):
            cls.__annotations__[property_name(option)] = blender_property(option, _keywords(place))
        return cls

    return add


def property_name(option: Option) -> str:
    """Name of the property in Blender, which a .blend stores."""
    return option.blender.name or option.name


def blender_property(option: Option, place_keywords: dict[str, Any]) -> Any:
    """Make the property of an option; ``place_keywords`` are those of all properties of the same place."""
    declared = option.blender
    keywords: dict[str, Any] = {
        "name": declared.label or property_name(option).replace("_", " ").title(),
        "description": declared.description or option.help[0].upper() + option.help[1:],
    }
    if option.value_type is Path:
        options = {"options": PATH_OPTIONS} if place_keywords else {}
        return StringProperty(subtype="FILE_PATH", **keywords, **options, **declared.keywords)
    keywords |= place_keywords | declared.keywords
    default = option.default if declared.default is None else declared.default
    if choices := choices_of(option):
        items = tuple((c.identifier, c.label, c.description, c.number) for c in choices)
        return EnumProperty(items=items, default=default.upper(), **keywords)
    if isinstance(default, bool):
        return BoolProperty(default=default, **keywords)
    if isinstance(default, str):
        return StringProperty(default=default, **keywords)
    number = IntProperty if isinstance(default, int) else FloatProperty
    low, high = limits_of(option)
    keywords |= {name: limit for name, limit in (("min", low), ("max", high)) if limit is not None}
    return number(default=default, **keywords)


def choices_of(option: Option) -> tuple[Choice, ...]:
    """What the property offers; empty if it is no enumeration."""
    return option.blender.choices or option.choices


def limits_of(option: Option) -> tuple[float | None, float | None]:
    """Lowest and highest value of the property, in its own unit."""
    declared, same_unit = option.blender, not option.blender.unit
    low = option.minimum if declared.minimum is None and same_unit else declared.minimum
    high = option.maximum if declared.maximum is None and same_unit else declared.maximum
    return low, high


def option_values(settings: Any, place: Place) -> dict[str, Any]:
    """Return the values of the worker's options that have their properties at ``place``.

    :param settings: what has these properties; None: the defaults.
    """
    options = options_at(place | Place.WORKER)
    if settings is None:
        return {option.name: option.default for option in options}
    return {option.name: _value(option, settings) for option in options}


def _value(option: Option, settings: Any) -> Any:
    if option.blender.value is not None:
        value = option.blender.value(settings)
    else:
        value = getattr(settings, property_name(option))
        value = value.lower() if choices_of(option) else value
    if option.value_type is Path:
        return bpy.path.abspath(value) if value else None
    return value


def _keywords(place: Place) -> dict[str, Any]:
    return {"options": _FIXED} if place is Place.PANEL else {}
