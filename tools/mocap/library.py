# SPDX-License-Identifier: GPL-3.0-or-later
"""The three archives of ``shared/data/mocap`` as a list of takes."""

from __future__ import annotations

import tarfile
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.errors import MotionFileError
from .formats import asf_amc, deepmimic, expmap
from .formats.asf_amc import Skeleton
from .take import Take

ARCHIVES = ("cmu_asf_amc", "cmu_expmap", "deepmimic_humanoid")
CMU_FPS = 120.0


def load_library(folder: str | Path, fps: float | None = None) -> list[Take]:
    """Return every take of the archives, in the common coordinate frame of ``Take`` (y up, metres).

    :param folder: the folder of the three .tar.xz.
    :param fps: leave out frames so that takes have about this rate; None keeps all.
    :return: takes without duplicates, ordered by source and name.
    :raises MotionFileError: when an archive is missing or a file in it cannot be read.
    """
    texts = {archive: read_archive(Path(folder) / f"{archive}.tar.xz") for archive in ARCHIVES}
    amc, skeletons = load_asf_amc(texts["cmu_asf_amc"])
    takes = amc + load_expmap(texts["cmu_expmap"], expmap.average_skeleton(skeletons))
    takes += load_deepmimic(texts["deepmimic_humanoid"])
    takes = without_doubles(takes)
    return takes if fps is None else [take.resampled(fps) for take in takes]


def read_archive(path: Path) -> dict[str, str]:
    """Return the text of every file in a .tar.xz by its path inside; nothing is unpacked to disk.

    :raises MotionFileError: when the archive is missing or broken.
    """
    try:
        with tarfile.open(path, "r:xz") as archive:
            found = {}
            for member in archive:
                stream = archive.extractfile(member) if member.isfile() else None
                if stream is not None:
                    found[str(PurePosixPath(member.name))] = stream.read().decode(
                        "utf-8", "replace"
                    )
            return found
    except (OSError, tarfile.TarError, EOFError) as error:
        raise MotionFileError(f"{path}: cannot be read as a .tar.xz archive ({error})") from error


def load_asf_amc(texts: dict[str, str]) -> tuple[list[Take], list[Skeleton]]:
    """Read the takes and skeletons of the Acclaim archive; ``02/02_01.amc`` belongs to
    ``02/02.asf``.
    """
    takes = []
    skeletons = {}
    for path in sorted(p for p in texts if p.endswith(".asf")):
        skeletons[PurePosixPath(path).stem] = asf_amc.parse_asf(texts[path], path)
    for path in sorted(p for p in texts if p.endswith(".amc")):
        subject = PurePosixPath(path).parent.name
        if subject not in skeletons:
            raise MotionFileError(
                f"{path}: its skeleton {subject}.asf is missing in the same folder"
            )
        skeleton = skeletons[subject]
        M, root = asf_amc.parse_amc(texts[path], skeleton, path)
        takes.append(
            _cmu_take(PurePosixPath(path).stem, f"cmu_{subject}", "cmu_asf_amc", skeleton, M, root)
        )
    return takes, list(skeletons.values())


def load_expmap(texts: dict[str, str], skeleton: Skeleton) -> list[Take]:
    """Read the exponential-map archive; each take has a scaled skeleton of its own, because
    performers are unknown.
    """
    takes = []
    for path in sorted(p for p in texts if p.endswith(".txt")):
        phi, root = expmap.parse_expmap(texts[path], path)
        root = root * skeleton.metres_per_unit
        M = expmap.bone_rotations(phi, skeleton)
        R, _ = skeleton.forward_kinematics(M, root)
        scaled = skeleton.scaled(expmap.standing_scale(R, root, skeleton))
        name = "_".join(PurePosixPath(path).with_suffix("").parts[-3::2])
        takes.append(_cmu_take(name, f"expmap_{name}", "cmu_expmap", scaled, M, root))
    return takes


def load_deepmimic(texts: dict[str, str]) -> list[Take]:
    """Read the takes of the DeepMimic archive's humanoid; other characters are skipped."""
    path = "characters/humanoid3d.txt"
    if path not in texts:
        raise MotionFileError(f"the DeepMimic archive has no {path}")
    character = deepmimic.parse_character(texts[path], path)
    return [
        deepmimic.read_take(texts[p], character, PurePosixPath(p).stem.removeprefix("humanoid3d_"))
        for p in sorted(texts)
        if PurePosixPath(p).name.startswith("humanoid3d") and p.startswith("motions/")
    ]


def without_doubles(takes: list[Take]) -> list[Take]:
    """Leave out each take that repeats an earlier one of the same length.

    CMU's root trajectory (120 values per second, the same unit in both CMU archives) identifies a
    recording: two takes are the same if the trajectory of one occurs in the other to within half a
    millimetre.
    """
    kept: list[Take] = []
    for take in takes:
        if not any(
            _same_recording(take, other) for other in kept if other.source.startswith("cmu_")
        ):
            kept.append(take)
    return kept


def _same_recording(take: Take, other: Take) -> bool:
    """Return whether the root trajectory of ``take`` is a section of that of ``other``."""
    path = take.joint("pelvis")
    longer = other.joint("pelvis")
    if take.source == "deepmimic" or len(path) > len(longer) + 1:
        return False
    starts = np.flatnonzero(np.abs(longer - path[0]).max(axis=1) < 5e-4)
    for start in starts:
        n = min(len(path), len(longer) - start)
        if n > 0.9 * len(path) and np.abs(longer[start : start + n] - path[:n]).max() < 5e-4:
            return True
    return False


def _cmu_take(
    name: str,
    subject: str,
    source: str,
    skeleton: Skeleton,
    M: NDArray[np.float64],
    root: NDArray[np.float64],
) -> Take:
    names, positions, orientations = skeleton.named_joints(*skeleton.forward_kinematics(M, root))
    return Take(name, subject, CMU_FPS, names, positions, source, orientations=orientations)
