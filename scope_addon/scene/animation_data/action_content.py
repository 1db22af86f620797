# SPDX-License-Identifier: GPL-3.0-or-later
"""Restoring the content of an action from an earlier copy of it, in place.

Replacing the action by its copy would be simpler, but a failed operator adds no step to undo: the
earlier steps contain the action and not the copy, and Blender crashes when one of them is undone.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np

from .actions import has_slots, read_whole_keys, write_whole_keys
from .fcurve_modifiers import read_modifiers, write_modifiers

_SETTINGS = ("use_frame_range", "use_cyclic", "frame_start", "frame_end")
_CURVE = (
    "extrapolation",
    "color_mode",
    "color",
    "select",
    "mute",
    "lock",
    "hide",
    "auto_smoothing",
)
_Curves = dict[tuple[str, int], bpy.types.FCurve]


def restore_content(action: bpy.types.Action, copy: bpy.types.Action) -> None:
    """Give an action the curves of an earlier copy of it; curves that are the same are not touched.

    :param action: since the copy was made, it has lost no slot, layer or strip.
    """
    _remove_new_containers(action, copy)
    wanted = dict(_owners(copy))
    for place, owner in _owners(action):
        _restore_curves(owner, wanted[place])
    for name in _SETTINGS:
        if getattr(action, name) != getattr(copy, name):
            setattr(action, name, getattr(copy, name))


def _owners(action: bpy.types.Action) -> Iterator[tuple[tuple[int, int, int], Any]]:
    """Yield what has ``fcurves`` and ``groups``, with its place: the action itself, or the
    channelbag of each slot.
    """
    if not has_slots():
        yield (0, 0, 0), action
        return
    for row, layer in enumerate(action.layers):
        for column, strip in enumerate(layer.strips):
            for bag in strip.channelbags:
                yield (row, column, bag.slot_handle), bag


def _remove_new_containers(action: bpy.types.Action, copy: bpy.types.Action) -> None:
    """Remove the slots and layers, with their channelbags, that the copy does not have."""
    if not has_slots():
        return
    kept = {slot.handle for slot in copy.slots}
    for slot in [slot for slot in action.slots if slot.handle not in kept]:
        action.slots.remove(slot)
    for layer in list(action.layers)[len(copy.layers) :]:
        action.layers.remove(layer)
    places = {place for place, _ in _owners(copy)}
    for (row, column, _), bag in [
        (place, bag) for place, bag in _owners(action) if place not in places
    ]:
        action.layers[row].strips[column].channelbags.remove(bag)


def _restore_curves(owner: Any, wanted: Any) -> None:
    present: _Curves = {(c.data_path, c.array_index): c for c in owner.fcurves}
    before: _Curves = {(c.data_path, c.array_index): c for c in wanted.fcurves}
    for key in present.keys() - before.keys():
        owner.fcurves.remove(present[key])
    for key, source in before.items():
        curve = present.get(key)
        if curve is None:
            curve = owner.fcurves.new(source.data_path, index=source.array_index)
            for name in _CURVE:
                setattr(curve, name, getattr(source, name))
            if source.group is not None:
                group = source.group.name
                curve.group = owner.groups.get(group) or owner.groups.new(group)
        _restore_keys(curve, source)
        if read_modifiers(curve) != (modifiers := read_modifiers(source)):
            write_modifiers(curve, modifiers)


def _restore_keys(curve: bpy.types.FCurve, source: bpy.types.FCurve) -> None:
    wanted = read_whole_keys(source)
    present = read_whole_keys(curve)
    if not all(np.array_equal(present[name], wanted[name]) for name in wanted):
        write_whole_keys(curve, wanted)
