# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading the modifiers of a curve as values, and making modifiers from such values."""

from __future__ import annotations

from typing import Any

import bpy

_POINTS = "control_points"  # of an envelope


def read_modifiers(curve: bpy.types.FCurve) -> list[dict[str, Any]]:
    """Return the type and the settings of each modifier of a curve."""
    return [{"type": modifier.type, **_settings(modifier)} for modifier in curve.modifiers]


def write_modifiers(curve: bpy.types.FCurve, wanted: list[dict[str, Any]]) -> None:
    """Replace the modifiers of a curve.

    :param wanted: from ``read_modifiers``. Cycles must come first, if at all.
    """
    for modifier in list(curve.modifiers):
        curve.modifiers.remove(modifier)
    for values in wanted:
        modifier = curve.modifiers.new(values["type"])
        points = values.get(_POINTS, ())
        for frame, _, _ in points:
            modifier.control_points.add(frame)
        # Blender 5.2 can crash when one point's value is assigned; foreach_set calls no update
        if points:
            modifier.control_points.foreach_set("min", [low for _, low, _ in points])
            modifier.control_points.foreach_set("max", [high for _, _, high in points])
        for _ in range(2):  # some settings are limited by others
            for name, value in values.items():
                if name not in ("type", "active", _POINTS):
                    setattr(modifier, name, value)
    for modifier, values in zip(curve.modifiers, wanted, strict=True):
        if values.get("active"):  # a new modifier takes this from the others
            modifier.active = True


def _settings(modifier: bpy.types.FModifier) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for prop in modifier.bl_rna.properties:
        value = getattr(modifier, prop.identifier)
        if prop.identifier == _POINTS:
            found[_POINTS] = [(point.frame, point.min, point.max) for point in value]
        elif not prop.is_readonly:
            found[prop.identifier] = tuple(value) if getattr(prop, "is_array", False) else value
    return found
