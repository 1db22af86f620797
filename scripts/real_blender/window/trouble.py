# SPDX-License-Identifier: GPL-3.0-or-later
"""Failures while a Blender with a window captures: nothing may be left behind, and the next capture
must work.

Usage: ``blender --python trouble.py -- VIDEO OUT_FOLDER``
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
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
    picture,
    run,
    show_tab,
    until,
    use,
    workers,
)

SMALL = Path("/scope/small")  # a separate disk
report: dict[str, str] = {}


def cache():
    """Return the cache of the folder that the preferences name now."""
    return interface("preferences").cache()


def preferences() -> bpy.types.AddonPreferences:
    """Return the extension's preferences."""
    return next(
        a for a in bpy.context.preferences.addons if a.module.endswith(".scope")
    ).preferences


def nothing_left(when: str) -> None:
    """Check that no process and no incomplete file is left."""
    assert not workers(), f"{when}, the worker still runs"
    left = list((cache().root / "jobs").iterdir())
    assert not left, f"{when}, {left} are left"


def begin() -> None:
    """Start a capture that is in no cache."""
    shutil.rmtree(cache().root / "captures", ignore_errors=True)
    use(bpy.ops.scope.capture, "INVOKE_DEFAULT")


def begun() -> Iterator[float]:
    """Start a capture that is in no cache, and wait until it is at work."""
    begin()
    yield from until(
        lambda: addon().state.job is None or addon().state.job.progress.done > 5, 400, "the worker"
    )
    assert addon().state.job is not None, addon().state.message


def ended() -> Iterator[float]:
    """Wait until the capture is over, however it ends."""
    yield from until(lambda: addon().state.job is None, 400, "the capture to end")
    yield 0.5


def failed(name: str, before: dict, says: str) -> None:
    """Check that the last capture failed with a message and left nothing behind."""
    message = addon().state.message
    assert says in message, f"{name}: {message!r} does not say {says!r}"
    assert inventory() == before, f"{name} changed the file"
    nothing_left(f"after {name}")
    report[name] = message


def killed_worker() -> Iterator[float]:
    """Kill the worker, as the system does when memory runs out."""
    before = inventory()
    bpy.context.scene.scope.quality = "BEST"  # so that it does not end before it is killed
    yield from begun()
    os.kill(addon().state.job.worker.pid, signal.SIGKILL)
    bpy.context.scene.scope.quality = "FAST"
    yield from ended()
    failed("killed worker", before, "signal 9")
    picture("14_killed_worker")


def removed_footage() -> Iterator[float]:
    """Remove the video while it is being read."""
    scene = bpy.context.scene
    video = Path("/scope/gone.mp4")
    shutil.copy(FOOTAGE, video)
    scene.scope.footage = str(video)
    yield from begun()
    video.unlink()
    yield from ended()
    nothing_left("after removing the footage")
    texts = [warning.text for warning in scene.scope.result.warnings] + [addon().state.message]
    assert any("gone.mp4" in text for text in texts), texts
    report["removed footage"] = next(text for text in texts if "gone.mp4" in text)
    scene.scope.footage = FOOTAGE


def full_disk() -> Iterator[float]:
    """Fill the disk for the worker's files, then for an export."""
    yield from captured()
    kernels = cache().kernels  # which clearing keeps, so that they are not part of the size
    size = cache().size() + sum(path.stat().st_size for path in kernels.rglob("*.code"))
    SMALL.mkdir(exist_ok=True)
    subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={2 * size + 2**20}", "tmpfs", str(SMALL)], check=True
    )
    preferences().cache_folder = str(SMALL)
    shutil.copytree(kernels, cache().kernels)
    before = inventory()
    fill(leave=2**16)  # enough to begin with, not enough for a motion
    begin()
    yield from ended()
    failed("full disk", before, "space")
    picture("15_full_disk")
    for suffix, kind in (("fbx", "FBX"), ("glb", "GLB"), ("bvh", "BVH")):
        (SMALL / "all_of_it").unlink(missing_ok=True)
        there = sorted(SMALL.iterdir())
        fill()
        try:
            path = SMALL / f"out.{suffix}"
            said = f"{invoke(bpy.ops.scope.export, filepath=str(path), format=kind)}"
        except RuntimeError as error:
            said = str(error).strip()
        assert "space" in said, f"exporting {kind} to a full disk: {said}"
        assert "\n" not in said, said
        (SMALL / "all_of_it").unlink()
        assert sorted(SMALL.iterdir()) == there, f"exporting {kind} left {sorted(SMALL.iterdir())}"
        report[f"{kind} to a full disk"] = said
    preferences().cache_folder = ""


def fill(leave: int = 0) -> None:
    """Fill the disk except for the given number of bytes."""
    with (SMALL / "all_of_it").open("wb", buffering=0) as file:
        try:
            while file.write(b"x" * 4096):
                pass
        except OSError:
            pass
        file.truncate(file.tell() - leave)


def closed(how: str) -> Iterator[float]:
    """Close another Blender, or let it crash, while it captures."""
    shutil.rmtree(cache().root / "captures", ignore_errors=True)
    script = str(Path(__file__).resolve().parents[1] / "shared" / "closed.py")
    other = subprocess.Popen(["blender", "--python", script, "--", FOOTAGE, str(OUT), how])
    yield from until(lambda: other.poll() is not None, 300, "the other Blender to end")
    assert (OUT / f"closed_{how}").read_text("utf-8") == "capturing", (
        "the other Blender did not capture"
    )
    assert other.returncode == (-9 if how == "crash" else 0), other.returncode
    yield from until(lambda: not workers(), 60, "the worker to end")
    nothing_left(f"after Blender's {how}")
    report[f"Blender's {how}"] = "nothing left"


def deleted_footage() -> Iterator[float]:
    """Delete what the comparison with the footage shows, and undo it: if that is a movie clip,
    Blender crashes.
    """
    invoke(bpy.ops.scope.look_through)
    yield 1.0
    for k in range(3):
        use(bpy.ops.ed.undo_push, message="Shown")
        shown = [
            *bpy.data.movieclips,
            *(image for image in bpy.data.images if image.source == "MOVIE"),
        ]
        assert shown, "the comparison shows no footage"
        bpy.data.batch_remove(shown)
        use(bpy.ops.ed.undo_push, message="Deleted")
        yield 0.5
        bpy.context.scene.frame_set(10 + k)
        yield 0.5
        invoke(bpy.ops.ed.undo)
        yield 0.5
    invoke(bpy.ops.scope.look_through)
    report["deleted footage"] = "no crash"


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    show_tab()
    yield 1.0
    show_tab()
    bpy.context.scene.scope.quality = "FAST"
    bpy.ops.scope.choose_footage(filepath=FOOTAGE)
    yield from killed_worker()
    yield from removed_footage()
    yield from full_disk()
    yield from closed("quit")
    yield from closed("crash")
    before = len([c for c in bpy.data.collections if "scope_capture" in c])
    yield from captured()
    assert len([c for c in bpy.data.collections if "scope_capture" in c]) == before + 1, (
        addon().state.message
    )
    report["afterwards"] = "captured as usual"
    yield from deleted_footage()
    (OUT / "trouble.json").write_text(json.dumps(report))


run(steps())
