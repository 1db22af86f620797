# SPDX-License-Identifier: GPL-3.0-or-later
"""The bone map: which bone of a rig follows which body part. Reading and writing it as a file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ...solver.errors import InputError
from ...solver.names import FINGERS
from ..json_file import load_map, save_map

SIDED_PARTS = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
SPINE = ("spine1", "spine2", "spine3")
# Phalanges, from the knuckle on, with SMPL+H's names.
PHALANGES = tuple(f"{finger}{k}" for finger in FINGERS for k in (1, 2, 3))
PARTS = (
    *("pelvis", *SPINE, "neck", "head"),
    *(f"{side}_{part}" for side in ("left", "right") for part in (*SIDED_PARTS, *PHALANGES)),
)
REQUIRED = ("pelvis", *(f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee")))
# Of a rig. Avatars have some hundred; the time that Blender takes grows with their square, and is
# 40 s for an FBX file with 10,000.
MOST_BONES = 4096
_KIND = "bone map"


def check_bone_count(rig: str, count: int) -> None:
    """Check that a rig can be used in reasonable time.

    :param rig: name of the rig or of its file, for the message.
    :raises InputError: it has too many bones.
    """
    if count > MOST_BONES:
        raise InputError(
            f"{rig} has {count} bones, with which Blender would take minutes; a rig may have "
            f"{MOST_BONES}: choose another, or remove those that move nothing, such as leaf bones"
        )


@dataclass
class BoneMap:
    """Bones and their body parts. Several bones may share a part of the spine, or the neck; other
    parts have one.
    """

    parts: dict[str, str]  # bone name -> body part
    # Confidence of each bone by its name, 0 to 1; empty unless the map was guessed.
    confidence: dict[str, float] = field(default_factory=dict)

    def bone(self, part: str) -> str | None:
        """Return the first bone of a part, or None."""
        return next((bone for bone, p in self.parts.items() if p == part), None)

    def check(self) -> None:
        """Check that the map can be used for retargeting.

        :raises InputError: when a part is unknown, a part of a limb has two bones, or pelvis or
            legs are missing.
        """
        for bone, part in self.parts.items():
            if part not in PARTS:
                raise InputError(
                    f"bone '{bone}' is mapped to '{part}', which is not a body part; use one of "
                    f"{', '.join(PARTS)}"
                )
        for part in PARTS:
            bones = [bone for bone, p in self.parts.items() if p == part]
            if len(bones) > 1 and part not in SPINE and part != "neck":
                raise InputError(
                    f"'{part}' has {len(bones)} bones, {' and '.join(bones)}; keep only one of them"
                )
        missing = [part for part in REQUIRED if self.bone(part) is None]
        if missing:
            raise InputError(
                f"the bone map has no bone for {', '.join(missing)}; choose one for "
                "each in the list"
            )


def save_bone_map(bone_map: BoneMap, path: str | Path) -> None:
    """Write the map as JSON, atomically. Only a bone map is overwritten, or an empty file.

    :raises InputError: the map could not be loaded again, see `BoneMap.check`.
    :raises OutputError: when the file cannot be written, or is something else.
    """
    bone_map.check()
    save_map(Path(path), _KIND, bones=bone_map.parts)


def load_bone_map(path: str | Path) -> BoneMap:
    """Read what ``save_bone_map`` wrote.

    :raises InputError: when the file cannot be read or is not a valid map.
    """
    path = Path(path)
    bones = load_map(path, _KIND).get("bones")
    if not isinstance(bones, dict) or not all(
        is_name(bone) and is_name(part) for bone, part in bones.items()
    ):
        raise InputError(
            f"{path}: 'bones' must be an object that maps bone names to body parts; "
            "correct the file"
        )
    out = BoneMap(dict(bones))
    try:
        out.check()
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return out


def is_name(text: object) -> bool:
    """Return whether Blender can store the name: JSON may escape null characters and lone
    surrogates.
    """
    return (
        isinstance(text, str)
        and text != ""
        and not any(c == "\0" or "\ud800" <= c <= "\udfff" for c in text)
    )
