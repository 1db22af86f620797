# SPDX-License-Identifier: GPL-3.0-or-later
"""EMDB (Kaufmann et al., ICCV 2023), as its archives unpack:

    P0/00_mvs_a/P0_00_mvs_a_data.pkl
        gender, emdb1, emdb2, n_frames, good_frames_mask (T,)
        camera: intrinsics (3, 3), extrinsics (T, 4, 4) camera from world
        smpl: poses_root (T, 3), poses_body (T, 69), trans (T, 3), betas (10,)
    P0/00_mvs_a/images/00000.jpg     30 frames per second

EMDB 1 is evaluated in the camera, EMDB 2 in the world. The ground truth needs SMPL of each person's
gender.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..clips import Clip, Person, Truth
from ..files import DatasetError, array, existing_files, frames_in, metres, read_table
from ..models import Models, pose_body

RATE = 30.0
GENDERS = ("female", "male", "neutral")


def clips(folder: Path, models: Models) -> list[Clip]:
    """Return a clip for each sequence of EMDB 1 and EMDB 2.

    :raises DatasetError: a folder or file is missing.
    """
    found = []
    for path in existing_files(folder, "P*/*/*_data.pkl", "sequences of EMDB"):
        table = read_table(path)
        protocols = tuple(key for key in ("emdb1", "emdb2") if bool(table.get(key)))
        if protocols:
            pictures = frames_in(path.parent / "images")
            name = f"{path.parent.parent.name} {path.parent.name}"
            truth = partial(_truth, path, len(pictures), models)
            found.append(Clip(name, pictures, RATE, protocols, truth, alone=False))
    if not found:
        raise DatasetError(
            f"{folder} holds no sequence of EMDB 1 or EMDB 2; download the archives of both"
        )
    return found


def _truth(path: Path, frames: int, models: Models) -> Truth:
    table = read_table(path)
    camera = _inner(path, table, "camera")
    smpl = _inner(path, table, "smpl")
    T_camera_world = array(path, camera, "extrinsics", (None, 4, 4))
    count = len(T_camera_world)
    if count > frames:
        raise DatasetError(
            f"{path} is about {count} frames, but {path.parent / 'images'} holds {frames}"
        )
    gender = table.get("gender")
    gender = gender.decode("latin1") if isinstance(gender, bytes) else gender
    if gender not in GENDERS:
        raise DatasetError(
            f"{path}: gender must be one of {', '.join(GENDERS)}, but is {gender!r:.20}"
        )
    body = models.body("smpl", gender, "EMDB")
    parts = [
        array(path, smpl, key, (count, n)) for key, n in (("poses_root", 3), ("poses_body", 69))
    ]
    trans = metres(path, "trans", array(path, smpl, "trans", (count, 3)))
    world = pose_body(
        body, np.concatenate(parts, axis=1), array(path, smpl, "betas", (None,)), trans
    )
    rows = np.flatnonzero(array(path, table, "good_frames_mask", (count,)) > 0)
    if not len(rows):
        raise DatasetError(f"{path}: good_frames_mask marks no frame; download it again")
    world = world.select(rows)
    person = Person("person", rows, world.moved(T_camera_world[rows]), world)
    return Truth([person], array(path, camera, "intrinsics", (3, 3)))


def _inner(path: Path, table: dict[str, Any], key: str) -> dict[str, Any]:
    value = table.get(key)
    if not isinstance(value, dict):
        raise DatasetError(f"{path} lacks {key}: it is not a file of EMDB; download it again")
    return value
