# SPDX-License-Identifier: GPL-3.0-or-later
"""What `commands` runs that is no command of Scope's: ``python -m scope.tests.fuzz.programs NAME
ARGUMENT…``.

Errors are printed as the command line prints them, so that all commands are checked alike.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from scope.solver.errors import ScopeError

KEY = "1" * 32


def continued(*arguments: str) -> int:
    """Run the command line; every estimate is kept on disk when it is made."""
    from scope.scope_addon import cli
    from scope.scope_addon.capture.long_clips import kept_estimates

    kept_estimates.INTERVAL_S = 0.0
    return cli.main(arguments)


def panel(footage: str) -> int:
    """Press *Capture* in the panel."""
    import bpy

    _register()
    bpy.context.scene.scope.footage = os.path.abspath(footage)
    bpy.context.scene.scope.quality = "FAST"
    return _run(bpy.ops.scope.capture)


def panel_live(video: str, result: str) -> int:
    """Record a playing video in the panel, and save the motion of the recording."""
    import time

    import bpy
    from scope.scope_addon.scene.packed_motion import stored_motion
    from scope.scope_addon.ui.live_job import LiveJob

    _register()
    scene = bpy.context.scene
    scene.scope_live.source = "FILE"
    scene.scope_live.file = os.path.abspath(video)
    job = LiveJob(scene)
    job.record()
    try:
        while job.step():
            time.sleep(0.02)
    finally:
        job.close()
    armature = next(each for each in scene.scope.capture.all_objects if each.type == "ARMATURE")
    stored_motion(armature).save(Path(result))
    return 0


def cache(motion: str, root: str) -> int:
    """Keep two captures, find the second, and remove the first, for which there is no space."""
    from scope.scope_addon.atomic_write import atomic_path
    from scope.scope_addon.job.cache import Cache
    from scope.scope_addon.temporary import discard

    kept = Cache(Path(root))
    for key in ("0" * 32, KEY):
        folder = kept.new_job_folder()
        try:
            with atomic_path(folder / "person1.npz") as temporary:
                shutil.copyfile(motion, temporary)
            kept.keep(folder, key, ["person1.npz"], {"people": 1})
        finally:
            discard(folder)
        kept.prune(1)
    assert kept.find(KEY) is not None
    return 0


def compile_kernels(package: str, folder: str) -> int:
    """Compile two kernels, and keep their code."""
    os.environ["NUMBA_CACHE_DIR"] = os.path.abspath(folder)
    sys.path.insert(0, os.path.abspath(package))
    import_module("package.scope_addon")
    kernels = import_module("package.solver.kernels")
    assert kernels.half(kernels.double(3.0)) == 3.0
    return 0


def _register() -> None:
    """Register the extension in a fresh Blender; its workers use the solver that is compiled
    already.
    """
    import bpy
    import scope
    from scope.scope_addon.job.live_process import LiveProcess
    from scope.scope_addon.job.process import WorkerProcess

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scope.register()
    from scope.scope_addon.ui import capture_job, live_job

    def compiled(kind: Any, request: Any, folder: Path, _: object, *rest: Any) -> Any:
        return kind(request, folder, None, *rest)

    vars(capture_job)["WorkerProcess"] = partial(compiled, WorkerProcess)
    vars(live_job)["LiveProcess"] = partial(compiled, LiveProcess)


def _run(operator: Callable[[], set[str]]) -> int:
    """Run an operator, and print what it reports."""
    try:
        return 0 if operator() == {"FINISHED"} else 1
    except RuntimeError as error:
        print(f"scope: {str(error).removeprefix('Error: ').strip()}", file=sys.stderr)
        return 1


PROGRAMS: dict[str, Callable[..., int]] = {
    "continued": continued,
    "panel": panel,
    "panel-live": panel_live,
    "cache": cache,
    "compile": compile_kernels,
}


def main(name: str, arguments: list[str]) -> int:
    """Run a program and return the exit status, as the command line does."""
    from scope.scope_addon.errors import system_error_message

    try:
        return PROGRAMS[name](*arguments)
    except ScopeError as error:
        print(f"scope: {error}", file=sys.stderr)
    except (OSError, MemoryError) as error:
        print(f"scope: {system_error_message(error)}", file=sys.stderr)
    return 1


if __name__ == "__main__":
    status = main(sys.argv[1], sys.argv[2:])
    sys.stderr.flush()
    os._exit(status)  # without Blender's exit handlers
