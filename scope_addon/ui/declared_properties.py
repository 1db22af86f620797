# SPDX-License-Identifier: GPL-3.0-or-later
"""Make Blender properties from the declared options, and read the options' values from them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty
from bpy.types import PropertyGroup, UILayout

from ..options import Choice, Option, Place, Section, options_at
from .file_field import path_text, text_name
from .translations import CONTEXT

_NOT_ANIMATABLE: set[str] = set()  # the options of a property without ANIMATABLE
# Since 4.5, properties declare whether their path may begin with "//", the folder of the .blend
# file.
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()
_Class = TypeVar("_Class", bound=type)


def with_options(place: Place) -> Callable[[_Class], _Class]:
    """Return a class decorator that adds one property for each option of ``place``."""

    def add(cls: _Class) -> _Class:
        for option in options_at(place):
            cls.__annotations__[property_name(option)] = blender_property(option, _keywords(place))
            if option.value_type is Path:
                cls.__annotations__[text_name(property_name(option))] = path_text(
                    property_name(option), **_texts(option)
                )
        return cls

    return add


def property_name(option: Option) -> str:
    """Return the name of the property in Blender, which .blend files store."""
    return option.blender.name or option.name


def blender_property(option: Option, place_keywords: dict[str, Any]) -> Any:
    """Make the property of an option.

    :param place_keywords: arguments of all properties of the same place.
    """
    declared = option.blender
    keywords = _texts(option)
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


def _texts(option: Option) -> dict[str, Any]:
    """Return the arguments of an option's property that say what it is."""
    return {
        "name": option.blender.label or property_name(option).replace("_", " ").title(),
        "description": option.blender.description or option.help[0].upper() + option.help[1:],
        "translation_context": CONTEXT,
    }


def choices_of(option: Option) -> tuple[Choice, ...]:
    """Return the choices of the property; empty if it is not an enumeration."""
    return option.blender.choices or option.choices


def limits_of(option: Option) -> tuple[float | None, float | None]:
    """Return the minimum and maximum of the property, in its own unit."""
    declared = option.blender
    same_unit = not option.blender.unit
    low = option.minimum if declared.minimum is None and same_unit else declared.minimum
    high = option.maximum if declared.maximum is None and same_unit else declared.maximum
    return low, high


def split(layout: UILayout) -> UILayout:
    """Set the layout to labels on the left and values on the right, and return it."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def draw_section(layout: UILayout, settings: PropertyGroup, section: Section) -> None:
    """Draw the properties of a section of the panel."""
    for option in options_at(Place.PANEL):
        if option.blender.section is section:
            layout.prop(settings, property_name(option))


def option_values(settings: Any, place: Place) -> dict[str, Any]:
    """Return the values of the worker's options whose properties are at ``place``.

    :param settings: object with these properties; None gives the defaults.
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
    return {"options": _NOT_ANIMATABLE} if place in Place.PANEL | Place.LIVE_PANEL else {}
