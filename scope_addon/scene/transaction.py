# SPDX-License-Identifier: GPL-3.0-or-later
"""Rolling back work that fails or is cancelled: new datablocks are removed, and changed ones are
restored.

Datablocks are restored in place, never replaced, and so is the content of an action: a failed
operator adds no step to undo, and Blender crashes when it undoes an earlier step in which another
datablock uses one that was replaced since. Removed datablocks cannot be restored, so code under a
transaction must remove them last.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from bpy.types import ID, Action, FCurve, Key, Object, Scene

from .actions import (
    assign_action,
    curve_owners,
    has_slots,
    read_modifiers,
    read_whole_keys,
    used_slot,
    write_modifiers,
    write_whole_keys,
)
from .datablocks import NewDatablocks, action_of, enter_object_mode
from .timing import action_strips, set_strip_ends, strip_ends
from .visibility import Selection

_SCENE = ("frame_start", "frame_end", "frame_preview_start", "frame_preview_end", "camera")
RENDER = ("fps", "fps_base", "resolution_x", "resolution_y", "pixel_aspect_x", "pixel_aspect_y")
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
_Curves = dict[tuple[str, int], FCurve]


@contextmanager
def all_or_nothing(
    scene: Scene, *objects: Object, keys: Sequence[Key] = (), actions: Sequence[Action] = ()
) -> Iterator[None]:
    """Roll back new datablocks, scene settings and changes of ``objects`` when the block raises;
    re-raise.

    :param objects: the block may change their keys, action, parent, transform and custom
        properties, the custom properties of their bones, and the animation of a camera's lens.
    :param keys: shape keys whose keyframes, action and values it may change.
    :param actions: further ones whose content it may change, whatever uses them.
    """
    unique = list(dict.fromkeys(objects))
    lenses = {obj.data for obj in unique if obj.type == "CAMERA" and obj.data.library is None}
    animated: list[_SavedAnimation | _SavedAction] = [
        *(_SavedAnimation(owner) for owner in (*unique, *lenses, *keys)),
        *map(_SavedAction, actions),
    ]
    values = [(block, block.value) for key in keys for block in key.key_blocks]
    new = NewDatablocks()
    settings = _SavedScene(scene)
    transforms = [_SavedTransform(obj) for obj in unique]
    try:
        yield
    except BaseException:
        enter_object_mode(settings.layer)
        for transform in transforms:
            transform.restore()
        for saved in animated:
            saved.restore()
        for block, value in values:
            block.value = value
        new.remove()
        settings.restore()
        raise
    for saved in animated:
        saved.discard_copy()


class _SavedScene:
    """A scene's settings and markers, the selection, and the active object's mode."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.layer = bpy.context.view_layer
        self._settings = {name: getattr(scene, name) for name in _SCENE}
        self._render = {name: getattr(scene.render, name) for name in RENDER}
        self._current = scene.frame_current, scene.frame_subframe
        self._selection = Selection(self.layer)
        self._markers = {m: (m.name, m.frame) for m in scene.timeline_markers}

    def restore(self) -> None:
        """Restore the scene; the new objects must have been removed."""
        scene = self._scene
        for marker in [m for m in scene.timeline_markers if m not in self._markers]:
            scene.timeline_markers.remove(marker)
        for marker, (name, frame) in self._markers.items():
            marker.name = name
            marker.frame = frame
        for name, value in self._render.items():
            setattr(scene.render, name, value)
        scene.frame_end = max(self._settings["frame_end"], scene.frame_start)
        for name, value in self._settings.items():
            setattr(scene, name, value)
        scene.frame_set(self._current[0], subframe=self._current[1])
        self._selection.restore(self.layer)
        self._selection.restore_mode()


class _SavedTransform:
    """An object's parent, transform and custom properties, and the custom properties of its
    bones.
    """

    def __init__(self, obj: Object) -> None:
        self._obj = obj
        self._parent = obj.parent
        self._parenting = obj.parent_type, obj.parent_bone
        self._matrices = obj.matrix_parent_inverse.copy(), obj.matrix_basis.copy()
        owners = [obj, *(obj.pose.bones if obj.pose else ())]
        self._properties = [(owner, _restorable(owner)) for owner in owners]

    def restore(self) -> None:
        """Restore the object."""
        obj = self._obj
        obj.parent = self._parent
        obj.parent_type, obj.parent_bone = self._parenting
        obj.matrix_parent_inverse, obj.matrix_basis = self._matrices
        for owner, properties in self._properties:
            for name in [name for name in _restorable(owner) if name not in properties]:
                del owner[name]
            for name, value in properties.items():
                owner[name] = value
        obj.update_tag()


class _SavedAction:
    """A copy of the content of an action in case the block changes it."""

    def __init__(self, action: Action) -> None:
        self._action = action
        self._fake_user = action.use_fake_user
        self._copy = action.copy()
        self._properties = _restorable(action)
        for name in self._properties:  # or the block could take the copy for another action of ours
            del self._copy[name]

    def restore(self) -> None:
        """Restore the content, for every object that it animates, and remove the copy."""
        restore_content(self._action, self._copy)
        for name, value in self._properties.items():
            self._action[name] = value
        self._action.use_fake_user = self._fake_user
        self.discard_copy()

    def discard_copy(self) -> None:
        """Remove the copy."""
        bpy.data.actions.remove(self._copy)


class _SavedAnimation:
    """The action assigned to an object, a lens or shape keys, with its content; the ends of its
    strips.
    """

    def __init__(self, obj: Object | bpy.types.Camera | Key) -> None:
        self._obj = obj
        data = obj.animation_data
        self._had_data = data is not None
        self._action = action_of(obj)
        self._slot = used_slot(data)
        self._content = _SavedAction(self._action) if self._action else None
        self._strips = [(s, strip_ends(s)) for s in action_strips(obj)]

    def restore(self) -> None:
        """Restore the action as it was, for every object that it animates."""
        if not self._had_data:
            self._obj.animation_data_clear()
            return
        data = self._obj.animation_data
        for strip, ends in self._strips:
            set_strip_ends(strip, ends)
        if self._action is None or self._content is None:
            data.action = None
            return
        self._content.restore()
        assign_action(data, self._action, self._slot)

    def discard_copy(self) -> None:
        """Remove the copy after success."""
        if self._content is not None:
            self._content.discard_copy()


def _restorable(owner: bpy.types.bpy_struct) -> dict[str, bool | int | float | str | ID]:
    """Return the custom properties that are single values or datablocks."""
    kinds = (bool, int, float, str, ID)
    return {name: owner[name] for name in owner.keys() if isinstance(owner[name], kinds)}


def restore_content(action: Action, copy: Action) -> None:
    """Give an action the curves of an earlier copy of it; curves that are the same are not touched.

    :param action: since the copy was made, it has lost no slot, layer or strip.
    """
    _remove_new_containers(action, copy)
    wanted = dict(curve_owners(copy))
    for place, owner in curve_owners(action):
        _restore_curves(owner, wanted[place])
    for name in _SETTINGS:
        if getattr(action, name) != getattr(copy, name):
            setattr(action, name, getattr(copy, name))


def _remove_new_containers(action: Action, copy: Action) -> None:
    """Remove the slots and layers, with their channelbags, that the copy does not have."""
    if not has_slots():
        return
    kept = {slot.handle for slot in copy.slots}
    for slot in [slot for slot in action.slots if slot.handle not in kept]:
        action.slots.remove(slot)
    for layer in list(action.layers)[len(copy.layers) :]:
        action.layers.remove(layer)
    places = {place for place, _ in curve_owners(copy)}
    for (row, column, _), bag in [
        (place, bag) for place, bag in curve_owners(action) if place not in places
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


def _restore_keys(curve: FCurve, source: FCurve) -> None:
    wanted = read_whole_keys(source)
    present = read_whole_keys(curve)
    if not all(np.array_equal(present[name], wanted[name]) for name in wanted):
        write_whole_keys(curve, wanted)
