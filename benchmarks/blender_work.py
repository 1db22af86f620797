# SPDX-License-Identifier: GPL-3.0-or-later
"""Time writing and editing keys with Blender's own module; runs in a separate process and prints
JSON.

python -m scope.benchmarks.blender_work MOTION ROUNDS    MOTION: a captured .npz, which is played
                                                         forwards and backwards
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..scope_addon.kinematics.face import EXPRESSIONS
from ..scope_addon.motion import Motion
from ..scope_addon.scene.actions import Channels
from ..scope_addon.scene.build import BuildOptions, build_scene
from ..scope_addon.scene.character.animation import animate_armature
from ..scope_addon.scene.character.armature import build_armature, rest_pose
from ..scope_addon.scene.character.body_mesh import (
    add_expression_keys,
    build_mesh,
    key_expressions,
    rest_vertices_world,
)
from ..scope_addon.scene.packed_motion import pack_motion
from ..scope_addon.untrusted.body_file import load_body

WRITTEN = 10_000  # frames
LENGTHS = {"half_a_minute": 900, "five_minutes": 9000}  # frames, at 30 per second


def longer(motion: Motion, count: int) -> Motion:
    """Return the motion played forwards and backwards until it has ``count`` frames."""
    there = np.arange(len(motion))
    rows = np.resize(np.concatenate([there, there[-2:0:-1]]), count)
    arrays = {
        f.name: v for f in fields(motion) if isinstance(v := getattr(motion, f.name), np.ndarray)
    }
    per_frame = {
        name: values[rows] for name, values in arrays.items() if len(values) == len(motion)
    }
    numbers = np.arange(count)
    return replace(
        motion, **per_frame | {"frames": numbers, "timestamps": numbers / motion.mocap_framerate}
    )


def moving_face(count: int) -> dict[str, NDArray[Any]]:
    """Return a face whose 52 expressions all move in every frame, each by waves of its own."""
    phases = np.arange(count)[:, None] * np.linspace(0.05, 0.3, len(EXPRESSIONS))
    return {
        "expressions": (0.5 - 0.5 * np.cos(phases)).astype(np.float32),
        "expression_names": np.array(EXPRESSIONS),
        "expression_confidence": np.ones(count, np.float32),
        "gaze": np.tile(np.array([0.0, 0.0, 1.0], np.float32), (count, 2, 1)),
        "face_points": np.full((count, 3, 2), 50.0, np.float32),
        "face_landmarks": np.array([1, 33, 263]),
    }


def median_s(
    rounds: int, work: Callable[[], object], before: Callable[[], object] = lambda: None
) -> float:
    """Return the median duration of ``work`` in seconds; ``before`` is called before each round and
    not timed.
    """
    times = []
    for _ in range(rounds):
        before()
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return round(statistics.median(times), 4)


def fresh() -> None:
    """Open an empty file at 30 frames per second."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = 30
    bpy.context.scene.render.fps_base = 1.0


def writing(motion: Motion, rounds: int) -> dict[str, float]:
    """Time the keys alone, those of a face as well, and the whole scene: body, shape keys, camera,
    confidence.
    """
    body = load_body("scope")
    long = longer(motion, WRITTEN)
    rest = rest_pose(body, long.betas)
    frames = np.arange(WRITTEN, dtype=float)
    facing = replace(long, face=moving_face(WRITTEN))
    made: dict[str, Any] = {}

    def prepare() -> None:
        fresh()
        made["rig"] = build_armature("rig", body, rest, bpy.context.scene.collection)
        made["action"] = bpy.data.actions.new("rig")

    def prepare_face() -> None:
        prepare()
        vertices = rest_vertices_world(body, rest.lift, long.betas)
        made["mesh"] = build_mesh("body", body, vertices, bpy.context.scene.collection)
        add_expression_keys(made["mesh"], body)

    def write() -> None:
        animate_armature(made["rig"], made["action"], body, long, rest, frames)

    def write_both() -> None:
        write()
        channels = Channels(made["mesh"].data.shape_keys, made["action"])
        key_expressions(made["mesh"], channels, facing, frames)

    keys = median_s(rounds, write, prepare)
    both = median_s(rounds, write_both, prepare_face)
    scene = median_s(
        rounds, lambda: build_scene([long], body, None, BuildOptions(start_frame=1.0)), fresh
    )
    return {"keys_s": keys, "keys_with_face_s": both, "whole_scene_s": scene}


def working_again(motion: Motion, rounds: int) -> dict[str, dict[str, float]]:
    """Time the panel's operators on a capture."""
    body = load_body("scope")
    figures = {}
    for name, count in LENGTHS.items():
        fresh()
        long = longer(motion, count)
        rig = build_scene([long], body, None, BuildOptions(start_frame=1.0)).people[0].armature
        pack_motion(rig, long.to_bytes())
        rig["scope_body_file"] = "scope"
        own = bpy.data.objects.new("own", rig.data.copy())
        bpy.context.scene.collection.objects.link(own)
        own.scale = (1.2, 1.2, 1.2)
        bpy.context.view_layer.objects.active = rig
        bpy.context.scene.scope_retarget.rig = own
        bpy.ops.scope.guess_bones()
        figures[name] = {
            "smooth": median_s(rounds, lambda: bpy.ops.scope.smooth(strength=2.0)),
            "floor": median_s(rounds, bpy.ops.scope.refloor),
            "retarget": median_s(rounds, bpy.ops.scope.retarget),
        }
    return figures


def main(path: Path, rounds: int) -> None:
    """Measure and print."""
    from .. import register

    register()
    motion = Motion.load(path)
    figures = {
        "blender": bpy.app.version_string,
        "writing": writing(motion, rounds),
        "working_again": working_again(motion, rounds),
    }
    print(json.dumps(figures), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
    os._exit(0)  # Blender's module can hang at exit
