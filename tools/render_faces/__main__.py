# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.render_faces SET``: write a set's pictures and truth to build/faces/SET. Needs bpy."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...solver.body import Body
from ...solver.loaders.body_file import load_body
from .identities import draw_identity, identity_targets
from .looks import draw_look
from .sequences import FaceClip, random_poses, talk_and_grimaces
from .shaded import ShadedStage
from .truth import FOLDER, camera_vertices, focal_px, write_truth

Kind = tuple[Callable[..., FaceClip], int, dict[str, Any], bool]
SETS: dict[str, Kind] = {  # what is drawn, the seed, and whether Cycles renders it
    "poses": (random_poses, 11, {"people": 100, "each": 25}, False),
    "shaded_talk": (talk_and_grimaces, 14, {"people": 8, "seconds": 5.0}, False),
    "talk": (talk_and_grimaces, 12, {"people": 6, "seconds": 5.0}, True),
    "talk_held_out": (talk_and_grimaces, 22, {"people": 4, "seconds": 5.0}, True),
}


def main() -> int:
    """Render what is missing of a set."""
    parser = argparse.ArgumentParser(prog="render_faces", description=__doc__)
    parser.add_argument("set", choices=SETS)
    parser.add_argument("-o", "--out", type=Path, help="folder (default: build/faces/SET)")
    arguments = parser.parse_args()
    draw, seed, sizes, cycles = SETS[arguments.set]
    rng = np.random.default_rng(seed)
    clip = draw(rng, **sizes)
    targets = identity_targets()
    identities = np.array([draw_identity(targets, rng) for _ in range(sizes["people"])])
    folder = arguments.out or FOLDER / arguments.set
    folder.mkdir(parents=True, exist_ok=True)
    body = load_body("scope")
    write_truth(folder / "truth.npz", body, clip, identities)
    stage, dressed = _stage(body, cycles), -1
    for t in range(len(clip.weights)):
        if clip.person[t] != dressed:
            dressed = int(clip.person[t])
            look = np.random.default_rng([seed, dressed])
            stage.dress(draw_look(body, look), look)
        path = folder / f"{t:04d}.png"
        if not path.is_file():
            stage.render(camera_vertices(body, clip, identities, t), focal_px(clip.distance[t]), path)
            print(f"{t + 1} / {len(clip.weights)}", file=sys.stderr, flush=True)
    return 0


def _stage(body: Body, cycles: bool) -> Any:
    if not cycles:
        return ShadedStage(body)
    from .stage import Stage

    return Stage(body)


if __name__ == "__main__":
    status = main()
    sys.stderr.flush()
    os._exit(status)  # Blender's module can hang at exit
