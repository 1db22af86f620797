# SPDX-License-Identifier: GPL-3.0-or-later
"""The validation split of BEDLAM (Black et al., CVPR 2023):

    all_npz_12_validation/20221019_3-8_250_highbmihand_orbit_stadium_6fps.npz
        one row for each person and image
        imgname (N,)     seq_000000/seq_000000_0000.png        sub (N,)    who it is
        pose_cam (N, 165), shape (N, 11): SMPL-X, neutral, in the camera
        trans_cam (N, 3), cam_ext (N, 4, 4): the translation is trans_cam + cam_ext[:3, 3];
        cam_int (N, 3, 3)
    validation/20221019_3-8_250_highbmihand_orbit_stadium_6fps/png/seq_000000/seq_000000_0000.png

The numbers of the images count frames of 30 per second. The mean of a sequence's shapes is used,
which are equal. Scenes of closeups are left out: their images are stored sideways, their ground
truth is upright.
"""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..clips import Clip, Person, Truth
from ..files import DatasetError, existing_files, existing_folder, frames_in, metres, read_arrays
from ..models import Models, pose_body

RATE = 30.0
_IMAGE = re.compile(r"(seq_\d{6})/(seq_\d{6}_(\d{4})\.(?:png|jpg))")
_SHAPES = {
    **{"pose_cam": (None, 165), "shape": (None, None), "trans_cam": (None, 3)},
    **{"cam_ext": (None, 4, 4), "cam_int": (None, 3, 3)},
}


def clips(folder: Path, models: Models) -> list[Clip]:
    """Return a clip for each sequence of the validation split.

    :raises DatasetError: a folder or file is missing or damaged.
    """
    found = []
    for path in existing_files(
        folder, "all_npz_12_validation/*.npz", "ground truth of BEDLAM's validation split"
    ):
        if "closeup" in path.stem:
            continue
        images = existing_folder(folder / "validation" / path.stem / "png", "the images of BEDLAM")
        for sequence in sorted(_rows_of(path)):
            pictures = frames_in(images / sequence)
            numbers = [
                int(picture.stem.rsplit("_", 1)[-1])
                for picture in pictures
                if _IMAGE.fullmatch(_key(picture))
            ]
            if len(numbers) != len(pictures):
                raise DatasetError(
                    f"{images / sequence} holds other files than seq_000000_0000.png and so on"
                )
            step = math.gcd(*(number - numbers[0] for number in numbers)) or 1
            truth = partial(_truth, path, sequence, pictures, models)
            name = f"{path.stem} {sequence}"
            found.append(Clip(name, pictures, RATE / step, ("bedlam",), truth, alone=False))
    return found


def _key(picture: Path) -> str:
    return f"{picture.parent.name}/{picture.name}"


def _rows_of(path: Path) -> dict[str, NDArray[np.int64]]:
    """Return the rows of the file that are about each sequence."""
    names = read_arrays(path, {}, ("imgname",))["imgname"]
    if names.ndim != 1 or names.dtype.kind != "U":
        raise DatasetError(
            f"{path}: imgname must hold names, but holds {names.dtype}; download it again"
        )
    found: dict[str, list[int]] = {}
    for row, name in enumerate(names.tolist()):
        match = _IMAGE.fullmatch(name)
        if match is None:
            raise DatasetError(
                f"{path}: imgname holds {name!r:.60}, not seq_000000/seq_000000_0000.png and so on"
            )
        found.setdefault(match.group(1), []).append(row)
    return {sequence: np.array(rows) for sequence, rows in found.items()}


def _truth(path: Path, sequence: str, pictures: list[Path], models: Models) -> Truth:
    data = read_arrays(path, _SHAPES, ("imgname", "sub"))
    count = len(data["imgname"])
    if any(len(value) != count for value in data.values()):
        raise DatasetError(f"{path}: its arrays differ in length; download it again")
    rows = _rows_of(path)[sequence]
    position = {_key(picture): k for k, picture in enumerate(pictures)}
    rows = rows[[name in position for name in data["imgname"][rows].tolist()]]
    people = []
    for sub in sorted(set(data["sub"][rows].tolist())):
        mine = rows[data["sub"][rows] == sub]
        at = np.array([position[name] for name in data["imgname"][mine].tolist()])
        order = np.argsort(at, kind="stable")
        if len(set(at.tolist())) == len(at):  # twice in an image is not one person
            people.append(
                Person(f"person_{sub!s:.40}", at[order], _posed(path, data, mine[order], models))
            )
    if not people:
        raise DatasetError(
            f"{path} holds nobody of {sequence} whose images exist; extract both again"
        )
    return Truth(people, data["cam_int"][rows[0]])


def _posed(
    path: Path, data: dict[str, NDArray[Any]], rows: NDArray[np.int64], models: Models
) -> Any:
    trans = metres(path, "trans_cam", data["trans_cam"][rows] + data["cam_ext"][rows, :3, 3])
    body = models.body("smplx", "neutral", "BEDLAM")
    return pose_body(body, data["pose_cam"][rows], data["shape"][rows].mean(axis=0), trans)
