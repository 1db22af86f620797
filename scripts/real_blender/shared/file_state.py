# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything in the open file that an operator may change, as a table, and its comparison."""

from __future__ import annotations

import hashlib

import bpy
from mathutils import Matrix

_NOT_KEPT = {"rna_type", "session_uid"}
State = dict[str, object]
DATA = (
    "objects",
    "meshes",
    "armatures",
    "cameras",
    "actions",
    "collections",
    "images",
    "movieclips",
    "materials",
    "texts",
)


def state() -> State:
    """Return everything in the file that an operator may change, and the evaluated pose, as a flat
    table of values.
    """
    scene = bpy.context.window_manager.windows[0].scene
    view_layer = bpy.context.window_manager.windows[0].view_layer
    view_layer.update()
    found: State = {}
    for obj in scene.objects:
        about = {
            "parent": obj.parent.name if obj.parent else None,
            "matrix": [round(x, 5) for row in _matrix(obj, view_layer.depsgraph) for x in row],
            "action": obj.animation_data.action.name
            if obj.animation_data and obj.animation_data.action
            else None,
            "tracks": [
                [strip.name for strip in track.strips] for track in obj.animation_data.nla_tracks
            ]
            if obj.animation_data
            else [],
            "collections": sorted(c.name for c in obj.users_collection),
            "selected": obj.select_get(),
            "hidden": (obj.hide_get(), obj.hide_viewport, obj.hide_render),
            "properties": {
                key: _plain(obj[key]) for key in obj.keys() if not key.startswith("scope_")
            },
            "ours": _digest(
                {key: _plain(obj[key]) for key in obj.keys() if key.startswith("scope_")}
            ),
        }
        if obj.pose is not None:
            about["pose"] = [
                round(x, 4) for bone in obj.pose.bones for x in (*bone.head, *bone.tail)
            ]
            about["mode"] = obj.mode
        found |= {f"object {obj.name_full} {key}": value for key, value in about.items()}
    for kind in DATA[1:]:
        found[kind] = sorted(block.name_full for block in getattr(bpy.data, kind) if block.users)
    for action in bpy.data.actions:
        found[f"action {action.name_full}"] = _digest(
            sorted(_keys(curve) for curve in curves_of(action))
        )
        found[f"asset {action.name_full}"] = _asset(action)
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
        found |= _group(f"result of {collection.name_full}", collection.scope_result)
    return found


def _matrix(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Matrix:
    """Return where an object is; Blender does not evaluate those that are hidden.

    Objects of a linked scene that is not in the window yet are evaluated, but do not say so
    themselves.
    """
    return (
        obj.evaluated_get(depsgraph).matrix_world.copy() if obj.visible_get() else obj.matrix_basis
    )


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


def curves_of(action: bpy.types.Action) -> list[bpy.types.FCurve]:
    """Return an action's curves; since Blender 5 they are in its layers alone."""
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    bags = (bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags)
    return [curve for bag in bags for curve in bag.fcurves]


def _asset(action: bpy.types.Action) -> object:
    """Return the metadata and picture of an asset; None of other actions."""
    data = action.asset_data
    preview = action.preview
    if data is None:
        return None
    pixels = [round(value, 2) for value in preview.image_pixels_float] if preview else []
    return (
        sorted(tag.name for tag in data.tags),
        data.author,
        data.description,
        data.catalog_id,
        _digest(pixels),
    )


def _keys(curve: bpy.types.FCurve) -> tuple[str, int, list[float], list[str]]:
    values = [0.0] * (2 * len(curve.keyframe_points))
    curve.keyframe_points.foreach_get("co", values)
    return (
        curve.data_path,
        curve.array_index,
        [round(v, 4) for v in values],
        [m.type for m in curve.modifiers],
    )


def identities() -> State:
    """Return which datablocks there are, used or not; undo crashes on one that was replaced without
    a step to undo.
    """
    return {
        f"identity {kind} {block.session_uid}": block.name_full
        for kind in (*DATA, "scenes", "shape_keys", "sounds")
        for block in getattr(bpy.data, kind)
    }


def differences(found: State, expected: State) -> list[str]:
    """Name the differences of two states."""
    different = [
        key for key in sorted(found.keys() | expected.keys()) if found.get(key) != expected.get(key)
    ]
    return [
        f"{key}: {found.get(key)!r:.150} is not {expected.get(key)!r:.150}" for key in different
    ]


def same(found: State, expected: State, when: str) -> None:
    """Assert that two states are equal; name the differences."""
    told = differences(found, expected)
    assert not told, f"{when}, {len(told)} values differ from before:\n" + "\n".join(told[:12])
