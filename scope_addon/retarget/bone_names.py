# SPDX-License-Identifier: GPL-3.0-or-later
"""What the names of bones say: side, and the word that tells the body part, in the spellings of
common tools; and the names by which other programs recognize a skeleton.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from dataclasses import dataclass

from ...solver.names import FINGERS
from .bone_map import SIDED_PARTS, SPINE

_LATIN_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[぀-ヿ㐀-鿿々ー]+")
_SIDES = {"l": "left", "left": "left", "lft": "left"}
_SIDES |= {"r": "right", "right": "right", "rgt": "right", "rt": "right", "lt": "left"}
_JAPANESE_SIDES = {"左": "left", "右": "right"}
# Prefixes of Biped, Valve, VRoid (with C for the centre), Character Creator, Mixamo and others.
_PREFIXES = {"bip", "valve", "biped", "j", "c", "cc", "base", "def", "bind", "jnt", "mixamorig"}
_PREFIXES |= {"armature", "skeleton", "skel", "rl"}
# Words that say what kind of bone it is, but not of which body part. Auto-Rig Pro marks the centre
# with x, Advanced Skeleton with M.
_KINDS = {"fk", "stretch", "bend", "jnt", "joint", "bone", "bn", "jt", "bind", "def", "x", "m"}
# Bones that set a goal instead of following the body.
_GOALS = {"ik", "pole", "target", "goal"}
# A prefix that no list knows is shared by more than this share of the bones.
_COMMON = 0.7

CENTRE = {
    "pelvis": ("pelvis", "hips", "hip", "lowertorso", "rootmaster"),
    "spine": (
        *("spine", "chest", "upperchest", "torso", "abdomen", "waist", "uppertorso", "thorax"),
        *("abdomenlower", "abdomenupper", "chestlower", "chestupper", "lowerback", "upperback"),
        *("vertebra", "ab", "ribcage", "上半身"),
    ),
    "neck": ("neck", "necktwist", "necklower", "neckupper", "lowerneck", "upperneck", "首"),
    "head": ("head", "頭"),
}
# Of several, the first that a rig has; a word may stand for different parts in different rigs.
LIMBS = {
    "hip": ("thigh", "upleg", "upperleg", "legupper", "hip", "femur", "足", "leg"),
    "knee": (
        "shin",
        "calf",
        "leg",
        "lowerleg",
        "lowleg",
        "loleg",
        "leglower",
        "knee",
        "tibia",
        "ひざ",
        "膝",
    ),
    "ankle": ("ankle", "foot", "足首"),
    # SMPL calls the toes "foot", and the foot "ankle".
    "foot": ("toe", "toes", "toebase", "ball", "foot", "つま先", "足先ex"),
    "collar": ("clavicle", "collar", "collarbone", "clav", "scapula", "shoulder", "肩"),
    "shoulder": (
        *("upperarm", "uparm", "armupper", "arm", "shldr", "shoulder", "humerus", "uarm", "腕"),
    ),
    "elbow": (
        *("forearm", "lowerarm", "lowarm", "loarm", "armlower", "elbow", "radius", "farm"),
        *("ひじ", "肘"),
    ),
    "wrist": ("wrist", "hand", "手首", "palm"),
}
_LIMB_WORDS = {word for words in LIMBS.values() for word in words}

_TRUNK = ("pelvis", *SPINE, "neck", "head")
OWN = "scope"  # the names of the body's own joints
SKELETONS = (OWN, "mixamo", "ue5", "vrm", "unity")
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


@dataclass(frozen=True)
class BoneName:
    """A bone's name, taken apart."""

    core: str  # without prefix, side, kind, digits and case
    side: str  # "left", "right" or empty
    is_goal: bool = False  # of a control that limbs are drawn to, such as one of IK
    is_fk: bool = False  # of a control that turns its limb


def parse_names(names: list[str]) -> list[BoneName]:
    """Take the names of a rig apart; what most of them begin with is no part of them."""
    listed = [_words(name) for name in names]
    while len(names) > 1:
        first = Counter(words[0] for words in listed if len(words) > 1)
        word, count = first.most_common(1)[0] if first else ("", 0)
        if count <= _COMMON * len(names) or word in _SIDES:
            break
        listed = [words[1:] if len(words) > 1 and words[0] == word else words for words in listed]
    return [_parsed(name, words) for name, words in zip(names, listed, strict=True)]


def _words(name: str) -> list[str]:
    """Return the words of a name in lower case, without what comes before a colon or bar."""
    text = unicodedata.normalize("NFKC", name)
    text = re.split(r"[:|]", text)[-1]
    return [word.lower() for word in _LATIN_WORD.findall(text)]


def _parsed(name: str, words: list[str]) -> BoneName:
    # Xsens names the trunk after vertebrae: L5, L3, T12, T8. An L is no side there.
    if re.fullmatch(r"(?:.*[:|])?[LT]\d{1,2}", name):
        return BoneName("vertebra", "")
    while len(words) > 1 and words[0] in _PREFIXES:
        words = words[1:]
    side = next((_SIDES[word] for word in words if word in _SIDES), "")
    meaning = [word for word in words if word not in _SIDES]
    is_goal = any(word in _GOALS for word in meaning)
    is_fk = "fk" in meaning
    core = "".join([word for word in meaning if word not in _KINDS] or meaning)
    if not side and core[:1] in _JAPANESE_SIDES:
        side = _JAPANESE_SIDES[core[0]]
        core = core[1:]
    if not side and core not in _LIMB_WORDS:
        for letter, rest in ((core[:1], core[1:]), (core[-1:], core[:-1])):
            if letter in ("l", "r") and rest in _LIMB_WORDS:
                side = _SIDES[letter]
                core = rest
                break
    return BoneName(core, side, is_goal, is_fk)


def bone_names(skeleton: str) -> dict[str, str]:
    """Return the names of a skeleton's bones by the body's joints.

    :param skeleton: one of ``SKELETONS``, except the body's own.
    """
    centre, sided = {"mixamo": _MIXAMO, "ue5": _UE5}.get(skeleton, _UNITY)
    names = {part: _spelled(skeleton, "", name) for part, name in zip(_TRUNK, centre, strict=True)}
    for side in ("left", "right"):
        for part, name in zip(SIDED_PARTS, sided, strict=True):
            names[f"{side}_{part}"] = _spelled(skeleton, side, name)
        for finger in FINGERS:
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
