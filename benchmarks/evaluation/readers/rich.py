# SPDX-License-Identifier: GPL-3.0-or-later
"""The test split of RICH (Huang et al., CVPR 2022), in the layout of its toolkit:

    bodies/test/Gym_011_pushup1/00045/011.pkl        SMPL-X in the world: global_orient (1, 3),
                                                     body_pose (1, 63),
                                                     transl (1, 3), betas (1, 10)
    images/test/Gym_011_pushup1/cam_02/00045_02.jpeg (or .png, .bmp), 30 frames per second
    scan_calibration/Gym/calibration/002.xml         CameraMatrix (3 × 4, camera from world),
                                                     Intrinsics (3 × 3)

As in the publications, sequences of two people are left out. Every camera in the folder is a clip.
The world is the calibration's.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path

import numpy as np

from ..clips import Clip, Person, Truth
from ..files import (
    DatasetError,
    array,
    checked,
    existing_files,
    existing_folder,
    frames_in,
    metres,
    read_table,
)
from ..models import Models, pose_body

RATE = 30.0
MALE = ("011",)  # of the test split's subjects, by the toolkit's table; the others are female
LARGEST_XML = 1 << 20


def clips(folder: Path, models: Models) -> list[Clip]:
    """Return a clip for each camera of each sequence of the test split that shows one person.

    :raises DatasetError: a folder or file is missing.
    """
    images = existing_folder(folder / "images" / "test", "the images of RICH's test split")
    existing_folder(folder / "bodies" / "test", "the bodies of RICH's test split")
    found = []
    for camera in sorted(images.glob("*/cam_*")):
        sequence = camera.parent.name
        if len(sequence.split("_")) == 3:
            pictures = frames_in(camera)
            truth = partial(_truth, folder, sequence, camera.name, pictures, models)
            found.append(Clip(f"{sequence} {camera.name}", pictures, RATE, ("rich",), truth))
    if not found:
        raise DatasetError(f"{images} holds no folder such as Gym_011_pushup1/cam_02")
    return found


def _truth(folder: Path, sequence: str, camera: str, pictures: list[Path], models: Models) -> Truth:
    place, subject, _ = sequence.split("_")
    T_camera_world, K = read_calibration(folder, place, camera)
    bodies = folder / "bodies" / "test" / sequence
    files = existing_files(bodies, f"*/{subject}.pkl", f"the bodies of subject {subject} of RICH")
    by_frame = {path.parent.name: path for path in files}
    names = [picture.name.split("_")[0] for picture in pictures]
    rows = [row for row, name in enumerate(names) if name in by_frame]
    if not rows:
        raise DatasetError(
            f"{bodies} and {pictures[0].parent} have no frame in common; extract both again"
        )
    poses = []
    trans = []
    betas = []
    for row in rows:
        path = by_frame[names[row]]
        table = read_table(path)
        orient = array(path, table, "global_orient", (1, 3))
        posed = array(path, table, "body_pose", (1, 63))
        poses.append(np.concatenate([orient, posed], axis=1)[0])
        trans.append(metres(path, "transl", array(path, table, "transl", (1, 3)))[0])
        betas.append(array(path, table, "betas", (1, None))[0][:10])
    body = models.body("smplx", "male" if subject in MALE else "female", "RICH")
    world = pose_body(body, np.array(poses), np.mean(betas, axis=0), np.array(trans))
    return Truth([Person("person", np.array(rows), world.moved(T_camera_world), world)], K)


def read_calibration(folder: Path, place: str, camera: str) -> tuple[np.ndarray, np.ndarray]:
    """Return camera from world (4, 4) and the intrinsics (3, 3) of a camera, whose folder is named
    ``cam_02``.

    :raises DatasetError: missing or damaged.
    """
    number = camera.removeprefix("cam_")
    path = folder / "scan_calibration" / place / "calibration" / f"{number.zfill(3)}.xml"
    if not path.is_file():
        raise DatasetError(f"{path} does not exist; download scan_calibration of RICH")
    content = path.read_bytes()[: LARGEST_XML + 1]
    if len(content) > LARGEST_XML or b"<!ENTITY" in content or b"<!DOCTYPE" in content:
        raise DatasetError(f"{path} is not a calibration of RICH; download scan_calibration again")
    try:
        tree = ET.fromstring(content)
        values = [
            np.array((tree.findtext(f"{key}/data") or "").split(), float).reshape(shape)
            for key, shape in (("CameraMatrix", (3, 4)), ("Intrinsics", (3, 3)))
        ]
    except (ET.ParseError, ValueError) as error:
        raise DatasetError(
            f"{path} is not a calibration of RICH ({error}); download scan_calibration again"
        ) from error
    T = np.eye(4)
    T[:3] = checked(path, "CameraMatrix", values[0], (3, 4))
    return T, checked(path, "Intrinsics", values[1], (3, 3))
