# SPDX-License-Identifier: GPL-3.0-or-later
"""Time how long Blender takes to open with the extension enabled, disabled and empty, in turns:
``startup.py ROUNDS``.

Runs in the Debian with its own Python, in /scope. All have the extension's files; in one it is
disabled, and in one its code does nothing, which is what Blender itself takes for an extension with
these packages. Each start opens a window on a separate screen, and Blender's first timer, which
runs once the window exists, ends it. Besides the time that passed, the processor time is measured,
which means something on a busy machine too.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

HOMES = {
    "enabled": Path("/scope/home"),
    "empty": Path("/scope/home_empty"),
    "without": Path("/scope/home_without"),
}
DISABLE = (
    "import bpy; bpy.ops.preferences.addon_disable(module='bl_ext.user_default.scope'); "
    "bpy.ops.wm.save_userpref()"
)
END = """
import bpy, os, time
def end():
    enabled = any(a.module.endswith('.scope') for a in bpy.context.preferences.addons)
    print('opened', time.monotonic(), enabled, flush=True)
    os._exit(0)
bpy.app.timers.register(end, first_interval=0.0)
"""


def opened(kind: str) -> tuple[float, float]:
    """Return the seconds from the start of the process to the window's first timer, and those of
    the processor.
    """
    began = time.monotonic()
    used = processor_s()
    done = subprocess.run(
        ["blender", "--python-expr", END],
        env=dict(os.environ, HOME=str(HOMES[kind])),
        capture_output=True,
        text=True,
        check=True,
    )
    line = next(line for line in done.stdout.splitlines() if line.startswith("opened"))
    assert (line.split()[2] == "True") == (kind != "without"), line
    return float(line.split()[1]) - began, processor_s() - used


def processor_s() -> float:
    """Return the processor time of all processes that were waited for."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def copied_home(kind: str) -> Path:
    """Return a copy of the home in which the extension is installed."""
    shutil.rmtree(HOMES[kind], ignore_errors=True)
    shutil.copytree(HOMES["enabled"], HOMES[kind], copy_function=os.link, symlinks=True)
    for preferences in HOMES[kind].rglob("userpref.blend"):
        preferences.unlink()  # still a link: the copy is changed, not the original
        shutil.copy(HOMES["enabled"] / preferences.relative_to(HOMES[kind]), preferences)
    return HOMES[kind]


def main(rounds: int) -> None:
    """Measure and write out/startup.json."""
    environment = dict(os.environ, HOME=str(copied_home("without")))
    command = ["blender", "--background", "--python-exit-code", "1", "--python-expr", DISABLE]
    subprocess.run(command, env=environment, capture_output=True, check=True)
    (code,) = copied_home("empty").rglob("user_default/scope/__init__.py")
    code.unlink()
    code.write_text("def register(): pass\ndef unregister(): pass\n")
    times: dict[str, list[tuple[float, float]]] = {kind: [] for kind in HOMES}
    for kind in HOMES:
        opened(kind)  # read its files once
    for turn in range(rounds):
        for kind in sorted(HOMES, reverse=bool(turn % 2)):
            times[kind].append(opened(kind))
    figures: dict[str, float] = {"rounds": rounds}
    for index, what in enumerate(("", "processor_")):
        found = {kind: [run[index] for run in runs] for kind, runs in times.items()}
        figures |= {
            f"{what}{kind}_s": statistics.median(seconds) for kind, seconds in found.items()
        }
        for kind, prefix in (("enabled", ""), ("empty", "empty_")):
            pairs = [1e3 * (a - b) for a, b in zip(found[kind], found["without"], strict=True)]
            figures[f"{what}{prefix}more_ms"] = 1e3 * (
                figures[f"{what}{kind}_s"] - figures[f"{what}without_s"]
            )
            figures[f"{what}{prefix}median_of_differences_ms"] = statistics.median(pairs)
    Path("out/startup.json").write_text(
        json.dumps({name: round(value, 4) for name, value in figures.items()})
    )


if __name__ == "__main__":
    main(int(sys.argv[1]))
