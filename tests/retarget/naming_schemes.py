# SPDX-License-Identifier: GPL-3.0-or-later
"""How common rigs name their bones, and where those of a person lie."""

# Parts in the order of a person's chains, with positions of the left side in a T-pose; metres.
PLACES = {
    "pelvis": (0, 0, 0.95), "spine1": (0, 0.01, 1.05), "spine2": (0, 0.02, 1.2),
    "spine3": (0, 0.01, 1.33),
    "neck": (0, 0.02, 1.5), "head": (0, 0, 1.6), "hip": (0.1, 0, 0.9), "knee": (0.1, -0.01, 0.5),
    "ankle": (0.1, 0.02, 0.08), "foot": (0.1, -0.12, 0.02), "collar": (0.04, 0.0, 1.44),
    "shoulder": (0.17, 0.02, 1.45),
    "elbow": (0.43, 0.03, 1.45), "wrist": (0.68, 0.02, 1.45),
}  # fmt: skip
PARENTS = {
    "spine1": "pelvis", "spine2": "spine1", "spine3": "spine2", "neck": "spine3", "head": "neck",
    "hip": "pelvis",
    "knee": "hip", "ankle": "knee", "foot": "ankle", "collar": "spine3", "shoulder": "collar",
    "elbow": "shoulder",
    "wrist": "elbow",
}  # fmt: skip
SIDED = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
CENTRE = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
SCHEMES = {
    "mixamo": (
        ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"),
        ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand"),
        lambda name, side: "mixamorig:" + side.title() + name,
    ),
    "unreal": (
        ("pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head"),
        ("thigh", "calf", "foot", "ball", "clavicle", "upperarm", "lowerarm", "hand"),
        lambda name, side: f"{name}_{side[0]}" if side else name,
    ),
    "unity": (
        ("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"),
        ("UpperLeg", "LowerLeg", "Foot", "Toes", "Shoulder", "UpperArm", "LowerArm", "Hand"),
        lambda name, side: side.title() + name,
    ),
    "mpfb": (
        ("root", "spine05", "spine03", "spine01", "neck01", "head"),
        (
            "upperleg01",
            "lowerleg01",
            "foot",
            "toe1-1",
            "clavicle",
            "upperarm01",
            "lowerarm01",
            "wrist",
        ),
        lambda name, side: f"{name}.{side[0].upper()}" if side else name,
    ),
    "smpl": (
        CENTRE,
        SIDED,
        lambda name, side: f"{side}_{name}" if side else name,
    ),
    "biped": (
        ("Pelvis", "Spine", "Spine1", "Spine2", "Neck", "Head"),
        ("Thigh", "Calf", "Foot", "Toe0", "Clavicle", "UpperArm", "Forearm", "Hand"),
        lambda name, side: f"Bip01 {side[:1].upper()} {name}" if side else f"Bip01 {name}",
    ),
    "vroid": (
        ("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"),
        ("UpperLeg", "LowerLeg", "Foot", "ToeBase", "Shoulder", "UpperArm", "LowerArm", "Hand"),
        lambda name, side: f"J_Bip_{side[:1].upper() or 'C'}_{name}",
    ),
    "character creator": (
        ("Hip", "Waist", "Spine01", "Spine02", "NeckTwist01", "Head"),
        ("Thigh", "Calf", "Foot", "ToeBase", "Clavicle", "Upperarm", "Forearm", "Hand"),
        lambda name, side: f"CC_Base_{side[:1].upper()}_{name}" if side else f"CC_Base_{name}",
    ),
    "nameless": (
        tuple("abcdef"),
        tuple("ghijklmn"),
        lambda name, side: {"left": "x", "right": "y", "": "z"}[side] * 3 + name,
    ),
}


def names_of(scheme):
    """Return the bone of each part."""
    centre, sided, spell = SCHEMES[scheme]
    found = {part: spell(name, "") for part, name in zip(CENTRE, centre, strict=True)}
    for side in ("left", "right"):
        found |= {
            f"{side}_{part}": spell(name, side) for part, name in zip(SIDED, sided, strict=True)
        }
    return found
