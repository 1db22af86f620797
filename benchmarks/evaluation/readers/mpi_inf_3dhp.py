# SPDX-License-Identifier: GPL-3.0-or-later
"""The test set of MPI-INF-3DHP (Mehta et al., 3DV 2017):

    TS1 … TS6/imageSequence/img_000001.jpg
    TS1 … TS6/annot_data.mat     HDF5; with the axes as HDF5 has them:
        valid_frame (T, 1)              1 where the person is to be evaluated
        univ_annot3 (T, 1, 17, 3)       joints in the camera, mm, scaled to a skeleton of one size,
                                        as the protocol asks
        annot3, annot2 (T, 1, 17, 3 or 2)    joints at their true size, and their pixels

``mpi_inf_3dhp_test_set`` may be the folder or lie in it. The files state no frame rate; 25 frames
per second are assumed, which matters to smoothing alone, because no measure of this protocol is
about time.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from ..clips import Clip, Person, Truth
from ..files import DatasetError, checked, existing_folder, frames_in, metres, read_matlab
from ..joint_sets import TEST_3DHP
from ..models import Models
from ..subjects import MeasuredJoints
from .cameras import intrinsics_of_projection

SEQUENCES = tuple(f"TS{number}" for number in range(1, 7))
RATE = 25.0


def clips(folder: Path, models: Models) -> list[Clip]:
    """Return a clip for each of the six test sequences.

    :raises DatasetError: a folder or file is missing.
    """
    del models
    inner = folder / "mpi_inf_3dhp_test_set"
    root = inner if inner.is_dir() else folder
    found = []
    for name in SEQUENCES:
        existing_folder(
            root / name, f"imageSequence and annot_data.mat of {name} of MPI-INF-3DHP's test set"
        )
        pictures = frames_in(root / name / "imageSequence")
        annotation = root / name / "annot_data.mat"
        if not annotation.is_file():
            raise DatasetError(
                f"{annotation} does not exist; it is part of MPI-INF-3DHP's test set"
            )
        found.append(
            Clip(name, pictures, RATE, ("3dhp",), partial(_truth, annotation, len(pictures)))
        )
    return found


def _truth(path: Path, frames: int) -> Truth:
    shapes = {"univ_annot3": 3, "annot3": 3, "annot2": 2}
    arrays = read_matlab(
        path, {key: (None, 1, 17, n) for key, n in shapes.items()} | {"valid_frame": (None, None)}
    )
    valid = arrays["valid_frame"].ravel() > 0
    count = len(valid)
    for key, n in shapes.items():
        checked(path, key, arrays[key], (count, 1, 17, n))
    if count > frames:
        raise DatasetError(
            f"{path} is about {count} frames, but imageSequence holds {frames}; extract both again"
        )
    rows = np.flatnonzero(valid)
    joints = metres(path, "univ_annot3", arrays["univ_annot3"][rows, 0] / 1000)
    K = intrinsics_of_projection(arrays["annot3"][rows, 0] / 1000, arrays["annot2"][rows, 0])
    return Truth([Person("person", rows, MeasuredJoints(TEST_3DHP, joints))], K)
