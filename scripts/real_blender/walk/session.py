# SPDX-License-Identifier: GPL-3.0-or-later
"""The random walk inside Blender: one step per timer, so that the window is redrawn and other
timers run in between.

Usage: ``blender --python session.py -- VIDEO FOLDER SEED STEPS``; ``start.py`` starts it. A
traceback that is printed or raised between two steps is a failure of the step before. An operator
that reports an error is none, unless it has changed the file. PyPI's bpy, which has no window and
cannot undo, takes the same steps: ``python session.py -- VIDEO FOLDER SEED STEPS``.
"""

from __future__ import annotations

import faulthandler
import json
import os
import random
import sys
import time
import traceback
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shared.file_state import State, differences, identities, state
from shared.session import ARGUMENTS, OUT, show_tab
from walk import steps as walk_steps
from walk.file_steps import Step

SEED = int(ARGUMENTS[2])
COUNT = int(ARGUMENTS[3])
PAUSE_S = 0.02
# Blender crashes when a script chooses a tab before the new file's window is drawn
OPENED_PAUSE_S = 0.5
MAX_OBJECTS = 60  # above which a step begins a new file


def everything() -> State:
    """Return everything in the file that may change, and which datablocks there are."""
    scene = bpy.context.window_manager.windows[0].scene
    # evaluates what steps have left
    scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
    return state() | identities()


def objects() -> set[int]:
    """Return which objects there are."""
    return {obj.session_uid for obj in bpy.data.objects}


def update_hidden_scenes() -> None:
    """Rebuild the dependency graphs of the scenes that the window does not show, as Blender does
    only for that one.

    They point to objects that were removed meanwhile. Blender 4.3 reads these when it frees unused
    drawing data, and crashes, also in a script without Scope.
    """
    shown = bpy.context.window_manager.windows[0].scene
    for scene in bpy.data.scenes:
        if scene != shown:
            for layer in scene.view_layers:
                layer.update()


def pause_after(step: Step, present: set[int]) -> float:
    """Return for how long to wait after a step before which these objects were present."""
    if step.text.startswith(("open(", "new file(")):
        return OPENED_PAUSE_S
    # Scope's operators must do without
    if not step.text.startswith("scope.") and present - objects():
        update_hidden_scenes()
    return PAUSE_S


class Walk:
    """The state of the walk."""

    def __init__(self) -> None:
        self.random = random.Random(SEED)
        self.steps = walk_steps.Steps(self.random, OUT, ARGUMENTS[0])
        self.taken = 0
        self.failures: list[str] = []
        self.outcomes: dict[str, int] = {}
        self.last = "start"
        self.log = (OUT / "steps.log").open("w")
        (OUT / "printed.log").touch()
        self.printed = (OUT / "printed.log").open(errors="replace")
        self.began = time.monotonic()

    def advance(self) -> float | None:
        """Take one step; Blender's timers call this."""
        self.check_printed()
        if not bpy.app.background:
            show_tab()
        if self.taken == COUNT:
            self.end()
        if self.taken == 0:
            self.steps.prepare()
        self.taken += 1
        crowded = len(bpy.data.objects) > MAX_OBJECTS
        step = self.steps.new_file() if crowded else self.steps.choose()
        self.last = f"{self.taken} {step.text}"
        self.log.write(f"{time.monotonic() - self.began:.1f} s: {self.last}")
        self.log.flush()
        before = everything() if step.checked else {}
        present = objects()
        try:
            outcome = str(step.take())
        except RuntimeError as error:  # reported by an operator
            outcome = f"refused: {str(error).strip()}"
            if "Traceback (most recent call last)" in outcome:
                self.fail(outcome)
        except Exception:
            outcome = traceback.format_exc()
            self.fail(outcome)
        if step.checked and "FINISHED" not in outcome:
            self.check_unchanged(before)
        elif step.text.startswith("scope.export("):
            self.check_unchanged(before)
        elif outcome.startswith("refused") and not step.text.startswith("scope."):
            self.steps.pushed("refused")
        self.log.write(f" -> {outcome.replace(chr(10), ' | ')[:300]}\n")
        self.log.flush()
        key = step.text.split("(")[0] + (" refused" if outcome.startswith("refused") else "")
        self.outcomes[key] = self.outcomes.get(key, 0) + 1
        return pause_after(step, present)

    def check_printed(self) -> None:
        """Read what Blender has printed since the last step: handlers, timers and panels print
        their tracebacks.
        """
        sys.stdout.flush()
        sys.stderr.flush()
        text = self.printed.read()
        if "Traceback (most recent call last)" in text:
            self.fail(text[text.index("Traceback (most recent call last)") :])

    def check_unchanged(self, before: State) -> None:
        """Fail if the last step has changed the file: undo knows nothing of changes by an operator
        that failed.
        """
        told = differences(everything(), before)
        if told:
            self.fail(f"{len(told)} values changed: " + "; ".join(told[:8]))

    def fail(self, text: str) -> None:
        """Note a failure of the last step, once."""
        if not any(failure.endswith(text[-300:]) for failure in self.failures):
            self.failures.append(f"step {self.last}: {text}")

    def end(self) -> None:
        """Write the results and end Blender."""
        seconds = round(time.monotonic() - self.began, 1)
        results = {"seed": SEED, "steps": self.taken, "seconds": seconds, "failures": self.failures}
        results["outcomes"] = dict(sorted(self.outcomes.items()))
        (OUT / "results.json").write_text(json.dumps(results, indent=1))
        self.log.close()
        os._exit(1 if self.failures else 0)  # Blender's own exit can hang


def in_module() -> None:
    """Walk in PyPI's bpy, with the extension registered under its name in the shell."""
    from scope.scope_addon import ui

    ui.register()
    walk = Walk()
    while True:
        walk.advance()


faulthandler.enable()
if bpy.app.background:
    in_module()
bpy.context.preferences.view.show_splash = False
# a second, not a minute, before drawing meets what was deleted
bpy.context.preferences.system.vbo_collection_rate = 1
bpy.context.preferences.filepaths.use_auto_save_temporary_files = False
walk = Walk()
bpy.app.timers.register(walk.advance, first_interval=3.0, persistent=True)
