# SPDX-License-Identifier: GPL-3.0-or-later
"""Capture from the panel of a Blender with a window, as a person would, and take a screenshot of
every state.

Usage: ``blender --python panel.py -- VIDEO OUT_FOLDER``
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shared.session import (
    FOOTAGE,
    OUT,
    addon,
    inventory,
    invoke,
    key,
    picture,
    press,
    run,
    show_tab,
    strips,
    until,
    viewport,
)

# Where the panel's buttons are on a screen of 1600 x 1000, in pixels from its top left.
FAST_BUTTON = (1086, 151)
CAPTURE_BUTTON = (1174, 183)
OVER_PANEL = (1174, 300)
KEEP_BUTTON = (1087, 301)  # of the question, which opens where the mouse is: over the panel
ASKS_AFTER_S = 11.0
report: dict = {"blender": bpy.app.version_string, "python": sys.version.split()[0], "exports": []}


def tracked_half() -> bool:
    """Return whether the running capture has processed half of its frames, or has ended."""
    job = addon().state.job
    return job is None or (job.progress.total > 0 and job.progress.done >= 0.5 * job.progress.total)


def clocks() -> np.ndarray:
    """Return the time, and the processor time of Blender's main thread, in seconds.

    The latter is the same on a busy machine: neither the capture nor drawing without a graphics
    card is part of it.
    """
    return np.array([time.monotonic(), time.thread_time()])


def cancel_after_the_question() -> Iterator[float]:
    """Press Escape over the panel: the capture goes on while it asks, and unless Return answers.

    Neither Escape nor Keep Capturing ends it. The worker stands still meanwhile.
    """
    operator = addon().SCOPE_OT_cancel
    asked = []
    kept = []
    invoke_itself = operator.invoke
    keep = addon().SCOPE_OT_keep_capturing
    keep_itself = keep.execute

    def counted(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        asked.append(invoke_itself(self, context, event))
        return asked[-1]

    yield from until(
        lambda: time.monotonic() - addon().state.started > ASKS_AFTER_S, 30, "a capture that asks"
    )
    operator.invoke = counted
    keep.execute = lambda self, context: kept.append(True) or keep_itself(self, context)
    for times, answer in enumerate(("Escape", "Keep Capturing", "Return"), 1):
        key("Escape", OVER_PANEL)
        # not if one is still open
        yield from until(lambda wanted=times: len(asked) == wanted, 20, "the question")
        yield 2.0
        assert addon().state.job is not None, (
            "Escape over the panel ended a long capture without a question"
        )
        picture("4_question")
        if answer == "Keep Capturing":
            yield from press(KEEP_BUTTON, lambda: bool(kept))
        else:
            key(answer, OVER_PANEL)
        yield 2.0
        if answer != "Return":
            assert addon().state.job is not None, f"{answer} did not decline to stop the capture"
    yield from until(lambda: addon().state.job is None, 20, "the capture to stop")
    operator.invoke = invoke_itself
    keep.execute = keep_itself
    report["question"] = "asked, declined, asked, kept, asked, stopped"


def frame_covered() -> float:
    """Return how far the frame of the scene's camera reaches under the sidebar or the toolbar,
    pixels.
    """
    area = viewport()["area"]
    region = viewport()["region"]
    camera = bpy.context.scene.camera
    corners = [
        camera.matrix_world @ corner for corner in camera.data.view_frame(scene=bpy.context.scene)
    ]
    across = [
        location_3d_to_region_2d(region, area.spaces.active.region_3d, corner).x
        for corner in corners
    ]
    tools, sidebar = (next(r for r in area.regions if r.type == kind) for kind in ("TOOLS", "UI"))
    return max(tools.x + tools.width - region.x - min(across), max(across) - (sidebar.x - region.x))


def lowest_skin(armature: bpy.types.Object) -> float:
    """Return the height of the lowest vertex of the body over all frames, metres."""
    scene = bpy.context.scene
    lowest = float("inf")
    body = next(
        o
        for o in armature.users_collection[0].objects
        if o.type == "MESH" and o.find_armature() == armature
    )
    shown = scene.frame_current
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        posed = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = posed.to_mesh()
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        matrix = np.array(posed.matrix_world)
        lowest = min(lowest, float((points.reshape(-1, 3) @ matrix[2, :3]).min() + matrix[2, 3]))
        posed.to_mesh_clear()
    scene.frame_set(shown)
    return lowest


def body_over_footage(scene: bpy.types.Scene) -> Iterator[float]:
    """Capture again, now that the solver is compiled: the preview shows the body; stop."""
    scene.scope.quality = "BALANCED"
    invoke(bpy.ops.scope.capture, "INVOKE_DEFAULT")
    yield from until(tracked_half, 120, "the preview of the body")
    picture("9_body_over_footage")
    if addon().state.job is not None:  # it has not ended on a fast machine
        invoke(bpy.ops.scope.cancel)
    yield from until(lambda: addon().state.job is None, 20, "the capture to stop")


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    scene = bpy.context.scene
    area = viewport()["area"]
    area.spaces.active.show_region_ui = True
    yield 1.0
    if not show_tab():
        report["tab"] = "could not be chosen by script"
    yield 2.0
    picture("1_new_scene")

    bpy.ops.scope.choose_footage(filepath=FOOTAGE)
    area.tag_redraw()
    yield 1.0
    yield from press(FAST_BUTTON, lambda: scene.scope.quality == "FAST")
    yield 1.0
    report["mouse_chose"] = scene.scope.quality
    picture("2_footage_chosen")

    # so that it does not end before it is cancelled, and is in no cache for the next one
    scene.scope.quality = "BEST"
    before = inventory()
    yield from press(CAPTURE_BUTTON, lambda: addon().state.job is not None)
    worker = addon().state.job.worker
    folder = worker.job_folder
    pid = worker.pid
    yield from until(
        lambda: addon().state.job is None or addon().state.job.progress.done > 0, 120, "the worker"
    )
    assert addon().state.job is not None, addon().state.message
    os.kill(pid, signal.SIGSTOP)  # until it is cancelled: on a fast machine it would end before
    yield 1.0
    picture("3_capturing")
    invoke(bpy.ops.screen.animation_play)
    yield 0.5
    key("Escape")  # over the viewport: stops the playback
    yield from until(
        lambda: not bpy.context.window_manager.windows[0].screen.is_animation_playing,
        20,
        "the playback",
    )
    yield 1.0
    report["after_escape_elsewhere"] = {"capturing": addon().state.job is not None}
    yield from cancel_after_the_question()
    picture("4_cancelled")
    left = [] if inventory() == before else ["data in the file"]
    left += [str(folder)] if folder.exists() else []
    left += [f"process {pid}"] if os.path.exists(f"/proc/{pid}") and worker.alive else []
    left += ["a running job"] if addon().state.job is not None else []
    report["left_after_cancel"] = left

    scene.scope.quality = "FAST"
    yield from press(CAPTURE_BUTTON, lambda: addon().state.job is not None)
    began = time.monotonic()
    last = clocks()
    gaps = []
    pictures = 0
    while addon().state.job is not None:
        yield 0.02
        now = clocks()
        building = (
            addon().state.job is None or addon().state.job.progress.stage == "building the scene"
        )
        if not building:
            gaps.append(now - last)
        last = now
        if now[0] - began > 25 * (pictures + 1) and pictures < 3:
            pictures += 1
            picture(f"5_capturing_{pictures}")
            last = clocks()
    report["capture_s"] = round(time.monotonic() - began, 1)
    report["load_per_core"] = round(os.getloadavg()[0] / (os.cpu_count() or 1), 2)
    for name, column in zip(
        ("timer_gap_ms", "main_thread_ms"), np.sort(1e3 * np.array(gaps), axis=0).T, strict=True
    ):
        shares = {"median": 0.5, "p99": 0.99, "largest": 1.0}
        report[name] = {
            key: round(float(column[int(share * (len(column) - 1))]), 1)
            for key, share in shares.items()
        }
    yield 2.0
    picture("6_result")
    assert scene.scope.result.collection is not None, addon().state.message
    result = scene.scope.result
    report["people"] = result.people
    report["frames"] = result.frames
    report["reprojection_px"] = round(result.reprojection_px, 2)
    report["warnings"] = [w.text for w in result.warnings]
    report["scene_rate"] = [scene.render.fps, round(scene.render.fps_base, 4)]
    armature = next(o for o in result.collection.objects if o.type == "ARMATURE")
    (OUT / "motion.npz").write_bytes(armature["scope_motion"]["motion"])
    report["lowest_skin_m"] = round(lowest_skin(armature), 4)

    invoke(bpy.ops.scope.look_through)
    scene.frame_set(result.frames // 2)
    yield 5.0  # Blender moves the panels below gradually
    picture("7_compared_with_footage")
    yield from until(lambda: frame_covered() <= 0, 20, "the camera's frame beside the sidebar")
    report["frame_covered_px"] = frame_covered()

    invoke(bpy.ops.scope.look_through)
    yield 1.0
    invoke(bpy.ops.scope.smooth, strength=2.5)
    invoke(bpy.ops.scope.root_motion, mode="OBJECT")
    area.tag_redraw()
    yield 1.0
    picture("7_refined")
    scene.view_layers[0].objects.active = next(
        o for o in result.collection.objects if o.type == "ARMATURE"
    )
    invoke(bpy.ops.object.mode_set, mode="POSE")
    invoke(bpy.ops.pose.select_all, action="DESELECT")
    yield 1.0
    picture("7_bones")
    invoke(bpy.ops.object.mode_set, mode="OBJECT")
    invoke(bpy.ops.scope.footage_to_sequencer)
    report["strips"] = sorted(strip.type for strip in strips())
    report["markers"] = [marker.name for marker in scene.timeline_markers]
    invoke(bpy.ops.scope.root_motion, mode="BONES")
    invoke(bpy.ops.scope.smooth, strength=1.0)
    formats = [("FBX", "fbx"), ("GLB", "glb"), ("BVH", "bvh")]
    # Debian builds Blender without USD
    formats += [("USDC", "usdc")] if "usd_export" in dir(bpy.ops.wm) else []
    for kind, suffix in formats:
        invoke(bpy.ops.scope.export, filepath=str(OUT / f"export.{suffix}"), format=kind)
        report["exports"].append(f"export.{suffix}")
    yield 1.0
    invoke(bpy.ops.scope.export, "INVOKE_DEFAULT", format="GLB")
    yield 5.0
    picture("8_export_window")
    for window in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_close()
    yield 1.0

    began = time.monotonic()
    invoke(bpy.ops.scope.capture, "INVOKE_DEFAULT")
    while addon().state.job is not None:
        yield 0.02
    report["cached_capture_s"] = round(time.monotonic() - began, 2)
    bpy.ops.ed.undo()
    yield 1.0
    report["captures_after_undo"] = sum("scope_capture" in c for c in bpy.data.collections)
    picture("9_undone")

    scene = bpy.context.scene
    yield from body_over_footage(scene)
    scene.scope.quality = "FAST"

    scene.scope.footage = "/scope/gone.mp4"
    try:
        invoke(bpy.ops.scope.capture, "INVOKE_DEFAULT")
    except RuntimeError as error:
        report["missing_footage"] = str(error).strip()
    yield 5.0
    picture("10_missing_footage")
    bpy.ops.screen.userpref_show()
    bpy.context.preferences.active_section = "ADDONS"
    bpy.context.window_manager.addon_search = "Scope"
    module = next(a.module for a in bpy.context.preferences.addons if a.module.endswith(".scope"))
    bpy.ops.preferences.addon_expand(module=module)
    yield 3.0
    picture("11_preferences")
    (OUT / "report.json").write_text(json.dumps(report))


run(steps())
