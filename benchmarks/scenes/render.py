# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the scenes that build/bench/scenes lacks: ``python -m scope.benchmarks.scenes.render
[NUMBER …]``.

Without numbers, those for testing come first, and those of new performers last. Runs as a separate
process, because Blender's module prints on standard output and can hang at exit. A clip is kept
until its scene changes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
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
from ..perception.render_shots import fitted_motions, fitted_new_performers, render_if_changed
from .draw import SCENES, SCENES_OF_NEW_PERFORMERS, draw_scene
from .kinds import split_of
from .scene import FOLDER, NEW_PERFORMERS, STATIC, TEST, Scene, write_truth
from .surroundings import build_scene, move_camera

SAMPLES = 2
SAMPLES_EMPTY = 8
# of width and height that are rendered, before the picture is enlarged: as soft as most footage
PERCENT = 75
KBIT_PER_S = 4000
COMPARED = (
    "limbs",
    "limbs_cam",
    "hidden",
    "view_deg",
    "stature_m",
    "mass_index",
    "loose_m",
    "takes",
    "intrinsics",
    "world_from_camera",
    "size",
    "fps",
    "camera",
    "surroundings",
    "test",
)


def video_and_truth(name: str) -> tuple[Path, Path]:
    """Return the paths of a scene's clip and its ground truth."""
    return FOLDER / f"{name}.mp4", FOLDER / f"{name}_truth.npz"


def render_missing(
    body: Body, numbers: list[int], threads: int = 0, split: str | None = None
) -> None:
    """Render what is not there or not true any more.

    :param threads: of Cycles; 0 for as many as there are cores.
    :param split: as of `draw_scene`.
    """
    takes = all_takes(fitted_new_performers() if split == NEW_PERFORMERS else fitted_motions())
    for number in numbers:
        scene = draw_scene(body, takes, number, split)
        write = partial(write_truth, body=body, scene=scene)
        render = partial(render_scene, body, scene, threads)
        render_if_changed(*video_and_truth(scene.name), COMPARED, write, render)


def render_scene(body: Body, scene: Scene, threads: int, path: Path, scratch: Path) -> None:
    """Render a scene to a path.

    :param threads: of Cycles; 0 for as many as there are cores.
    :param scratch: a folder for its pictures.
    """
    encode(_pictures(body, scene, scratch, threads), path, scene.size, round(scene.fps), KBIT_PER_S)


def _pictures(body: Body, scene: Scene, folder: Path, threads: int) -> list[Path]:
    """Render all frames as numbered pictures; of a static camera's, only where people and their
    shadows are.
    """
    meshes, lamps = build_scene(scene, body)
    cycles = bpy.context.scene.cycles
    settings = bpy.context.scene.render
    settings.resolution_percentage = PERCENT
    settings.threads_mode = "FIXED" if threads else "AUTO"
    settings.threads = threads
    pictures = [folder / f"{f:04d}.png" for f in range(len(scene))]
    empty = None
    if scene.camera == STATIC:
        cycles.samples = SAMPLES_EMPTY
        for mesh in meshes:
            mesh.hide_render = True
        _render(scene, folder / "empty.png")
        empty = cv2.imread(str(folder / "empty.png"))
        for mesh in meshes:
            mesh.hide_render = False
    cycles.samples = SAMPLES
    width, height = scene.size
    offsets = [person.offsets(body) for person in scene.people]
    for f, picture in enumerate(pictures):
        skins = [
            person.dressed(body, f, off) for person, off in zip(scene.people, offsets, strict=True)
        ]
        for mesh, skin in zip(meshes, skins, strict=True):
            pose_person(mesh, skin)
        if empty is None:
            move_camera(scene.world_from_camera[f])
            _render(scene, picture)
            continue
        left, top, right, bottom = box = affected_box(scene.shot(f), np.concatenate(skins), lamps)
        _render(
            scene, picture, (left / width, right / width, 1 - bottom / height, 1 - top / height)
        )
        blend_into(empty, picture, box)
    return pictures


def _render(
    scene: Scene, path: Path, part: tuple[float, float, float, float] | None = None
) -> None:
    """Render the frame, or a part of it as of `render_part`, and enlarge the picture to the scene's
    size.
    """
    if part is None:
        render_to(path)
    else:
        render_part(part, path)
    cv2.imwrite(
        str(path), cv2.resize(cv2.imread(str(path)), scene.size, interpolation=cv2.INTER_CUBIC)
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Render the scenes that are missing.")
    parser.add_argument("numbers", nargs="*", type=int, metavar="NUMBER")
    parser.add_argument(
        "--new-performers", action="store_true", help="scenes of new performers alone"
    )
    parser.add_argument(
        "--threads", type=int, default=0, help="of Cycles; 0 for as many as there are cores"
    )
    arguments = parser.parse_args()
    in_order = sorted(range(SCENES), key=lambda number: (split_of(number) != TEST, number))
    if not arguments.new_performers:
        render_missing(load_body("scope"), arguments.numbers or in_order, arguments.threads)
    if arguments.new_performers or not arguments.numbers:
        of_new = arguments.numbers or list(range(SCENES_OF_NEW_PERFORMERS))
        try:
            render_missing(load_body("scope"), of_new, arguments.threads, NEW_PERFORMERS)
        # it has said why, as where there is no connection or no apt-get
        except subprocess.CalledProcessError:
            if arguments.new_performers:
                raise
            print("the scenes of new performers were left out", file=sys.stderr, flush=True)
    sys.stderr.flush()
    os._exit(0)
