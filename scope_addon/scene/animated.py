# SPDX-License-Identifier: GPL-3.0-or-later
"""What is animated in a scene, by keys or strips: another frame rate changes its speed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy

from .actions import fcurves
from .capture_parts import parts_of
from .character.root_object import root_object
from .datablocks import action_of, captures_of, with_data
from .footage_strip import is_footage, strips_of
from .rig_action import is_retargeted
from .timing import action_strips


def is_animated(scene: bpy.types.Scene) -> bool:
    """Return whether anything in a scene is animated, captures included."""
    return _is_itself_animated(scene) or any(map(_has_keys, _blocks_of(scene.objects)))


def other_animation(
    scene: bpy.types.Scene,
    people: Iterable[bpy.types.Object],
    rigs: Iterable[tuple[bpy.types.Object, object]],
) -> bool:
    """Return whether anything else in the scene is animated, which keeps its frames at another
    rate.

    :param people: every captured armature of the scene.
    :param rigs: those that captured motion was retargeted to, each with its captured armature.
    """
    moved = {obj for collection in captures_of(scene) for obj in parts_of(collection)}
    moved |= {obj for person in people for obj in (person, root_object(person))}
    moved |= {obj for rig, _ in rigs for obj in (rig, root_object(rig))}
    others = _blocks_of(obj for obj in scene.objects if obj not in moved)
    return _is_itself_animated(scene) or any(_has_keys(block, retargeted=False) for block in others)


def _is_itself_animated(scene: bpy.types.Scene) -> bool:
    """Return whether a scene has strips in its sequencer, or its settings, compositing or world are
    animated. Footage that was added to the sequencer for a capture does not count.
    """
    editor = scene.sequence_editor
    if editor is not None and not all(map(is_footage, strips_of(editor))):
        return True
    return any(map(_has_keys, _with_trees([scene, scene.world])))


def _blocks_of(objects: Iterable[bpy.types.Object]) -> set[bpy.types.ID]:
    """Return objects with what they are made of: data, shape keys, materials, nodes."""
    found: list[bpy.types.ID | None] = []
    for obj in objects:
        found += with_data(obj)
        found += [slot.material for slot in obj.material_slots]
        found += [getattr(modifier, "node_group", None) for modifier in obj.modifiers]
        found += [system.settings for system in obj.particle_systems]
    return set(_with_trees(dict.fromkeys(found)))


def _with_trees(blocks: Iterable[bpy.types.ID | None]) -> Iterator[bpy.types.ID]:
    """Yield datablocks, their node trees, and the groups within these."""
    waiting = [block for block in blocks if block is not None]
    seen: set[bpy.types.ID] = set()
    while waiting:
        block = waiting.pop()
        if block in seen:
            continue
        seen.add(block)
        yield block
        # of a scene, the latter since Blender 5.0
        trees = [getattr(block, name, None) for name in ("node_tree", "compositing_node_group")]
        trees += [getattr(node, "node_tree", None) for node in getattr(block, "nodes", ())]
        waiting += [tree for tree in trees if tree is not None]


def _has_keys(block: bpy.types.ID, *, retargeted: bool = True) -> bool:
    """Return whether an action or a strip animates a datablock.

    :param retargeted: count actions that retargeting has written.
    """
    actions = [strip.action for strip in action_strips(block)]
    if fcurves(block):
        actions.append(action_of(block))
    return any(retargeted or not is_retargeted(action) for action in actions)
