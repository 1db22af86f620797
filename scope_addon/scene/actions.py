# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and writing keyframes and the modifiers of curves in bulk. Only this module depends on
how Blender stores them.

Since 4.4 an action holds layers -> strips -> one channelbag per slot, and each animated datablock
picks a slot. Before, an action held F-curves directly and served one type of datablock; 5.0 removed
that older interface. Writing whole coordinate arrays is 20 to 30 times faster than one
``keyframe_insert`` per key.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from bpy.types import ID, Action, AnimData, FCurve, Key, NlaStrip, Object, Scene
from bpy_extras import anim_utils
from numpy.typing import NDArray

from ..arrays import Float32Array, Float64Array
from ..errors import UsageError
from .datablocks import action_of, changed, shape_keys_of

# Values of Blender's keyframe interpolation enum, which foreach_set takes as integers.
INTERPOLATION = {"CONSTANT": 0, "LINEAR": 1, "BEZIER": 2}
_SAME_FRAME = 0.01  # Blender keeps one of two keys that are no farther apart, in frames
_POINTS = ("co", "handle_left", "handle_right")
# Properties of a key, by the number of their values and type.
_KEY = (
    *((name, 2, np.float32) for name in _POINTS),
    *((name, 1, np.float32) for name in ("amplitude", "back", "period")),
    *(
        (name, 1, np.int32)
        for name in ("interpolation", "easing", "type", "handle_left_type", "handle_right_type")
    ),
    *((f"select_{part}", 1, np.bool_) for part in ("control_point", "left_handle", "right_handle")),
)
_ENVELOPE_POINTS = "control_points"  # of an envelope


def has_slots() -> bool:
    """Return whether this Blender stores F-curves in slots and channelbags (4.4 and later)."""
    return "slots" in bpy.types.Action.bl_rna.properties


def used_slot(animation: AnimData | None) -> str:
    """Return the identifier of the slot by which a datablock uses its action; empty if there is
    none.
    """
    slot = getattr(animation, "action_slot", None)
    return slot.identifier if slot else ""


def assign_action(animation: AnimData, action: Action | None, slot: str) -> None:
    """Let an action animate a datablock, by its slot of an identifier that ``used_slot`` has
    returned; without one, by the slot that Blender chooses.
    """
    if animation.action != action:
        animation.action = action
    if action is not None and slot:
        animation.action_slot = next(each for each in action.slots if each.identifier == slot)


class Channels:
    """The F-curves of one datablock in one action."""

    def __init__(self, datablock: ID, action: Action) -> None:
        """Assign ``action`` to ``datablock`` (an object, a shape-key block, a camera's data, ...).

        In a Blender with slots, one action may serve several datablocks; otherwise, the second
        datablock gets a new action.
        """
        animation = datablock.animation_data or datablock.animation_data_create()
        if has_slots():
            slot = action.slots.new(id_type=datablock.id_type, name=datablock.name)
            animation.action = action
            animation.action_slot = slot
            self._owner = _channelbag(action, slot)
        else:
            if len(action.fcurves):
                action = bpy.data.actions.new(f"{action.name}_{datablock.id_type.lower()}")
            action.id_root = datablock.id_type
            animation.action = action
            self._owner = action
        self.action = action
        self._groups: dict[str, bpy.types.ActionGroup] = {}

    @classmethod
    def of(cls, datablock: ID) -> Channels:
        """Return the F-curves of a datablock in its action, to add some to them."""
        animation = datablock.animation_data
        if has_slots() and animation.action_slot is None:
            return cls(datablock, animation.action)
        out = cls.__new__(cls)
        out.action = animation.action
        out._owner = _channelbag(out.action, animation.action_slot) if has_slots() else out.action
        out._groups = {group.name: group for group in out._owner.groups}
        return out

    def remove(self, data_paths: Collection[str]) -> None:
        """Remove the F-curves of some properties."""
        for curve in [curve for curve in self._owner.fcurves if curve.data_path in data_paths]:
            self._owner.fcurves.remove(curve)
        # without those that are empty now
        self._groups = {group.name: group for group in self._owner.groups}

    def write(
        self,
        data_path: str,
        frames: Float64Array,
        values: Float64Array,
        interpolation: str = "LINEAR",
        group: str = "",
    ) -> list[FCurve]:
        """Write the keys of one property and return its curves, one per column.

        :param data_path: RNA path from the datablock, e.g. from ``bone_path``.
        :param frames: (T,) scene frames, increasing, fractions allowed.
        :param values: (T,) for a single number, (T, n) for a vector or quaternion.
        :param interpolation: a key of ``INTERPOLATION``, for every key.
        :param group: name under which the channel lists show the curves.
        """
        columns = values[:, None] if values.ndim == 1 else values
        curves = []
        for index in range(columns.shape[1]):
            curve = self._owner.fcurves.new(data_path, index=index)
            if group:
                curve.group = self._group(group)
            rewrite_keys(curve, frames, columns[:, index], interpolation)
            curves.append(curve)
        return curves

    def _group(self, name: str) -> bpy.types.ActionGroup:
        if name not in self._groups:
            self._groups[name] = self._owner.groups.new(name)
        return self._groups[name]


def _channelbag(action: Action, slot: bpy.types.ActionSlot) -> bpy.types.ActionChannelbag:
    """Return the F-curves of a slot, in a Blender with slots."""
    layer = action.layers[0] if action.layers else action.layers.new("Layer")
    strip = layer.strips[0] if layer.strips else layer.strips.new(type="KEYFRAME")
    return strip.channelbag(slot, ensure=True)


def bone_path(bone_name: str, channel: str) -> str:
    """Return the RNA path of a pose bone's channel; quotes and backslashes in the name are
    escaped.
    """
    return f'pose.bones["{bpy.utils.escape_identifier(bone_name)}"].{channel}'


def bone_property_path(bone_name: str, name: str) -> str:
    """Return the RNA path of a pose bone's custom property."""
    bone = bpy.utils.escape_identifier(bone_name)
    key = bpy.utils.escape_identifier(name)
    return f'pose.bones["{bone}"]["{key}"]'


def shape_key_path(key_name: str) -> str:
    """Return the RNA path of a shape key's value, from the shape-key block."""
    return f'key_blocks["{bpy.utils.escape_identifier(key_name)}"].value'


def fcurves(datablock: ID) -> list[FCurve]:
    """Return the F-curves that animate a datablock, in any supported Blender."""
    action = action_of(datablock)
    if action is None:
        return []
    return fcurves_in_slot(action, getattr(datablock.animation_data, "action_slot", None))


def fcurves_in_slot(action: Action, slot: bpy.types.ActionSlot | None) -> list[FCurve]:
    """Return the F-curves in a slot of an action, none without a slot; in a Blender without slots,
    every F-curve.
    """
    if not has_slots():
        return fcurves_of(action)
    handle = slot.handle if slot else None
    owners = [owner for place, owner in curve_owners(action) if place[-1] == handle]
    return [curve for owner in owners for curve in owner.fcurves]


def fcurves_of(action: Action) -> list[FCurve]:
    """Return every F-curve of an action, whatever it animates, in any supported Blender."""
    return [curve for _, owner in curve_owners(action) for curve in owner.fcurves]


def curve_owners(action: Action) -> Iterator[tuple[tuple[int, int, int], Any]]:
    """Yield what has ``fcurves`` and ``groups``, with its place: the channelbag of each slot, with
    the numbers of its layer and strip and the slot's handle; without slots, the action itself.
    """
    if not has_slots():
        yield (0, 0, 0), action
        return
    for row, layer in enumerate(action.layers):
        for column, strip in enumerate(layer.strips):
            for bag in strip.channelbags:
                yield (row, column, bag.slot_handle), bag


def read_keys(curve: FCurve) -> Float32Array:
    """Return (T, 2): frame and value of each key."""
    coordinates = np.empty(2 * len(curve.keyframe_points), np.float32)
    curve.keyframe_points.foreach_get("co", coordinates)
    return coordinates.reshape(-1, 2)


def values_between_keys(curve: FCurve, frames: Float64Array) -> Float64Array:
    """Evaluate a curve at frames (T,) as its keys and their repetition have it, without its other
    modifiers: these are added to whatever keys are written from the values.
    """
    with changed([m for m in curve.modifiers if m.type != "CYCLES"], mute=True):
        return np.array([curve.evaluate(frame) for frame in frames])


def rewrite_keys(
    curve: FCurve, frames: Float64Array, values: Float64Array, interpolation: str = "LINEAR"
) -> None:
    """Replace the keys of a curve.

    :param frames: (T,) scene frames, increasing.
    :param values: (T,) in the unit of the property.
    :param interpolation: a key of ``INTERPOLATION``, for every key.
    """
    keys = curve.keyframe_points
    keys.clear()
    keys.add(len(frames))
    keys.foreach_set("co", np.stack([frames, values], axis=1).astype(np.float32).ravel())
    keys.foreach_set("interpolation", np.full(len(frames), INTERPOLATION[interpolation], np.int32))
    curve.update()


def change_keys(curve: FCurve, frames: Float64Array, values: Float64Array) -> None:
    """Change the values of a curve's keys at some frames, and add those that are missing; other
    keys stay as they are.

    As where Blender inserts a key, one within a hundredth of a frame counts as being at the frame.

    :param frames: (T,) scene frames, increasing.
    :param values: (T,) in the unit of the property.
    """
    keys = curve.keyframe_points
    coordinates = read_keys(curve)
    wanted = frames.astype(np.float32)
    after = np.searchsorted(coordinates[:, 0], wanted)
    around = np.clip(np.stack([after, after - 1]), 0, len(coordinates) - 1)
    off = np.abs(coordinates[around, 0] - wanted)
    at = np.where(off[0] <= off[1], *around)
    present = off.min(axis=0) <= _SAME_FRAME
    coordinates[at[present], 1] = values[present]
    keys.foreach_set("co", coordinates.ravel())
    if not present.all():
        _insert_keys(curve, np.stack([wanted, values], axis=1)[~present].astype(np.float32))
    curve.update()


def _insert_keys(curve: FCurve, new: Float32Array) -> None:
    """Insert keys (N, 2), frame and value, in linear time: Blender moves all later ones for each
    key that it inserts.

    It inserts the first, which the others resemble; all between keys that are smooth, whose handles
    it changes.
    """
    is_smooth = read_whole_keys(curve)["interpolation"].max() >= INTERPOLATION["BEZIER"]
    by_blender, others = np.split(new, [len(new) if is_smooth else 1])
    for key in by_blender.tolist():
        curve.keyframe_points.insert(*key, options={"FAST"}).interpolation = "LINEAR"
    if not len(others):
        return
    whole = read_whole_keys(curve)
    frames = whole["co"][:, 0]
    first = int(np.searchsorted(frames, new[0, 0]))
    places = np.searchsorted(frames, others[:, 0])
    for name, rows in whole.items():
        whole[name] = np.insert(rows, places, others if name in _POINTS else rows[first], axis=0)
    write_whole_keys(curve, whole)


def read_whole_keys(curve: FCurve) -> dict[str, NDArray[Any]]:
    """Return every property of a curve's keys by its name, (T, n)."""
    keys = curve.keyframe_points
    found = {name: np.empty((len(keys), count), kind) for name, count, kind in _KEY}
    for name, rows in found.items():
        keys.foreach_get(name, rows.ravel())
    return found


def write_whole_keys(curve: FCurve, whole: dict[str, NDArray[Any]]) -> None:
    """Replace the keys of a curve by those with these properties (T, n), in their frames' order."""
    keys = curve.keyframe_points
    keys.clear()
    keys.add(len(whole["co"]))
    for name, rows in whole.items():
        keys.foreach_set(name, rows.ravel())
    curve.update()


def add_cycles(datablock: ID, offset_curves: set[tuple[str, int]] | None = None) -> None:
    """Make every curve of a datablock cyclic; its other modifiers stay, after the cycles, which
    must come first.

    :param offset_curves: data paths and indices of the curves to which each cycle adds an offset.
    """
    remove_cycles(datablock)
    for curve in fcurves(datablock):
        mode = (
            "REPEAT_OFFSET"
            if (curve.data_path, curve.array_index) in (offset_curves or set())
            else "REPEAT"
        )
        repeat_curve(curve, mode)


def repeat_curve(curve: FCurve, mode: str = "REPEAT") -> None:
    """Make a curve without cycles cyclic."""
    cycles = {"type": "CYCLES", "mode_before": mode, "mode_after": mode}
    write_modifiers(curve, [cycles, *read_modifiers(curve)])


def is_cyclic(datablock: ID) -> bool:
    """Return whether a curve of a datablock repeats."""
    return any(m.type == "CYCLES" for curve in fcurves(datablock) for m in curve.modifiers)


def remove_cycles(datablock: ID) -> None:
    """Remove the cycles from every curve of a datablock."""
    for curve in fcurves(datablock):
        for modifier in [m for m in curve.modifiers if m.type == "CYCLES"]:
            curve.modifiers.remove(modifier)


def nla_strips(datablock: ID) -> list[NlaStrip]:
    """Return the NLA strips in effect for a datablock; none in Tweak Mode, where one strip plays
    alone.
    """
    animation = datablock.animation_data
    if animation is None or not animation.use_nla or animation.use_tweak_mode:
        return []
    alone = any(track.is_solo for track in animation.nla_tracks)
    tracks = [
        track for track in animation.nla_tracks if (track.is_solo if alone else not track.mute)
    ]
    return [strip for track in tracks for strip in track.strips if not strip.mute]


def nla_fcurves(datablock: ID) -> list[FCurve]:
    """Return the F-curves in the NLA strips in effect for a datablock, also within meta strips."""
    curves = []
    strips = nla_strips(datablock)
    while strips:
        strip = strips.pop()
        strips += strip.strips
        if strip.action is not None:
            curves += fcurves_in_slot(strip.action, getattr(strip, "action_slot", None))
    return curves


def animated_together(armature: Object, root: Object | None) -> list[ID]:
    """Return an armature with an action, and of its root object and the shape keys of its meshes
    those that move.
    """
    others = [*filter(None, [root]), *shape_keys_of(armature)]
    moving = [
        block
        for block in others
        if block.library is None and any(len(curve.keyframe_points) > 1 for curve in fcurves(block))
    ]
    return [armature, *moving]


def push_to_nla(datablock: ID) -> NlaStrip:
    """Move the action of a datablock to a strip on a new NLA track, at the frames of its keys.

    :param datablock: with an action, and not in the NLA's Tweak Mode.
    """
    animation = datablock.animation_data
    action = animation.action
    slot = getattr(animation, "action_slot", None)
    first, last = action.frame_range
    track = animation.nla_tracks.new()
    track.name = action.name
    strip = track.strips.new(action.name, int(first), action)
    if slot is not None:
        strip.action_slot = slot
    # keys may lie between whole frames
    strip.frame_end = last
    strip.frame_start = first
    animation.action = None
    return strip


def check_not_in_nla(datablock: ID) -> None:
    """Check that keys that are missing in the action of a datablock are not in its NLA, where they
    are not read.

    :raises UsageError: they may be.
    """
    tracks = datablock.animation_data.nla_tracks if datablock.animation_data else ()
    if strips := [strip for track in tracks for strip in track.strips]:
        raise UsageError(
            f"'{datablock.name}' is animated by the NLA strip '{strips[0].name}', not by an action "
            "of its own alone: "
            "enter Tweak Mode on the strip (Tab), choose its action in the Action Editor again, or "
            "bake all strips "
            "into one action (Bake Action)"
        )


def check_not_moved_by_nla(datablock: ID) -> None:
    """Check that the NLA plays the keys of a datablock at their own frames.

    :raises UsageError: it is in Tweak Mode, on a strip that is elsewhere or plays at another speed.
    """
    animation = datablock.animation_data
    if animation is None or not animation.use_tweak_mode or animation.action is None:
        return
    own = tuple(animation.action.frame_range)
    played = tuple(animation.nla_tweak_strip_time_to_scene(frame) for frame in own)
    if np.abs(np.subtract(played, own)).max() > _SAME_FRAME:
        raise UsageError(
            f"'{datablock.name}' is in the NLA's Tweak Mode on a strip that plays frames "
            f"{own[0]:g} to {own[1]:g} of its action at {played[0]:g} to {played[1]:g}: set the "
            f"strip's start to {own[0]:g} and its end to {own[1]:g}; after this change, it can be "
            "moved again"
        )


@contextmanager
def nla_as_actions(scene: Scene) -> Iterator[None]:
    """Bake the NLA of the scene's objects and shape keys to new actions for the duration of the
    block, on whole frames.
    """
    options = anim_utils.BakeOptions(
        only_selected=False,
        do_pose=True,
        do_object=True,
        do_visual_keying=False,
        do_constraint_clear=False,
        do_parents_clear=False,
        do_clean=False,
        do_location=True,
        do_rotation=True,
        do_scale=True,
        do_bbone=False,
        do_custom_props=False,
    )
    blended = [obj for obj in scene.objects if nla_strips(obj)]
    blocks = {
        obj.data.shape_keys for obj in scene.objects if obj.type == "MESH" and obj.data.shape_keys
    }
    shaped = [keys for keys in blocks if nla_strips(keys)]
    animations = [datablock.animation_data for datablock in (*blended, *shaped)]
    kept = [(a, a.action, used_slot(a), a.action_blend_type) for a in animations]
    try:
        frames = range(scene.frame_start, scene.frame_end + 1)
        # an object without bones disables do_pose for all objects that share the options
        for posed in (True, False):
            pairs = [(obj, None) for obj in blended if (obj.pose is not None) is posed]
            if pairs:
                anim_utils.bake_action_objects(pairs, frames=frames, bake_options=options)
        for keys, values in shape_key_values(scene, shaped, frames).items():
            key_shape_keys(keys, frames, values)
        for animation in animations:
            animation.use_nla = False
        yield
    finally:
        for animation, action, slot, blend_type in kept:
            animation.use_nla = True
            assign_action(animation, action, slot)
            animation.action_blend_type = blend_type


def shape_key_values(scene: Scene, shaped: Iterable[Key], frames: range) -> dict[Key, Float32Array]:
    """Return the values (T, keys), without the basis, that shape keys show at T scene frames."""
    shown = {keys: np.empty((len(frames), len(keys.key_blocks) - 1), np.float32) for keys in shaped}
    for row, frame in enumerate(frames if shown else ()):
        scene.frame_set(frame)
        evaluated = bpy.context.evaluated_depsgraph_get()
        for keys, values in shown.items():
            values[row] = [block.value for block in keys.evaluated_get(evaluated).key_blocks[1:]]
    return shown


def key_shape_keys(keys: Key, frames: range, values: Float32Array) -> None:
    """Give shape keys an action with the values of ``shape_key_values``."""
    channels = Channels(keys, bpy.data.actions.new(keys.name))
    for name, column in zip(keys.key_blocks.keys()[1:], values.T, strict=True):
        channels.write(shape_key_path(name), np.array(frames, float), column)


def frame_range(datablocks: Iterable[ID]) -> tuple[float, float] | None:
    """Return the first and last keyed frame over the datablocks' curves and NLA strips; None
    without keys.

    Curves of custom properties are ignored unless there are no others: a loop leaves them longer
    than the motion. So are strips of which the active action replaces all that moves.
    """
    datablocks = list(datablocks)
    curves = [
        curve
        for datablock in datablocks
        for curve in fcurves(datablock)
        if len(curve.keyframe_points)
    ]
    moving = [curve for curve in curves if not curve.data_path.endswith('"]')] or curves
    spans = [tuple(curve.range()) for curve in moving]
    spans += [
        (strip.frame_start, strip.frame_end)
        for datablock in datablocks
        for strip in nla_strips(datablock)
        if not _is_replaced(strip, datablock)
    ]
    if not spans:
        return None
    return min(s[0] for s in spans), max(s[1] for s in spans)


def _is_replaced(strip: NlaStrip, datablock: ID) -> bool:
    """Return whether a datablock's active action replaces all that moves in an NLA strip."""
    animation = datablock.animation_data
    replaces = (
        animation.action_blend_type == "REPLACE"
        and animation.action_extrapolation != "NOTHING"
        and animation.action_influence == 1.0
    )
    own = {(curve.data_path, curve.array_index) for curve in fcurves(datablock) if not curve.mute}
    if strip.action is None or not replaces or not own:
        return False
    moving = [
        curve
        for curve in fcurves_in_slot(strip.action, getattr(strip, "action_slot", None))
        if len(curve.keyframe_points) and np.ptp(read_keys(curve)[:, 1]) > 0.0
    ]
    return all((curve.data_path, curve.array_index) in own for curve in moving)


def read_modifiers(curve: FCurve) -> list[dict[str, Any]]:
    """Return the type and the settings of each modifier of a curve."""
    return [{"type": modifier.type, **_settings(modifier)} for modifier in curve.modifiers]


def write_modifiers(curve: FCurve, wanted: list[dict[str, Any]]) -> None:
    """Replace the modifiers of a curve.

    :param wanted: from ``read_modifiers``. Cycles must come first, if at all.
    """
    for modifier in list(curve.modifiers):
        curve.modifiers.remove(modifier)
    for values in wanted:
        modifier = curve.modifiers.new(values["type"])
        points = values.get(_ENVELOPE_POINTS, ())
        for frame, _, _ in points:
            modifier.control_points.add(frame)
        # Blender 5.2 can crash when one point's value is assigned; foreach_set calls no update
        if points:
            modifier.control_points.foreach_set("min", [low for _, low, _ in points])
            modifier.control_points.foreach_set("max", [high for _, _, high in points])
        for _ in range(2):  # some settings are limited by others
            for name, value in values.items():
                if name not in ("type", "active", _ENVELOPE_POINTS):
                    setattr(modifier, name, value)
    for modifier, values in zip(curve.modifiers, wanted, strict=True):
        if values.get("active"):  # a new modifier takes this from the others
            modifier.active = True


def _settings(modifier: bpy.types.FModifier) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for prop in modifier.bl_rna.properties:
        value = getattr(modifier, prop.identifier)
        if prop.identifier == _ENVELOPE_POINTS:
            found[_ENVELOPE_POINTS] = [(point.frame, point.min, point.max) for point in value]
        elif not prop.is_readonly:
            found[prop.identifier] = tuple(value) if getattr(prop, "is_array", False) else value
    return found
