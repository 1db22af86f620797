# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m scope.tools.render_sample``: write assets/sample/sample.mp4 and sample_truth.npz. Needs bpy."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from ...solver.body import ASSETS, load_body
from ...solver.frames import transform_points
from .choreography import choreograph
from .truth import BETAS, FPS, INTRINSICS, SIZE, WORLD_FROM_CAMERA, write_truth

KBIT_PER_S = 2000  # 5 s: 1.2 MB
_MARGIN, _FEATHER = 24, 16  # pixels around the person that are rendered, and over which they pass into the room


def main() -> int:
    """Render the clip, or single frames of it to look at."""
    parser = argparse.ArgumentParser(prog="render_sample", description=__doc__)
    parser.add_argument("-o", "--out", type=Path, default=ASSETS / "sample", help="folder (default: assets/sample)")
    parser.add_argument("--frames", type=int, nargs="*", help="render only these frames, as pictures, into the folder")
    arguments = parser.parse_args()
    from .stage import LAMPS, build_stage, encode, pose_person, render_part, render_room

    lamps = np.array([place for place, *_ in LAMPS.values()])
    body = load_body("scope")
    rotations, trans = choreograph(body, BETAS, FPS)
    arguments.out.mkdir(parents=True, exist_ok=True)
    person = build_stage(body, INTRINSICS, SIZE, WORLD_FROM_CAMERA)
    wanted = range(len(trans)) if arguments.frames is None else arguments.frames
    with tempfile.TemporaryDirectory(dir=arguments.out, prefix=".frames") as scratch:
        folder = Path(scratch) if arguments.frames is None else arguments.out
        render_room(person, folder / "room.png")
        room = cv2.imread(str(folder / "room.png"))
        pictures = []
        for f in wanted:
            R_world, t_world = body.forward_kinematics(rotations[f], trans[f], BETAS)
            vertices = body.skin(R_world, t_world, BETAS)
            pose_person(person, vertices)
            left, top, right, bottom = _affected(vertices, lamps)
            width, height = SIZE
            pictures.append(folder / f"{f:04d}.png")
            render_part((left / width, right / width, 1 - bottom / height, 1 - top / height), pictures[-1])
            _into_room(room, pictures[-1], (left, top, right, bottom))
            print(f"{f + 1} / {len(trans)}", file=sys.stderr, flush=True)
        if arguments.frames is None:
            encode(pictures, folder / "sample.mp4", SIZE, FPS, KBIT_PER_S)
            write_truth(folder / "sample_truth.npz", body, rotations, trans)
            for name in ("sample.mp4", "sample_truth.npz"):
                os.replace(folder / name, arguments.out / name)
    return 0


def _affected(vertices_world: np.ndarray, lamps: np.ndarray) -> tuple[int, int, int, int]:
    """Left, top, right, bottom in pixels of what the person and the person's shadows on the floor can change."""
    points = [vertices_world]
    for lamp in lamps:
        share = lamp[2] / (lamp[2] - vertices_world[:, 2:])
        points.append(lamp + (vertices_world - lamp) * share)
    camera = transform_points(np.linalg.inv(WORLD_FROM_CAMERA), np.concatenate(points))
    uv = (camera @ INTRINSICS.T)[:, :2] / camera[:, 2:]
    low = np.clip(np.floor(uv.min(0)) - _MARGIN, 0, SIZE).astype(int)
    high = np.clip(np.ceil(uv.max(0)) + _MARGIN, 0, SIZE).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _into_room(room: np.ndarray, path: Path, box: tuple[int, int, int, int]) -> None:
    """Complete a partly rendered picture with the empty room, without a visible seam."""
    left, top, right, bottom = box
    weight = np.zeros(room.shape[:2], np.float32)
    weight[top:bottom, left:right] = 1
    inner = cv2.copyMakeBorder(weight, 1, 1, 1, 1, cv2.BORDER_REPLICATE).astype(np.uint8)
    weight = np.clip(cv2.distanceTransform(inner, cv2.DIST_L2, 3)[1:-1, 1:-1, None] / _FEATHER, 0, 1)
    part = cv2.imread(str(path))
    cv2.imwrite(str(path), np.round(part * weight + room * (1 - weight)).astype(np.uint8))


if __name__ == "__main__":
    sys.exit(main())
