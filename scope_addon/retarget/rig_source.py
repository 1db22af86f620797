# SPDX-License-Identifier: GPL-3.0-or-later
"""Which rig a motion is to be put on, by file. Free of bpy, so that a command line can check it before the work."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ...solver.errors import InputError
from ..errors import UsageError
from .bone_map import BoneMap, load_bone_map

ROOTS = ("bone", "object", "in-place")  # where a rig keeps the way over the floor
RIG_SUFFIXES = (".blend", ".fbx", ".glb", ".gltf")
_BEGINNINGS = {
    ".blend": (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b"),  # plain, Zstandard, gzip
    ".fbx": (b"Kaydara FBX Binary",),
    ".glb": (b"glTF",),
}


@dataclass(frozen=True)
class RigSource:
    """A file with a rig, the armature in it where there are several, and its bones where they are not to be guessed."""

    path: Path
    armature: str = ""
    bone_map: BoneMap | None = None


def rig_source(path: Path, armature: str = "", bone_map: Path | None = None) -> RigSource:
    """What the user has named, checked as far as it can be without Blender.

    :raises UsageError: a file of another kind. :raises InputError: it is missing or not what its suffix says.
    """
    suffix = path.suffix.lower()
    if suffix not in RIG_SUFFIXES:
        raise UsageError(f"cannot read a rig from '{path.name}': its suffix must be one of {', '.join(RIG_SUFFIXES)}")
    try:
        with path.open("rb") as file:
            begins = file.read(32)
    except OSError as error:
        raise InputError(f"{path}: the rig cannot be read ({error.strerror}); choose another file") from error
    if suffix == ".fbx" and begins.lstrip().startswith(b";"):
        raise InputError(f"{path}: Blender does not read FBX as text; save it as binary FBX")
    if suffix in _BEGINNINGS and not begins.startswith(_BEGINNINGS[suffix]):
        raise InputError(f"{path}: this is no {suffix} file; choose the file that holds your rig")
    return RigSource(path, armature, load_bone_map(bone_map) if bone_map is not None else None)
