# SPDX-License-Identifier: GPL-3.0-or-later
"""The test split of 3DPW (von Marcard et al., ECCV 2018):

sequenceFiles/test/downtown_arguing_00.pkl       a pickle of Python 2; lists have one entry for each
                                                 person
    jointPositions[p] (T, 72)      SMPL's 24 joints in the world, metres
    poses[p] (T, 72), betas[p] (10 or more), trans[p] (T, 3), genders[p] m or f
    cam_poses (T, 4, 4)            camera from world;   cam_intrinsics (3, 3)
    campose_valid[p] (T,)          1 where the camera's pose fits the image: the frames that are
                                   evaluated
    poses2d[p] (T, 3, 18)          all 0 where no 2D pose was found: the challenge leaves these
                                   frames out
imageFiles/downtown_arguing_00/image_00000.jpg   30 frames per second
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from ..clips import Clip, Person, Truth
from ..files import DatasetError, array, existing_files, frames_in, metres, read_table
from ..joint_sets import SMPL24
from ..models import Models, pose_body
from ..subjects import MeasuredJoints, Subject

RATE = 30.0
_GENDERS = {"m": "male", "f": "female"}


def clips(folder: Path, models: Models) -> list[Clip]:
    """Return a clip for each sequence of the test split.

    :raises DatasetError: a folder or file is missing.
    """
    found = []
    for path in existing_files(
        folder, "sequenceFiles/test/*.pkl", "sequences of 3DPW's test split"
    ):
        pictures = frames_in(folder / "imageFiles" / path.stem)
        protocols = ("3dpw-mesh",) if _by_mesh(models) else ("3dpw",)
        truth = partial(_truth, path, len(pictures), models)
        found.append(Clip(path.stem, pictures, RATE, protocols, truth, alone=False))
    return found


def _by_mesh(models: Models) -> bool:
    """Whether the joints are those that the regressor gives from SMPL's mesh, as in the
    publications.
    """
    return models.folder is not None and models.regressor is not None


def _truth(path: Path, frames: int, models: Models) -> Truth:
    table = read_table(path)
    T_camera_world = array(path, table, "cam_poses", (None, 4, 4))
    count = len(T_camera_world)
    if count > frames:
        raise DatasetError(
            f"{path} is about {count} frames, but its folder in imageFiles holds {frames}"
        )
    K = array(path, table, "cam_intrinsics", (3, 3))
    number = len(table["jointPositions"]) if isinstance(table.get("jointPositions"), list) else 0
    people = []
    for p in range(number):
        evaluated = array(path, table, "campose_valid", (count,), p) > 0
        if not _by_mesh(models):
            evaluated &= array(path, table, "poses2d", (count, 3, 18), p).any(axis=(1, 2))
        rows = np.flatnonzero(evaluated)
        if not len(rows):
            continue
        subject = (
            _posed(path, table, p, count, models)
            if _by_mesh(models)
            else _joints(path, table, p, count)
        )
        people.append(
            Person(f"person{p}", rows, _in_camera(subject.select(rows), T_camera_world[rows]))
        )
    if not people:
        raise DatasetError(
            f"{path} holds nobody whose frames are to be evaluated; download it again"
        )
    return Truth(people, K)


def _joints(path: Path, table: dict, p: int, count: int) -> Subject:
    points = array(path, table, "jointPositions", (count, 72), p).reshape(-1, 24, 3)
    return MeasuredJoints(SMPL24, metres(path, "jointPositions", points))


def _posed(path: Path, table: dict, p: int, count: int, models: Models) -> Subject:
    genders = table.get("genders")
    gender = genders[p] if isinstance(genders, list) and p < len(genders) else None
    gender = gender.decode("latin1") if isinstance(gender, bytes) else gender
    if gender not in _GENDERS:
        raise DatasetError(
            f"{path}: genders must list m or f, but person {p} has {gender!r:.20}; "
            "download it again"
        )
    body = models.body("smpl", _GENDERS[gender], "3DPW")
    betas = array(path, table, "betas", (None,), p)
    trans = metres(path, "trans", array(path, table, "trans", (count, 3), p))
    poses = array(path, table, "poses", (count, 72), p)
    return pose_body(body, poses, betas, trans, models.regressor_for(body))


def _in_camera(subject: Subject, T: np.ndarray) -> Subject:
    if not isinstance(subject, MeasuredJoints):
        return subject.moved(T)
    points = np.einsum("tij,tkj->tki", T[:, :3, :3], subject.positions) + T[:, None, :3, 3]
    return MeasuredJoints(subject.names, points)
