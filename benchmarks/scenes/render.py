# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the scenes that build/bench/scenes lacks: ``python -m scope.benchmarks.scenes.render [NUMBER …]``.

Runs as a separate process, because Blender's module prints on standard output and can hang at exit. A clip is kept
until its scene changes.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import bpy
import cv2
import numpy as np

from ...scope_addon.atomic_write import atomic_path
from ...solver import Body, load_body
from ...tools.render_sample.clip import affected_box, blend_into
from ...tools.render_sample.stage import encode, pose_person, render_part, render_to
from ..frames import CACHE
from ..perception.held_out import all_takes
from ..perception.render_shots import fitted_motions
from .draw import SCENES, draw_scene
from .scene import STATIC, Scene, write_truth
from .surroundings import build_scene, move_camera

FOLDER = CACHE / "scenes"
SAMPLES, SAMPLES_EMPTY = 4, 32
KBIT_PER_S = 4000
SAME_M = 1e-3


def video_and_truth(name: str) -> tuple[Path, Path]:
    """Return the paths of a scene's clip and its ground truth."""
    return FOLDER / f"{name}.mp4", FOLDER / f"{name}_truth.npz"


def render_missing(body: Body, numbers: list[int]) -> None:
    """Render what is not there or not true any more."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    takes = all_takes(fitted_motions())
    for number in numbers:
        scene = draw_scene(body, takes, number)
        video, truth = video_and_truth(scene.name)
        with tempfile.TemporaryDirectory(dir=FOLDER, prefix=".frames") as scratch:
            drawn = Path(scratch) / truth.name
            write_truth(drawn, body, scene)
            if video.is_file() and truth.is_file() and _same(drawn, truth):
                continue
            print(f"rendering {scene.name}", file=sys.stderr, flush=True)
            truth.unlink(missing_ok=True)  # a video without ground truth is rendered again
            with atomic_path(video) as part:
                encode(_pictures(body, scene, Path(scratch)), part, scene.size, round(scene.fps), KBIT_PER_S)
            os.replace(drawn, truth)


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


def _same(drawn: Path, kept: Path) -> bool:
    with np.load(drawn) as a, np.load(kept) as b:
        if set(a.files) != set(b.files):
            return False
        same = [
            np.allclose(a[key], b[key], rtol=0, atol=SAME_M)
            if a[key].dtype.kind == "f"
            else np.array_equal(a[key], b[key])
            for key in a.files
            if a[key].shape == b[key].shape
        ]
        return len(same) == len(a.files) and all(same)


if __name__ == "__main__":
    render_missing(load_body("scope"), [int(n) for n in sys.argv[1:]] or list(range(SCENES)))
    sys.stderr.flush()
    os._exit(0)
