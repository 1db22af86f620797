# SPDX-License-Identifier: GPL-3.0-or-later
"""Two motions in one file, in a Blender with a window: their content and results stay with them.

Undone, renamed, duplicated, saved and reopened without the cache, appended, linked, deleted.
Usage: ``blender --python stored.py -- VIDEO OUT_FOLDER``
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shared.session import OUT, invoke, picture, run, show_tab, use

SAVED = OUT / "stored.blend"
WALK = OUT / "walk.npz"
JUMP = OUT / "jump_poses.npz"
report: dict[str, list[str]] = {"worked": []}


def armature(name: str) -> bpy.types.Object:
    """Return an armature by name; references from before an undo are invalid."""
    return bpy.context.scene.objects[name]


def activate(name: str) -> None:
    """Make an object the active and the only selected one."""
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    armature(name).select_set(True)
    bpy.context.view_layer.objects.active = armature(name)


def select(capture: str) -> None:
    """Select a capture in the list."""
    bpy.context.scene.scope.capture_index = bpy.data.collections.find(capture)


def usable(name: str, when: str) -> None:
    """Check that everything that starts from the captured motion works on an armature."""
    activate(name)
    for strength in (0.0, 1.0, 2.5):
        assert use(bpy.ops.scope.smooth, strength=strength) == {"FINISHED"}, when
    use(bpy.ops.scope.export, filepath=str(OUT / "again.npz"), format="NPZ", which="ACTIVE")
    (OUT / "again.npz").unlink(missing_ok=True)
    for each in OUT.glob("again.person*.npz"):
        each.unlink()
    report["worked"].append(f"{name}, {when}")


def shown() -> tuple[str, int, int]:
    """Return the name, frames and number of warnings of the result that the panel shows."""
    result = bpy.context.scene.scope.result
    return result.collection.name, result.frames, len(result.warnings)


def two_captures() -> Iterator[float]:
    """Import two motions as another tool writes them, which is faster than capturing; undo and redo
    the second.
    """
    for path, speed in ((WALK, 1.0), (JUMP, 2.0)):
        phase = 2 * np.pi * speed * np.arange(120) / 60.0
        poses = np.zeros((120, 24, 3))
        trans = np.zeros((120, 3))
        poses[:, 0, 0] = np.pi / 2
        poses[:, 1, 0] = 0.4 * np.sin(phase)
        poses[:, 2, 0] = -0.4 * np.sin(phase)
        trans[:, 1] = -speed * np.arange(120) / 60.0
        np.savez(path, poses=poses.reshape(120, -1), trans=trans, mocap_framerate=np.array(60.0))
    use(bpy.ops.scope.import_motion, filepath=str(WALK))
    before = bpy.data.objects["walk"]["scope_motion"]["motion"]
    use(bpy.ops.scope.import_motion, filepath=str(JUMP))
    content = armature("jump_poses")["scope_motion"]["motion"]
    invoke(bpy.ops.ed.undo)
    yield 0.3
    assert len(bpy.data.texts) == 1
    assert shown()[0] == "walk"
    assert armature("walk")["scope_motion"]["motion"] == before
    invoke(bpy.ops.ed.redo)
    yield 0.3
    assert armature("jump_poses")["scope_motion"]["motion"] == content
    usable("jump_poses", "after undo and redo")
    yield 1.0


def renamed_and_reopened(
    first: tuple[str, int, int], second: tuple[str, int, int]
) -> Iterator[float]:
    """Rename and duplicate, clear the cache, save and reopen, undo, delete."""
    armature("walk").name = "hero"
    activate("hero")
    invoke(bpy.ops.object.duplicate)
    bpy.context.active_object.name = "twin"
    bpy.data.collections["walk"].name = "zebra"
    invoke(bpy.ops.ed.undo_push, message="Duplicate and rename")
    assert shown() == ("zebra", *first[1:]), shown()
    bpy.ops.scope.clear_cache()
    for name in ("hero", "twin", "jump_poses"):
        usable(name, "renamed, duplicated, without the cache")
    assert len(bpy.data.texts) == 2

    bpy.ops.wm.save_as_mainfile(filepath=str(SAVED))
    yield from new_file()
    bpy.ops.wm.open_mainfile(filepath=str(SAVED))
    yield 1.0
    assert shown() == ("zebra", *first[1:]), shown()
    for name in ("hero", "twin", "jump_poses"):
        usable(name, "reopened")
    select("jump_poses")
    assert shown() == second, shown()
    use(bpy.ops.scope.smooth, strength=2.5)
    invoke(bpy.ops.ed.undo)
    yield 0.3
    usable("jump_poses", "after undoing in the reopened file")
    activate("jump_poses")
    use(bpy.ops.object.delete)
    yield 1.0
    picture("14_armature_deleted")
    select("zebra")
    assert shown() == ("zebra", *first[1:]), shown()


def in_other_files(first: tuple[str, int, int]) -> Iterator[float]:
    """Append the armature, append its collection, and link the collection."""
    yield from new_file()
    bpy.ops.wm.append(
        filepath=f"{SAVED}/Object/hero", directory=f"{SAVED}/Object/", filename="hero"
    )
    activate("hero")
    for strength in (0.0, 2.5):
        assert use(bpy.ops.scope.smooth, strength=strength) == {"FINISHED"}
    report["worked"].append("hero, appended alone")
    yield from new_file()
    bpy.ops.wm.append(
        filepath=f"{SAVED}/Collection/zebra", directory=f"{SAVED}/Collection/", filename="zebra"
    )
    yield 1.0
    assert shown() == ("zebra", *first[1:]), shown()
    usable("hero", "appended with its collection")
    yield from new_file()
    with bpy.data.libraries.load(str(SAVED), link=True) as (_, wanted):
        wanted.collections = ["zebra"]
    bpy.context.scene.collection.children.link(wanted.collections[0])
    use(bpy.ops.scope.export, filepath=str(OUT / "linked.npz"), format="NPZ")
    report["worked"].append("export of a linked motion")
    show_tab()
    yield 1.0
    picture("14_linked")


def new_file() -> Iterator[float]:
    """Begin a new file."""
    bpy.ops.wm.read_homefile()
    yield 1.0


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    show_tab()
    yield 1.0
    show_tab()
    yield 1.0
    picture("14_import_button")
    yield from two_captures()
    second = shown()
    assert second[0] == "jump_poses", second
    picture("14_two_captures")
    select("walk")
    yield 1.0
    first = shown()
    assert first[0] == "walk", first
    picture("14_first_selected")
    yield from renamed_and_reopened(first, second)
    yield from in_other_files(first)
    (OUT / "stored.json").write_text(json.dumps(report))


run(steps())
