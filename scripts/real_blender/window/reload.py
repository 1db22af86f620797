# SPDX-License-Identifier: GPL-3.0-or-later
"""Open other files amid whatever keeps running in the window: a capture, a live one, the tools with
the mouse, undo.

Usage: ``blender --python reload.py -- VIDEO OUT_FOLDER``
"""

from __future__ import annotations

import itertools
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shared.session import (
    FOOTAGE,
    OUT,
    addon,
    captured,
    interface,
    inventory,
    invoke,
    run,
    show_tab,
    until,
    use,
    viewport,
)

SAVED = OUT / "reload.blend"
report: dict[str, int] = {"files_opened": 0}


def ways() -> tuple[Callable[[], object], ...]:
    """Return the ways to open another file."""
    wm = bpy.ops.wm
    return (
        lambda: wm.read_homefile(use_factory_startup=True),
        lambda: wm.open_mainfile(filepath=str(SAVED)),
        lambda: wm.read_homefile(use_empty=True, use_factory_startup=True),
        lambda: wm.open_mainfile(filepath=str(SAVED), load_ui=False),
        wm.revert_mainfile,
    )


def open_file(way: Callable[[], object]) -> Iterator[float]:
    """Open another file, and look that nothing of the extension goes on in it."""
    way()
    report["files_opened"] += 1
    for _ in range(10):
        yield 0.05
    assert addon().state.job is None
    assert interface("live_properties").state.job is None
    assert not interface("pin_tool").is_running()


def prepared() -> Iterator[float]:
    """Open the saved file with the panel's tab."""
    bpy.ops.wm.open_mainfile(filepath=str(SAVED))
    yield 0.3
    show_tab()
    yield 0.3
    bpy.context.view_layer.objects.active = next(o for o in bpy.data.objects if "scope_source" in o)


def capturing() -> Iterator[float]:
    """Begin a capture."""
    settings = bpy.context.scene.scope
    settings.footage = FOOTAGE
    settings.quality = "BEST"
    assert use(bpy.ops.scope.capture, "INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield from until(lambda: addon().state.job.messages > 0, 120, "the worker")


def live(footage: str = FOOTAGE) -> Iterator[float]:
    """Begin a live capture of a file."""
    settings = bpy.context.scene.scope_live
    settings.source = "FILE"
    settings.file = footage
    assert use(bpy.ops.scope.live, "INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    state = interface("live_properties").state
    yield from until(lambda: state.job is None or state.job.has_body, 120, "the first pose")
    assert state.job is not None, state.message


def pins() -> Iterator[float]:
    """Show the handles."""
    assert use(bpy.ops.scope.pin_limb, "INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield 0.3


def upright() -> Iterator[float]:
    """Begin to draw the upright line in the comparison, beside the view from the side."""
    use(bpy.ops.scope.look_through)
    yield 0.3
    use(bpy.ops.scope.side_view)
    yield 0.3
    assert use(bpy.ops.scope.upright_line, "INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield 0.1


def undone() -> Iterator[float]:
    """Pin, retarget to a duplicate, push to the NLA, compare, and undo all but the first, which is
    left to timers.
    """
    use(bpy.ops.scope.add_pin, joint="left_wrist", location=(0.5, 0.0, 1.2), frame=20)
    use(bpy.ops.scope.push_to_nla)
    use(bpy.ops.object.duplicate)
    use(bpy.ops.scope.look_through)
    for _ in range(3):
        invoke(bpy.ops.ed.undo)
    yield 0.0


def removed_in_another_scene() -> Iterator[float]:
    """Cancel a live capture while the window shows another scene, whose graph alone Blender updates
    by itself.

    Drawing would read the removed objects from the graph of the first scene, and may crash.
    """
    scene = bpy.context.scene
    before = blocks_in_graph(scene)
    yield from live(str(addon().SAMPLE))  # which lasts longer
    yield 0.3
    assert blocks_in_graph(scene) > before
    use(bpy.ops.scene.new, type="NEW")
    yield 0.1
    use(bpy.ops.scope.cancel_live)
    yield from until(
        lambda: interface("live_properties").state.job is None, 60, "the end of the live capture"
    )
    found = blocks_in_graph(scene)
    assert found == before, f"the hidden scene's graph has {found} datablocks, not {before}"


def blocks_in_graph(scene: bpy.types.Scene) -> int:
    """Return how many datablocks a scene's dependency graph has; those that were removed cannot be
    looked at.
    """
    return len(scene.view_layers[0].depsgraph.ids)


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    show_tab()
    yield 1.0
    settings = bpy.context.scene.scope
    settings.footage = FOOTAGE
    settings.quality = "FAST"
    yield from captured()
    bpy.ops.wm.save_as_mainfile(filepath=str(SAVED))
    yield from removed_in_another_scene()
    before = None
    for way, begin in itertools.product(ways(), (capturing, pins, undone, upright, live)):
        yield from prepared()
        before = before or inventory()
        assert inventory() == before, (inventory(), before)
        yield from begin()
        yield from open_file(way)
    viewport()["area"].tag_redraw()
    yield 0.5
    (OUT / "reload.json").write_text(json.dumps(report))


run(steps())
