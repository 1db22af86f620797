# SPDX-License-Identifier: GPL-3.0-or-later
"""Human3.6M, subjects S9 and S11 (Ionescu et al., TPAMI 2014), in the layout of its download:

    S9/Videos/Directions 1.54138969.mp4
        50 frames per second
    S9/MyPoseFeatures/D3_Positions_mono/Directions 1.54138969.cdf
        Pose (1, T, 96): 32 joints in the camera, mm
    S9/MyPoseFeatures/D2_Positions/Directions 1.54138969.cdf
        Pose (1, T, 64): pixels; optional

Folders named as h36m-fetch extracts them, ``Poses_D3_Positions_mono`` beside ``Videos``, are
accepted as well. The intrinsics are those that map the joints to their pixels, by least squares.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from ..clips import Clip, Person, Truth
from ..files import DatasetError, checked, existing_files, existing_folder, metres, read_poses
from ..joint_sets import H36M32
from ..models import Models
from ..subjects import MeasuredJoints
from .cameras import intrinsics_of_projection

SUBJECTS = ("S9", "S11")
RATE = 50.0
STEP = 5  # frames; HMR and SPIN evaluate at 10 frames per second
FRONTAL = "60457274"  # the one camera of protocol 2


def clips(folder: Path, models: Models) -> list[Clip]:
    """Return a clip for every video of S9 and S11.

    :raises DatasetError: a folder or a video is missing.
    """
    del models
    found = []
    for subject in SUBJECTS:
        videos = existing_folder(folder / subject / "Videos", "the videos of Human3.6M")
        poses = _features(folder / subject, "D3_Positions_mono")
        for file in existing_files(poses, "*.cdf", "3D positions of Human3.6M"):
            # several sequences in one file, which the download has besides
            if file.name.startswith("_ALL"):
                continue
            video = videos / f"{file.stem}.mp4"
            if not video.is_file():
                raise DatasetError(
                    f"{video} does not exist, but {file} does: download this subject's videos"
                )
            both = ("h36m-p1", "h36m-p2") if file.stem.endswith(f".{FRONTAL}") else ("h36m-p1",)
            name = f"{subject} {file.stem}"
            found.append(Clip(name, [video], RATE, both, partial(_truth, folder / subject, file)))
    return found


def _features(subject: Path, name: str) -> Path:
    """Return the folder of one kind of poses, in either layout."""
    usual = subject / "MyPoseFeatures" / name
    fetched = subject / f"Poses_{name}"
    return fetched if fetched.is_dir() else existing_folder(usual, "the 3D positions of Human3.6M")


def _truth(subject: Path, file: Path) -> Truth:
    points = _joints(file, 3) / 1000
    joints = metres(file, "Pose", points)
    rows = np.arange(0, len(joints), STEP)
    person = Person(
        "person", rows, MeasuredJoints(tuple(H36M32), joints[rows][:, list(H36M32.values())])
    )
    for projected in (
        subject / "MyPoseFeatures" / "D2_Positions" / file.name,
        subject / "Poses_D2_Positions" / file.name,
    ):
        if projected.is_file():
            pixels = checked(projected, "Pose", _joints(projected, 2), (len(joints), 32, 2))
            return Truth([person], intrinsics_of_projection(joints, pixels))
    return Truth([person])


def _joints(file: Path, dimensions: int) -> np.ndarray:
    pose = read_poses(file)
    return checked(file, "Pose", pose, (None, 32 * dimensions)).reshape(-1, 32, dimensions)
