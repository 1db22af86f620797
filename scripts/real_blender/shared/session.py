# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared code of the parts with a window: Blender's timers drive the steps of a session."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy

ARGUMENTS = sys.argv[sys.argv.index("--") + 1 :]
FOOTAGE = ARGUMENTS[0]
OUT = Path(ARGUMENTS[1])


def viewport() -> dict:
    """Return the context of the 3D viewport's main region."""
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    return {
        "window": window,
        "area": area,
        "region": next(r for r in area.regions if r.type == "WINDOW"),
    }


def show_tab() -> bool:
    """Open the sidebar at our tab; False where a script cannot choose the tab."""
    area = viewport()["area"]
    area.spaces.active.show_region_ui = True
    sidebar = next(r for r in area.regions if r.type == "UI")
    try:
        sidebar.active_panel_category = "Scope"
    except AttributeError:
        return False
    area.tag_redraw()
    return True


def picture(name: str) -> None:
    """Take a screenshot of the whole screen."""
    subprocess.run(["import", "-window", "root", str(OUT / f"{name}.png")], check=True)


def key(name: str, place: tuple[int, int] = (500, 400)) -> None:
    """Press a key with the mouse at a place of the screen: by default, over the viewport."""
    subprocess.run(
        ["xdotool", "mousemove", *map(str, place), "sleep", "0.2", "key", name], check=True
    )


def click(x: int, y: int) -> None:
    """Click the left button, in screen pixels from the top left, as slowly as a hand, while Blender
    keeps running.
    """
    steps = [
        "mousemove",
        str(x),
        str(y),
        "sleep",
        "0.4",
        "mousedown",
        "1",
        "sleep",
        "0.1",
        "mouseup",
        "1",
    ]
    subprocess.Popen(["xdotool", *steps])


def press(place: tuple[int, int], happened: Callable[[], bool]) -> Iterator[float]:
    """Click until something has happened: a busy machine draws late, and a button that is not there
    takes no click.
    """
    for _ in range(6):
        click(*place)
        for _ in range(40):
            yield 0.1
            if happened():
                return
    raise RuntimeError(f"the button at {place} took no click")


def interface(name: str):
    """Return a module of the extension's interface, which is loaded."""
    module = f".scope_addon.ui.{name}"
    return sys.modules[next(n for n in sys.modules if n.endswith(module))]


def addon():
    """Return the extension's module of operators, to inspect the job."""
    return interface("capture_operators")


def invoke(operator, *arguments, **settings) -> set[str]:
    """Call an operator as a script does, without a step to undo."""
    with bpy.context.temp_override(**viewport()):
        return operator(*arguments, **settings)


def use(operator, *arguments, **settings) -> set[str]:
    """Call an operator as a button does, with a step to undo, which Blender has only with a
    window.
    """
    return invoke(operator, *(arguments or ("EXEC_DEFAULT",)), not bpy.app.background, **settings)


def until(happened: Callable[[], bool], seconds: float, what: str) -> Iterator[float]:
    """Wait for something."""
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end, f"waited {seconds} s for {what}"
        yield 0.05


def captured(seconds: float = 600.0) -> Iterator[float]:
    """Start a capture through its operator and wait for its end."""
    use(bpy.ops.scope.capture, "INVOKE_DEFAULT")
    yield from until(lambda: addon().state.job is None, seconds, "the capture to end")
    yield 0.5


def strips() -> list:
    """Return the strips of the scene's sequencer, which Blender 5 calls so."""
    editor = bpy.context.scene.sequence_editor
    return list(editor.strips_all if hasattr(editor, "strips_all") else editor.sequences_all)


def inventory() -> dict:
    """Return the file's data-blocks, which cancelling must not change."""
    kinds = (
        "objects",
        "meshes",
        "armatures",
        "cameras",
        "actions",
        "collections",
        "images",
        "movieclips",
        "materials",
    )
    return {kind: sorted(b.name for b in getattr(bpy.data, kind)) for kind in kinds}


def workers() -> list[int]:
    """Return the ids of capture processes, also those of a Blender that has ended."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            found += [int(path.parent.name)] if b"start_worker.py" in path.read_bytes() else []
        except OSError:
            continue  # it has just ended
    return found


def run(steps: Iterator[float]) -> None:
    """Run ``steps``, which yield seconds to wait, from Blender's timers, then quit."""

    def advance() -> float | None:
        status = 0
        try:
            return next(steps)
        except StopIteration:
            pass
        except BaseException:
            traceback.print_exc()
            picture("failed")
            status = 1
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)  # Blender's own exit can hang

    bpy.context.preferences.view.show_splash = False
    # also when another file is opened
    bpy.app.timers.register(advance, first_interval=3.0, persistent=True)
