# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a shot: the empty room once, and the person in it frame by frame. Needs bpy."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from .stage import LAMPS, build_stage, encode, pose_person, render_part, render_room
from .truth import Shot

KBIT_PER_S = 2000  # 5 s: 1.2 MB
# pixels around the person that are rendered, and over which they are blended with the room
_MARGIN = 24
_FEATHER = 16


def render_clip(body: Body, shot: Shot, path: Path, scratch: Path) -> None:
    """Render the shot to an .mp4 file; its pictures are left in the folder ``scratch``."""
    pictures = render_pictures(body, shot, range(len(shot)), scratch)
    encode(pictures, path, shot.size, round(shot.fps), KBIT_PER_S)


def render_pictures(body: Body, shot: Shot, frames: Iterable[int], folder: Path) -> list[Path]:
    """Render frames of the shot as numbered pictures into the folder."""
    lamps = np.array([place for place, *_ in LAMPS.values()])
    person = build_stage(body, shot.intrinsics, shot.size, shot.world_from_camera)
    render_room(person, folder / "room.png")
    room = cv2.imread(str(folder / "room.png"))
    pictures = []
    for f in frames:
        vertices = shot.vertices_world(body, f)
        pose_person(person, vertices)
        left, top, right, bottom = affected_box(shot, vertices, lamps)
        width, height = shot.size
        pictures.append(folder / f"{f:04d}.png")
        render_part(
            (left / width, right / width, 1 - bottom / height, 1 - top / height), pictures[-1]
        )
        blend_into(room, pictures[-1], (left, top, right, bottom))
        print(f"{f + 1} / {len(shot)}", file=sys.stderr, flush=True)
    return pictures


def affected_box(
    shot: Shot, vertices_world: NDArray[np.float64], lamps: NDArray[np.float64]
) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom, in pixels, of the area that person and shadows can
    change.
    """
    points = [vertices_world]
    for lamp in lamps:
        share = lamp[2] / (lamp[2] - vertices_world[:, 2:])
        points.append(lamp + (vertices_world - lamp) * share)
    uv = shot.project(shot.to_camera(np.concatenate(points)))
    low = np.clip(np.floor(uv.min(0)) - _MARGIN, 0, shot.size).astype(int)
    high = np.clip(np.ceil(uv.max(0)) + _MARGIN, 0, shot.size).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def blend_into(room: NDArray[Any], path: Path, box: tuple[int, int, int, int]) -> None:
    """Complete a partly rendered picture with the empty room, without a visible seam."""
    left, top, right, bottom = box
    weight = np.zeros(room.shape[:2], np.float32)
    weight[top:bottom, left:right] = 1
    inner = cv2.copyMakeBorder(weight, 1, 1, 1, 1, cv2.BORDER_REPLICATE).astype(np.uint8)
    weight = np.clip(
        cv2.distanceTransform(inner, cv2.DIST_L2, 3)[1:-1, 1:-1, None] / _FEATHER, 0, 1
    )
    part = cv2.imread(str(path))
    cv2.imwrite(str(path), np.round(part * weight + room * (1 - weight)).astype(np.uint8))
