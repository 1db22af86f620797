# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the scenes that build/bench/scenes lacks: ``python -m scope.benchmarks.scenes.render [NUMBER …]``.

Runs as a separate process, because Blender's module prints on standard output and can hang at exit. A clip is kept
until its scene changes.
"""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path

import bpy
import cv2
import numpy as np

from ...solver import Body, load_body
from ...tools.render_sample.clip import affected_box, blend_into
from ...tools.render_sample.stage import encode, pose_person, render_part, render_to
from ..perception.held_out import all_takes
from ..perception.render_shots import fitted_motions, render_if_changed
from .draw import SCENES, draw_scene
from .scene import FOLDER, STATIC, Scene, write_truth
from .surroundings import build_scene, move_camera

SAMPLES, SAMPLES_EMPTY = 4, 32
KBIT_PER_S = 4000
COMPARED = ("limbs", "limbs_cam", "hidden", "view_deg", "stature_m", "mass_index", "loose_m", "takes", "intrinsics",
            "world_from_camera", "size", "fps", "camera", "surroundings", "test")  # fmt: skip


def video_and_truth(name: str) -> tuple[Path, Path]:
    """Return the paths of a scene's clip and its ground truth."""
    return FOLDER / f"{name}.mp4", FOLDER / f"{name}_truth.npz"


def render_missing(body: Body, numbers: list[int]) -> None:
    """Render what is not there or not true any more."""
    takes = all_takes(fitted_motions())
    for number in numbers:
        scene = draw_scene(body, takes, number)

        def render(path: Path, scratch: Path, scene: Scene = scene) -> None:
            encode(_pictures(body, scene, scratch), path, scene.size, round(scene.fps), KBIT_PER_S)

        write = partial(write_truth, body=body, scene=scene)
        render_if_changed(*video_and_truth(scene.name), COMPARED, write, render)


def _pictures(body: Body, scene: Scene, folder: Path) -> list[Path]:
    """Render all frames as numbered pictures; of a static camera's, only where people and their shadows are."""
    meshes, lamps = build_scene(scene, body)
    cycles = bpy.context.scene.cycles
    pictures, empty = [folder / f"{f:04d}.png" for f in range(len(scene))], None
    if scene.camera == STATIC:
        cycles.samples = SAMPLES_EMPTY
        for mesh in meshes:
            mesh.hide_render = True
        render_to(folder / "empty.png")
        empty = cv2.imread(str(folder / "empty.png"))
        for mesh in meshes:
            mesh.hide_render = False
    cycles.samples = SAMPLES
    width, height = scene.size
    offsets = [person.offsets(body) for person in scene.people]
    for f, picture in enumerate(pictures):
        skins = [person.dressed(body, f, off) for person, off in zip(scene.people, offsets, strict=True)]
        for mesh, skin in zip(meshes, skins, strict=True):
            pose_person(mesh, skin)
        if empty is None:
            move_camera(scene.world_from_camera[f])
            render_to(picture)
            continue
        left, top, right, bottom = box = affected_box(scene.shot(f), np.concatenate(skins), lamps)
        render_part((left / width, right / width, 1 - bottom / height, 1 - top / height), picture)
        blend_into(empty, picture, box)
    return pictures


if __name__ == "__main__":
    render_missing(load_body("scope"), [int(n) for n in sys.argv[1:]] or list(range(SCENES)))
    sys.stderr.flush()
    os._exit(0)
