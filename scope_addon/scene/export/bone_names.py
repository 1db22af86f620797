# SPDX-License-Identifier: GPL-3.0-or-later
"""The names of bones in files, by which other programs recognize a skeleton. Free of bpy."""

from __future__ import annotations

OWN = "scope"  # the names of the body's own joints
SKELETONS = (OWN, "mixamo", "ue5", "vrm", "unity")
_CENTRE = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
_SIDED = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
_FINGERS = ("thumb", "index", "middle", "ring", "pinky")
# Names of the centre, and of the sides without what tells them apart.
_MIXAMO = (
    ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"),
    ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand"),
)
_UE5 = (
    ("pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head"),
    ("thigh", "calf", "foot", "ball", "clavicle", "upperarm", "lowerarm", "hand"),
)
_UNITY = (
    ("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"),
    ("UpperLeg", "LowerLeg", "Foot", "Toes", "Shoulder", "UpperArm", "LowerArm", "Hand"),
)
_PHALANGES = ("Proximal", "Intermediate", "Distal")


def bone_names(skeleton: str) -> dict[str, str]:
    """Return the names of a skeleton's bones by the body's joints.

    :param skeleton: one of ``SKELETONS``, except the body's own.
    """
    centre, sided = {"mixamo": _MIXAMO, "ue5": _UE5}.get(skeleton, _UNITY)
    names = {part: _spelled(skeleton, "", name) for part, name in zip(_CENTRE, centre, strict=True)}
    for side in ("left", "right"):
        for part, name in zip(_SIDED, sided, strict=True):
            names[f"{side}_{part}"] = _spelled(skeleton, side, name)
        for finger in _FINGERS:
            for k in (1, 2, 3):
                names[f"{side}_{finger}{k}"] = _phalanx(skeleton, side, finger, k)
        # The middle of the hand, in bodies without fingers.
        names[f"{side}_hand"] = names[f"{side}_middle1"]
    return names


def _spelled(skeleton: str, side: str, name: str) -> str:
    """Return a bone's name with its side."""
    if skeleton == "mixamo":
        return f"mixamorig:{side.title()}{name}"
    if skeleton == "ue5":
        return f"{name}_{side[0]}" if side else name
    whole = side.title() + name
    return whole if skeleton == "unity" else whole[0].lower() + whole[1:]


def _phalanx(skeleton: str, side: str, finger: str, k: int) -> str:
    """Return the name of a finger's k-th bone from the knuckle on, of a thumb from the palm on."""
    if skeleton == "mixamo":
        return _spelled(skeleton, side, f"Hand{finger.title()}{k}")
    if skeleton == "ue5":
        return _spelled(skeleton, side, f"{finger}_{k:02d}")
    phalanges = _PHALANGES
    if finger == "thumb" and skeleton == "vrm":
        phalanges = ("Metacarpal", "Proximal", "Distal")
    whole = "Little" if finger == "pinky" else finger.title()
    return _spelled(skeleton, side, whole + phalanges[k - 1])
