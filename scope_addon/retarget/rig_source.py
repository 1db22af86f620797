# SPDX-License-Identifier: GPL-3.0-or-later
"""The rig file that a motion is retargeted to. Free of bpy, so that the command line can check it
first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ...solver.errors import InputError
from ..errors import UsageError
from ..untrusted.files import check_regular
from .bone_map import BoneMap, load_bone_map
from .expression_map import ExpressionMap, load_expression_map
from .fbx_check import check_fbx
from .gltf_check import check_gltf, humanoid_table

_LARGEST_BYTES = 4 << 30
ROOTS = ("bone", "object", "in-place")  # Where a rig stores the root motion.
RIG_SUFFIXES = (".blend", ".fbx", ".glb", ".gltf", ".vrm")
_SIGNATURES = {
    ".blend": (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b"),  # plain, Zstandard, gzip
    ".fbx": (b"Kaydara FBX Binary",),
    ".glb": (b"glTF",),
    ".vrm": (b"glTF",),  # an avatar in a .glb
}


@dataclass(frozen=True)
class RigSource:
    """A file with a rig, the name of the armature if there are several, and the maps unless they
    are to be guessed.
    """

    path: Path
    armature: str = ""
    bone_map: BoneMap | None = None
    expression_map: ExpressionMap | None = None
    # Bone of each of VRM's parts, if the file says so.
    humanoid: Mapping[str, str] = field(default_factory=dict)


def rig_source(
    path: Path, armature: str = "", bone_map: Path | None = None, expression_map: Path | None = None
) -> RigSource:
    """Check the user's rig file as far as possible without Blender.

    :param armature: name of the armature in the file; may be empty if there is only one.
    :param bone_map: file with a bone map; None to guess one.
    :param expression_map: file with an expression map; None to guess one.
    :raises UsageError: when the suffix is not that of a supported format.
    :raises InputError: when a file cannot be read, or its content does not match its suffix.
    """
    suffix = path.suffix.lower()
    if suffix not in RIG_SUFFIXES:
        raise UsageError(
            f"cannot read a rig from '{path.name}': its suffix must be one of "
            f"{', '.join(RIG_SUFFIXES)}"
        )
    check_regular(path, InputError, "rig", _LARGEST_BYTES)
    try:
        _check_content(path, suffix)
    except OSError as error:
        raise InputError(
            f"{path}: the rig cannot be read ({error.strerror}); choose another file"
        ) from error
    return RigSource(
        path,
        armature,
        load_bone_map(bone_map) if bone_map is not None else None,
        load_expression_map(expression_map) if expression_map is not None else None,
        humanoid_table(path) if suffix in (".vrm", ".glb", ".gltf") else {},
    )


def _check_content(path: Path, suffix: str) -> None:
    """Check that a file is what its suffix says, and complete as far as its structure shows."""
    with path.open("rb") as file:
        header = file.read(32)
    if suffix == ".fbx" and header.lstrip().startswith(b";"):
        raise InputError(f"{path}: Blender does not read FBX as text; save it as binary FBX")
    if suffix in _SIGNATURES and not header.startswith(_SIGNATURES[suffix]):
        raise InputError(
            f"{path}: this is not a {suffix} file; choose the file that holds your rig"
        )
    if suffix == ".fbx":
        check_fbx(path)
    elif suffix != ".blend":
        check_gltf(path)
