# SPDX-License-Identifier: GPL-3.0-or-later
"""Changing a scene's frame rate while the captures in it keep their speed.

Keys lie at ``start + timestamp · rate``. For another rate, everything of a capture moves to ``start
+ (frame - start) · new / old``: keys, NLA strips, cycles, the camera and its footage, review frames
and markers, and rigs that the motion was retargeted to. So each capture still starts at its frame.
Other animation keeps its frames, as when Blender's own setting is changed, and plays faster or
slower; whether there is any, by keys or strips, is said here too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator

import bpy
from bpy.types import ID, Action, Object, Scene

from ..motion import Motion
from ..notices import Notice
from . import timing
from .actions import fcurves, fcurves_in_slot, frame_range
from .camera import same_camera, show_footage_again
from .character.body_mesh import has_expression_keys, shape_key_name
from .character.correction_list import store_corrections
from .character.other_curves import MARKER_NAMES
from .character.root_object import retime_unused_trajectory, root_object
from .datablocks import (
    MARKERS,
    action_of,
    cameras_in,
    captures_of,
    holds,
    parts_of,
    shape_keys_of,
    view_number,
    with_data,
)
from .face_retarget import faces_of
from .footage_strip import is_footage, strips_of
from .rig_action import is_retargeted, retime_written_keys
from .stored_values import FrameSpan, parse_spans, source_of, start_frame, stored_text
from .timing import Retiming, action_strips, played_actions, retime_keys, retime_strip

_MARKER = re.compile(rf"((?:person \d+ )?(?:{'|'.join(MARKER_NAMES.values())})) (\S+)")

# The actions whose keys were moved, each with the handle of the slot.
_Done = set[tuple[Action, int]]
_ALL_SLOTS = -1


def change_rate(
    scene: Scene,
    rate: float,
    people: dict[Object, Motion | None],
    rigs: Iterable[tuple[Object, Object]],
) -> list[Notice]:
    """Set the scene's frame rate, and move the captures in time so that they keep their speed.

    :param rate: frames per second.
    :param people: every captured armature of the scene with its motion, None where that is lost.
    :param rigs: rigs that captured motion was retargeted to, each with its captured armature.
    :return: warnings about footage that will not align.
    :raises UsageError: when Blender cannot store the rate.
    """
    timing.blender_rate(rate)
    moves = {p: Retiming(start_frame(p), rate / timing.keyed_rate(p, scene)) for p in people}
    own = {p: frame_range([p]) for p in people}
    played = _played(scene, people)
    done: _Done = set()
    # each once, as duplicates of a person share the root object
    blocks = {block: moves[person] for person in people for block in _datablocks(person)}
    roots = {root_object(person): moves[person] for person in people}
    for datablock, retiming in blocks.items():
        _retime(datablock, retiming, done)
    for root, retiming in roots.items():
        if root is not None:
            retime_unused_trajectory(root, retiming)
    sources = {person.name: retiming for person, retiming in moves.items()}
    for rig, person in rigs:
        _retime_rig(rig, moves[person], sources, done)
    _retime_faces(scene, moves, sources)
    _retime_written_actions(sources, done)
    for collection in captures_of(scene):
        here = [person for person in people if holds(collection, person)]
        for camera in cameras_in(collection) if here else ():
            _retime(camera, moves[here[0]], done)
            _retime(camera.data, moves[here[0]], done)  # Its lens may zoom.
    _retime_markers(scene, own, moves)
    current = scene.frame_float
    first = next(iter(moves.values()), Retiming(0.0, 1.0))
    timing.set_scene_rate(scene, rate)
    for person, retiming in moves.items():
        timing.retime_cycle(scene, person, retiming)
        timing.store_rate(person, rate)
        motion = people[person]
        if motion is not None and motion.corrections:
            store_corrections(person, motion, rate)
    if (after := frame_range(played)) is not None:
        timing.set_frame_range(scene, *after)
    warnings = _show_footage(scene, people, rate)
    scene.frame_set(round(first.frame(current)))
    return warnings


def retimed(spans: Iterable[FrameSpan], retiming: Retiming) -> list[FrameSpan]:
    """Move spans in time."""
    return [
        FrameSpan(round(retiming.frame(span.first)), round(retiming.frame(span.last)))
        for span in spans
    ]


def _played(scene: Scene, people: Iterable[Object]) -> list[Object]:
    """Return the people of the capture whose keys the scene's frame range spans; none if it is
    another range.
    """
    people = list(people)
    for together in [
        people,
        *([p for p in people if holds(c, p)] for c in scene.collection.children),
    ]:
        span = frame_range(together)
        if span and (math.floor(span[0]), math.ceil(span[1])) == (
            scene.frame_start,
            scene.frame_end,
        ):
            return together
    return []


def _datablocks(person: Object) -> list[ID]:
    """Return what a capture animates of a person: armature, root motion, and shape keys."""
    shapes = [
        keys
        for keys in shape_keys_of(person)
        if shape_key_name(0) in keys.key_blocks or has_expression_keys(keys)
    ]
    return [person, *filter(None, [root_object(person)]), *shapes]


def _retime(datablock: ID, retiming: Retiming, done: _Done) -> None:
    animation = datablock.animation_data
    if animation is None:
        return
    strips = action_strips(datablock)
    for strip in strips:
        retime_strip(strip, retiming)
    for user in [animation, *strips]:
        if user.action is None:
            continue
        slot = getattr(user, "action_slot", None)
        is_written = is_retargeted(user.action)
        used = user.action, _ALL_SLOTS if is_written or slot is None else slot.handle
        if used in done:
            continue
        done.add(used)
        if is_written:
            retime_written_keys(user.action, retiming)
        else:
            retime_keys(fcurves_in_slot(user.action, slot), retiming)


def _retime_faces(scene: Scene, people: Iterable[Object], sources: dict[str, Retiming]) -> None:
    """Move the strips by which shape keys of the user's meshes play what retargeting has written;
    the actions are not moved.

    :param people: captured armatures, whose own shape keys are left out.
    :param sources: of every capture, by the name of its armature.
    """
    moved = {keys for person in people for keys in _datablocks(person)}
    for face in faces_of(scene.objects):
        keys = face.data.shape_keys
        if keys in moved or keys.library is not None:
            continue
        for strip in action_strips(keys):
            if _is_written_here(strip.action) and source_of(strip.action) in sources:
                retime_strip(strip, sources[source_of(strip.action)])


def _retime_written_actions(sources: dict[str, Retiming], done: _Done) -> None:
    """Move the keys of the other actions that retargeting has written, used or not.

    :param sources: of every capture, by the name of its armature.
    """
    for action in bpy.data.actions:
        if (
            (action, _ALL_SLOTS) not in done
            and _is_written_here(action)
            and source_of(action) in sources
        ):
            done.add((action, _ALL_SLOTS))
            retime_written_keys(action, sources[source_of(action)])


def _retime_rig(rig: Object, retiming: Retiming, sources: dict[str, Retiming], done: _Done) -> None:
    """Move the keys that retargeting has written, also of captures other than the one that the rig
    has now, and the strips that play them; the rig's other actions stay, and those of a library,
    whose keys Blender does not change.

    :param retiming: of the capture that the rig was retargeted to last.
    :param sources: of every capture, by the name of its armature.
    """
    for strip in action_strips(rig):
        if _is_written_here(strip.action):
            retime_strip(strip, sources.get(source_of(strip.action), retiming))
    written = {action for action in played_actions(rig) if _is_written_here(action)}
    moved = {action for action in written if (action, _ALL_SLOTS) not in done}
    for action in moved:
        done.add((action, _ALL_SLOTS))
        retime_written_keys(action, sources.get(source_of(action), retiming))
    if not moved:
        return
    if (root := root_object(rig)) is not None:
        retime_unused_trajectory(root, retiming)
        _retime(root, retiming, done)


def _is_written_here(action: Action) -> bool:
    """Return whether retargeting has written an action that this file stores."""
    return action.library is None and is_retargeted(action)


def _retime_markers(
    scene: Scene, ranges: dict[Object, tuple[float, float] | None], moves: dict[Object, Retiming]
) -> None:
    """Move the markers of review spans, which are named after them, with the capture in whose keys
    they lie.
    """
    for marker in scene.timeline_markers:
        found = _MARKER.fullmatch(marker.name)
        inside = [
            p for p, span in ranges.items() if span and span[0] - 1 <= marker.frame <= span[1] + 1
        ]
        spans = parse_spans(found[2]) if found else []
        if found is None or [span.first for span in spans] != [marker.frame] or not inside:
            continue
        (moved,) = retimed(spans, moves[inside[-1]])
        former = marker.name
        marker.name = f"{found[1]} {moved}"
        marker.frame = moved.first
        _rename_marker(scene, inside[-1], former, marker.name)


def _rename_marker(scene: Scene, person: Object, former: str, name: str) -> None:
    """Let the capture of a person know a marker by its new name, to remove it with the capture."""
    for collection in captures_of(scene):
        names = stored_text(collection, MARKERS).split("\n")
        if holds(collection, person) and former in names:
            names[names.index(former)] = name
            collection[MARKERS] = "\n".join(names)


def _show_footage(scene: Scene, people: dict[Object, Motion | None], rate: float) -> list[Notice]:
    """Show the footage of every capture's cameras in step with the moved keys."""
    warnings: list[Notice] = []
    for collection in captures_of(scene):
        seen: list[Motion] = []
        every_camera = cameras_in(collection)
        cameras = [obj for obj in every_camera if view_number(obj) is None]
        for person, motion in people.items():
            if (
                motion is None
                or not holds(collection, person)
                or any(same_camera(motion, m) for m in seen)
            ):
                continue
            if len(seen) < len(cameras):
                frames = timing.key_frames(motion.timestamps, rate, start_frame(person))
                warnings += show_footage_again(cameras[len(seen)], motion, frames)
                for view in every_camera:
                    number = view_number(view)
                    if number is not None and number < motion.view_count:
                        warnings += show_footage_again(view, motion.from_view(number), frames)
            seen.append(motion)
    return warnings


def is_animated(scene: Scene) -> bool:
    """Return whether anything in a scene is animated, captures included."""
    return _is_itself_animated(scene) or any(map(_has_keys, _blocks_of(scene.objects)))


def other_animation(
    scene: Scene, people: Iterable[Object], rigs: Iterable[tuple[Object, object]]
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


def _is_itself_animated(scene: Scene) -> bool:
    """Return whether a scene has strips in its sequencer, or its settings, compositing or world are
    animated. Footage that was added to the sequencer for a capture does not count.
    """
    editor = scene.sequence_editor
    if editor is not None and not all(map(is_footage, strips_of(editor))):
        return True
    return any(map(_has_keys, _with_trees([scene, scene.world])))


def _blocks_of(objects: Iterable[Object]) -> set[ID]:
    """Return objects with what they are made of: data, shape keys, materials, nodes."""
    found: list[ID | None] = []
    for obj in objects:
        found += with_data(obj)
        found += [slot.material for slot in obj.material_slots]
        found += [getattr(modifier, "node_group", None) for modifier in obj.modifiers]
        found += [system.settings for system in obj.particle_systems]
    return set(_with_trees(dict.fromkeys(found)))


def _with_trees(blocks: Iterable[ID | None]) -> Iterator[ID]:
    """Yield datablocks, their node trees, and the groups within these."""
    waiting = [block for block in blocks if block is not None]
    seen: set[ID] = set()
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


def _has_keys(block: ID, *, retargeted: bool = True) -> bool:
    """Return whether an action or a strip animates a datablock.

    :param retargeted: count actions that retargeting has written.
    """
    actions = [strip.action for strip in action_strips(block)]
    if fcurves(block):
        actions.append(action_of(block))
    return any(retargeted or not is_retargeted(action) for action in actions)
