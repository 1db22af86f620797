# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo and redo every operator of the panel in a Blender with a window: the file must be the same
as before.

Usage: ``blender --python undo.py -- VIDEO OUT_FOLDER``
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

import bpy
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shared.file_state import State, curves_of, identities, same, state
from shared.session import (
    FOOTAGE,
    OUT,
    addon,
    captured,
    interface,
    invoke,
    picture,
    run,
    show_tab,
    until,
    use,
    viewport,
)

# Bones of the face by which a rig like MPFB's is known, and the tip of each, from the head's bone;
# metres.
FACE = {
    "jaw": ((0.0, -0.064, 0.088), (0.0, -0.123, 0.016)),
    "eye.L": ((0.031, -0.125, 0.128), (0.032, -0.162, 0.129)),
    "orbicularis03.L": ((0.031, -0.125, 0.128), (0.032, -0.159, 0.141)),
    "orbicularis04.L": ((0.031, -0.125, 0.128), (0.032, -0.16, 0.118)),
    "levator05.L": ((0.03, -0.141, 0.063), (0.026, -0.141, 0.055)),
}
report: dict[str, list[str]] = {"undone_and_redone": []}


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
    """Make a user's own rig: the captured skeleton a fifth larger, without the extension's
    properties, with a face.
    """
    source = armature()
    rig = bpy.data.objects.new("rig", source.data.copy())
    bpy.context.scene.collection.objects.link(rig)
    add_face(rig)
    rig.scale = (1.2, 1.2, 1.2)
    rig.location = (2.0, 0.0, 0.0)
    bpy.context.scene.scope_retarget.rig = rig
    invoke(bpy.ops.ed.undo_push, message="A rig")


def add_face(rig: bpy.types.Object) -> None:
    """Give a rig bones that move its face, and leave the active object as it was."""
    layer = bpy.context.view_layer
    active = layer.objects.active
    layer.objects.active = rig
    invoke(bpy.ops.object.mode_set, mode="EDIT")
    bones = rig.data.edit_bones
    head = rig.data.edit_bones["head"]
    for name, ends in FACE.items():
        for side in (1, -1) if name.endswith(".L") else (1,):
            bone = bones.new(name if side == 1 else name.replace(".L", ".R"))
            bone.head, bone.tail = (head.head + Vector((side * x, y, z)) for x, y, z in ends)
            bone.parent = head
    invoke(bpy.ops.object.mode_set, mode="OBJECT")
    layer.objects.active = active


def face_moves() -> bool:
    """Return whether the action of the rig moves a bone of its face; in a part of the clip that is
    looped, the mouth may stay closed.
    """
    data = bpy.data.objects["rig"].animation_data
    return data is not None and any(
        f'"{bone}"' in curve.data_path for curve in curves_of(data.action) for bone in FACE
    )


def retarget_face() -> None:
    """Move the captured expressions to the face of the rig."""
    assert bpy.context.scene.scope_retarget.face == bpy.data.objects["rig"]
    use(bpy.ops.scope.retarget_face)
    assert face_moves(), "the face does not move"


def edits() -> dict[str, Callable[[], object]]:
    """Try the buttons that edit a captured motion."""
    scope = bpy.ops.scope
    return {
        "smooth": lambda: use(scope.smooth, strength=2.5),
        "raw": lambda: use(scope.smooth, strength=0.0),
        "bridge frames": lambda: use(scope.interpolate_span, start=10, end=16),
        "feet to floor": lambda: use(scope.refloor, level=True),
        "in place": lambda: use(scope.root_motion, mode="IN_PLACE"),
        "loop": lambda: use(scope.loop, start=1, end=60),
        "reduce keys": lambda: use(scope.reduce_keys, degrees=1.0),
        "bake to rate": lambda: use(scope.bake_rate, rate=10.0),
        "guess bones": lambda: use(scope.guess_bones),
        "retarget": lambda: use(scope.retarget),
        "retarget, root motion on an object, next to the person": retarget_beside,
        "retarget face": retarget_face,
        "add an expression": lambda: use(scope.edit_expression_pair, action="ADD"),
        "mark as asset": lambda: use(scope.mark_asset, author="Ada"),
        "footage to sequencer": lambda: use(scope.footage_to_sequencer),
        "rename take": lambda: use(scope.rename_take, name="renamed"),
        "upright line": lambda: use(
            scope.set_upright_in_view, end=(0.0, 0.1, 1.5), direction=(1.0, 0.0, 0.0)
        ),
        "floor here": lambda: use(scope.floor_here),
        "flip limb": lambda: use(scope.flip_limb, start=10, end=20, limb="left_leg"),
        "turn around": lambda: use(scope.turn_around, start=10, end=20),
        "this rests": lambda: use(scope.this_rests, start=10, end=12, part="left_knee"),
        "push to NLA": lambda: use(scope.push_to_nla),  # last, because it leaves no action to edit
    }


def set_rate() -> None:
    """Change the scene's rate by hand, as in the Output properties."""
    bpy.context.scene.render.fps = 20
    invoke(bpy.ops.ed.undo_push, message="Frame Rate")


def retarget_beside() -> None:
    """Retarget with root motion, next to the captured person."""
    settings = bpy.context.scene.scope_retarget
    settings.root = "object"
    settings.captured = "beside"
    use(bpy.ops.scope.retarget)


def capturing() -> Iterator[float]:
    """Try the capture, and undoing something else while it runs."""
    yield from tried(
        "choose footage", lambda: use(bpy.ops.scope.choose_footage, filepath=FOOTAGE), keep=True
    )
    bpy.context.scene.scope.quality = "FAST"
    bpy.context.scene.scope.face = True
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


def failing() -> Iterator[float]:
    """Let a correction fail after it has changed keys, and then undo what came before, which must
    not crash.
    """
    package = addon().__name__.removesuffix(".ui.capture_operators")
    names = "scene.character.corrected_keys", "errors"
    keys, errors = (import_module(f"{package}.{name}") for name in names)

    def fail(*_: object) -> None:
        raise errors.UsageError("this fails")

    invoke(bpy.ops.ed.undo_push, message="Evaluated")
    # only the scene changes, so that undoing this does not read the armature again
    use(bpy.ops.scope.use_sample)
    yield 0.2
    before = state()
    there = identities()
    meet_pin = keys._meet_pin
    keys._meet_pin = fail
    try:
        use(bpy.ops.scope.add_pin, joint="left_wrist", location=(0.5, 0.0, 1.5), frame=20)
    except RuntimeError:
        pass
    else:
        raise AssertionError("the correction did not fail")
    finally:
        keys._meet_pin = meet_pin
    yield 0.2
    same(state() | identities(), before | there, "after a correction that failed")
    undo()
    yield 0.2
    redo()
    yield 0.2
    same(state(), before, "after undoing and redoing what came before a correction that failed")
    undo()
    yield 0.2


def forget_captures() -> None:
    """Empty the cache, except for compiled code, so that the footage is captured again."""
    shutil.rmtree(interface("preferences").cache().root / "captures")


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
    yield from tried("delete capture", lambda: use(bpy.ops.scope.delete_capture))
    yield from tried("frame rate by hand", set_rate, keep=True)
    yield from tried("frame rate from footage", lambda: use(bpy.ops.scope.match_frame_rate))
    undo()
    yield from failing()
    yield from tried(
        "root motion on an object", lambda: use(bpy.ops.scope.root_motion, mode="OBJECT"), keep=True
    )
    yield from tried(
        "root motion in the bones", lambda: use(bpy.ops.scope.root_motion, mode="BONES")
    )
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
    for name, expected in zip(reversed(edits()), reversed(stack[:-1]), strict=True):
        undo()
        yield 0.1
        same(state(), expected, f"undoing one after the other, as far as {name}")
    for name, expected in zip(edits(), stack[1:], strict=True):
        redo()
        yield 0.1
        same(state(), expected, f"redoing one after the other, as far as {name}")
    report["in_a_row"] = list(edits())
    picture("13_all_redone")
    (OUT / "undo.json").write_text(json.dumps(report))


run(steps())
