# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo and redo every operator of the panel in a Blender with a window: the file must be the same as before.

Usage: ``blender --python undo.py -- VIDEO OUT_FOLDER``
"""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from session import FOOTAGE, OUT, addon, captured, invoke, picture, run, show_tab, until, use, viewport

_NOT_KEPT = {"rna_type", "session_uid"}
State = dict[str, object]
report: dict[str, list[str]] = {"undone_and_redone": []}


def state() -> State:
    """Return everything in the file that an operator may change, and the evaluated pose, as a flat table of values."""
    scene = bpy.context.window_manager.windows[0].scene
    bpy.context.window_manager.windows[0].view_layer.update()
    found: State = {}
    for obj in scene.objects:
        about = {
            "parent": obj.parent.name if obj.parent else None,
            "matrix": [round(x, 5) for row in obj.matrix_world for x in row],
            "action": obj.animation_data.action.name if obj.animation_data and obj.animation_data.action else None,
            "collections": sorted(c.name for c in obj.users_collection),
            "selected": obj.select_get(),
            "hidden": (obj.hide_get(), obj.hide_viewport, obj.hide_render),
            "properties": {key: _plain(obj[key]) for key in obj.keys() if not key.startswith("scope_")},
            "ours": _digest({key: _plain(obj[key]) for key in obj.keys() if key.startswith("scope_")}),
        }
        if obj.type == "ARMATURE":
            about["pose"] = [round(x, 4) for bone in obj.pose.bones for x in (*bone.head, *bone.tail)]
            about["mode"] = obj.mode
        found |= {f"object {obj.name} {key}": value for key, value in about.items()}
    for kind in (
        "meshes",
        "armatures",
        "cameras",
        "actions",
        "collections",
        "images",
        "movieclips",
        "materials",
        "texts",
    ):
        found[kind] = sorted(block.name for block in getattr(bpy.data, kind) if block.users)
    for action in bpy.data.actions:
        found[f"action {action.name}"] = _digest(sorted(_keys(curve) for curve in _curves(action)))
        found[f"asset {action.name}"] = _asset(action)
    for name in ("frame_start", "frame_end", "frame_current"):
        found[name] = getattr(scene, name)
    for name in ("fps", "fps_base", "resolution_x", "resolution_y", "pixel_aspect_x"):
        found[name] = round(getattr(scene.render, name), 5)
    found["camera"] = scene.camera.name if scene.camera else None
    found["active"] = bpy.context.window_manager.windows[0].view_layer.objects.active
    found["active"] = found["active"].name if found["active"] else None
    found["markers"] = sorted((marker.frame, marker.name) for marker in scene.timeline_markers)
    editor = scene.sequence_editor
    strips = (editor.strips if hasattr(editor, "strips") else editor.sequences) if editor else ()
    found["strips"] = sorted(strip.name for strip in strips)
    found |= _group("settings", scene.scope) | _group("retarget", scene.scope_retarget)
    for collection in bpy.data.collections:
        found |= _group(f"result of {collection.name}", collection.scope_result)
    return found


def _group(name: str, group: bpy.types.PropertyGroup) -> State:
    """Return a property group's values, including those of nested groups."""
    found: State = {}
    for prop in group.bl_rna.properties:
        if prop.identifier in _NOT_KEPT:
            continue
        value = getattr(group, prop.identifier)
        if isinstance(value, bpy.types.PropertyGroup):
            found |= _group(f"{name}.{prop.identifier}", value)
        elif prop.type == "COLLECTION":
            for index, item in enumerate(value):
                found |= _group(f"{name}.{prop.identifier}[{index}]", item)
        else:
            found[f"{name}.{prop.identifier}"] = _plain(value)
    return found


def _plain(value: object) -> object:
    if isinstance(value, bpy.types.ID):
        return value.name
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "to_list"):
        return value.to_list()
    return value if isinstance(value, str | int | float | bool | None) else list(value)


def _digest(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()[:12]


def _curves(action: bpy.types.Action) -> list[bpy.types.FCurve]:
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    bags = (bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags)
    return [curve for bag in bags for curve in bag.fcurves]


def _asset(action: bpy.types.Action) -> object:
    """Return the metadata and picture of an asset; None of other actions."""
    data, preview = action.asset_data, action.preview
    if data is None:
        return None
    pixels = [round(value, 2) for value in preview.image_pixels_float] if preview else []
    return sorted(tag.name for tag in data.tags), data.author, data.description, data.catalog_id, _digest(pixels)


def _keys(curve: bpy.types.FCurve) -> tuple[str, int, list[float], list[str]]:
    values = [0.0] * (2 * len(curve.keyframe_points))
    curve.keyframe_points.foreach_get("co", values)
    return curve.data_path, curve.array_index, [round(v, 4) for v in values], [m.type for m in curve.modifiers]


def same(found: State, expected: State, when: str) -> None:
    """Assert that two states are equal; name the differences."""
    different = [key for key in sorted(found.keys() | expected.keys()) if found.get(key) != expected.get(key)]
    if different:
        told = [f"{key}: {found.get(key)!r:.150} is not {expected.get(key)!r:.150}" for key in different[:12]]
        raise AssertionError(f"{when}, {len(different)} values differ from before:\n" + "\n".join(told))


def view() -> tuple[bool, str]:
    """Return whether the viewport is in local view, and its perspective."""
    space = viewport()["area"].spaces.active
    return space.local_view is not None, space.region_3d.view_perspective


def undo() -> None:
    """Press Ctrl-Z."""
    invoke(bpy.ops.ed.undo)


def redo() -> None:
    """Press Ctrl-Shift-Z."""
    invoke(bpy.ops.ed.redo)


def tried(name: str, action: Callable[[], object], keep: bool = False) -> Iterator[float]:
    """Run an operator, undo it, redo it and, unless its result is kept, undo it again."""
    before = state()
    action()
    yield from settled(name, before, keep)


def settled(name: str, before: State, keep: bool = False) -> Iterator[float]:
    """Continue ``tried`` once the operator has finished."""
    yield 0.2
    after = state()
    assert after != before, f"{name} changed nothing"
    undo()
    yield 0.2
    same(state(), before, f"after undoing {name}")
    redo()
    yield 0.2
    same(state(), after, f"after redoing {name}")
    if not keep:
        undo()
        yield 0.2
        same(state(), before, f"after undoing {name} twice")
    report["undone_and_redone"].append(name)


def armature() -> bpy.types.Object:
    """Return the captured armature; references from before an undo are invalid."""
    return next(o for o in bpy.data.objects if o.type == "ARMATURE" and "scope_source" in o)


def add_rig() -> None:
    """Make a user's own rig: the captured skeleton a fifth larger, without any of the extension's properties."""
    source = armature()
    rig = bpy.data.objects.new("rig", source.data.copy())
    bpy.context.scene.collection.objects.link(rig)
    rig.scale = (1.2, 1.2, 1.2)
    rig.location = (2.0, 0.0, 0.0)
    bpy.context.scene.scope_retarget.rig = rig
    invoke(bpy.ops.ed.undo_push, message="A rig")


def edits() -> dict[str, Callable[[], object]]:
    """Try the buttons that edit a captured motion."""
    scope = bpy.ops.scope
    return {
        "smooth": lambda: use(scope.smooth, strength=2.5),
        "raw": lambda: use(scope.smooth, strength=0.0),
        "bridge frames": lambda: use(scope.interpolate_span, start=10, end=16),
        "swap sides": lambda: use(scope.swap_sides, start=10, end=16),
        "feet to floor": lambda: use(scope.refloor, level=True),
        "in place": lambda: use(scope.root_motion, mode="IN_PLACE"),
        "loop": lambda: use(scope.loop, start=1, end=60),
        "reduce keys": lambda: use(scope.reduce_keys, degrees=1.0),
        "bake to rate": lambda: use(scope.bake_rate, rate=10.0),
        "guess bones": lambda: use(scope.guess_bones),
        "retarget": lambda: use(scope.retarget),
        "retarget, root motion on an object, next to the person": retarget_beside,
        "mark as asset": lambda: use(scope.mark_asset, author="Ada"),
        "frame rate from footage": set_rate,
        "footage to sequencer": lambda: use(scope.footage_to_sequencer),
    }


def set_rate() -> None:
    """Change the scene's rate by hand, as in the Output properties, and set it from the footage."""
    bpy.context.scene.render.fps = 20
    use(bpy.ops.scope.match_frame_rate)
    assert bpy.context.scene.render.fps != 20


def retarget_beside() -> None:
    """Retarget with root motion, next to the captured person."""
    settings = bpy.context.scene.scope_retarget
    settings.root, settings.captured = "object", "beside"
    use(bpy.ops.scope.retarget)


def capturing() -> Iterator[float]:
    """Try the capture, and undoing something else while it runs."""
    yield from tried("choose footage", lambda: use(bpy.ops.scope.choose_footage, filepath=FOOTAGE), keep=True)
    bpy.context.scene.scope.quality = "FAST"
    invoke(bpy.ops.ed.undo_push, message="Quality")
    before = state()
    yield from captured()
    assert bpy.context.scene.scope.result.collection is not None, addon().state.message
    yield from settled("capture", before)

    forget_captures()
    use(bpy.ops.object.empty_add)
    use(bpy.ops.scope.capture, "INVOKE_DEFAULT")
    yield from until(lambda: addon().state.job.progress.done > 5, 300, "the worker")
    undo()
    assert "Empty" not in bpy.data.objects
    yield from until(lambda: addon().state.job is None, 600, "the capture to end")
    yield 0.5
    assert bpy.context.scene.scope.result.collection is not None, addon().state.message
    yield from settled("capture during which something was undone", before, keep=True)


def forget_captures() -> None:
    """Empty the cache, except for compiled code, so that the footage is captured again."""
    preferences = sys.modules[addon().__name__.replace("capture.capture_operators", "preferences")]
    shutil.rmtree(preferences.cache().root / "captures")


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    show_tab()
    yield 1.0
    show_tab()
    yield from capturing()
    add_rig()
    yield 0.5
    for name, action in edits().items():
        yield from tried(name, action)
    yield from tried("root motion on an object", lambda: use(bpy.ops.scope.root_motion, mode="OBJECT"), keep=True)
    yield from tried("root motion in the bones", lambda: use(bpy.ops.scope.root_motion, mode="BONES"))
    undo()
    use(bpy.ops.scope.look_through)
    yield 0.5
    shown = view()
    undo()
    yield from tried("compare with footage", lambda: use(bpy.ops.scope.look_through))
    yield 0.5
    picture("12_comparing_undone")
    assert view() == (False, "PERSP"), view()
    assert shown == (True, "CAMERA"), shown

    before = state()
    for kind, suffix in (("FBX", "fbx"), ("GLB", "glb"), ("BVH", "bvh")):
        use(bpy.ops.scope.export, filepath=str(OUT / f"undo.{suffix}"), format=kind)
        yield 0.2
        same(state(), before, f"after exporting {kind}")
    report["left_the_file_as_it_was"] = ["export FBX", "export glTF", "export BVH"]

    stack = [state()]
    for action in edits().values():
        action()
        yield 0.2
        stack.append(state())
    for expected in reversed(stack[:-1]):
        undo()
        yield 0.1
        same(state(), expected, "undoing one after the other")
    for expected in stack[1:]:
        redo()
        yield 0.1
        same(state(), expected, "redoing one after the other")
    report["in_a_row"] = list(edits())
    picture("13_all_redone")
    (OUT / "undo.json").write_text(json.dumps(report))


run(steps())
