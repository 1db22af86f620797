# SPDX-License-Identifier: GPL-3.0-or-later
"""Guessing the bone map of a rig from the names and the rest positions of its bones."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bone_map import FINGERS, BoneMap
from .fingers import find_fingers

_SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
# Prefixes of Biped, Valve, VRoid (with C for the centre) and Character Creator.
_PREFIXES = {"bip", "valve", "biped", "j", "c", "cc", "base", "def", "bind", "jnt"}
_CENTRE = {
    "pelvis": ("pelvis", "hips", "hip"),
    "spine": ("spine", "chest", "upperchest", "torso", "abdomen", "waist"),
    "neck": ("neck", "necktwist"),
    "head": ("head",),
}
_LIMBS = {
    "hip": ("thigh", "upleg", "upperleg", "hip"),
    "knee": ("shin", "calf", "leg", "lowerleg", "knee"),
    "ankle": ("ankle", "foot"),
    # SMPL calls the toes "foot", and the foot "ankle".
    "foot": ("toe", "toes", "toebase", "ball", "foot"),
    "collar": ("clavicle", "collar", "shoulder"),
    "shoulder": ("upperarm", "uparm", "arm", "shoulder"),
    "elbow": ("forearm", "lowerarm", "elbow"),
    "wrist": ("hand", "wrist"),
}


@dataclass(frozen=True)
class RestBones:
    """The B bones of a rig at rest, parents before children."""

    names: list[str]
    parents: NDArray[np.intp]  # (B,) indices, -1 for none
    heads: NDArray[np.float64]  # (B, 3), world axes, z up


def tokens(name: str) -> tuple[str, str]:
    """Return the name without prefix, side, digits and case, and its side ('left', 'right' or
    '').
    """
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name.rsplit(":", 1)[-1])
    words = [word.lower() for word in words]
    while len(words) > 1 and words[0] in _PREFIXES:
        words = words[1:]
    side = next((_SIDES[word] for word in words if word in _SIDES), "")
    return "".join(word for word in words if word not in _SIDES), side


def guess(bones: RestBones) -> BoneMap:
    """Guess the most likely map: by name, or by geometry if too few names are known.

    Confidence is 1 where name and geometry agree, 0.8 for a name alone, 0.5 for geometry alone.
    """
    rigify = _rigify(bones)
    named = rigify or by_name(bones)
    shaped = by_geometry(bones)
    shaped |= _fingers(bones, shaped)
    if len(set(named.values())) < 8:
        return BoneMap(shaped, dict.fromkeys(shaped, 0.5))
    if rigify is None:
        named |= _fingers(bones, named)
    return BoneMap(
        named, {bone: 1.0 if shaped.get(bone) == part else 0.8 for bone, part in named.items()}
    )


def _fingers(bones: RestBones, parts: dict[str, str]) -> dict[str, str]:
    """Find the fingers below the wrists of a map."""
    wrists = {
        part.partition("_")[0]: bones.names.index(b)
        for b, part in parts.items()
        if part.endswith("_wrist")
    }
    return find_fingers(bones.names, bones.parents, bones.heads, wrists)


def _rigify(bones: RestBones) -> dict[str, str] | None:
    """Map Rigify's bones, whose trunk, neck and head are numbered consecutively; None for other
    rigs.
    """
    names = set(bones.names)
    if {"torso", "thigh_fk.L", "spine_fk.002"} <= names:
        found = {"torso": "pelvis", "spine_fk.002": "spine1", "spine_fk.003": "spine3"}
        found |= {"neck": "neck", "head": "head"}
        suffix = "_fk"
    elif {"spine.001", "spine.003", "spine.006", "thigh.L"} <= {
        name.removeprefix("DEF-") for name in names
    }:
        found = {
            "spine": "pelvis",
            "spine.001": "spine1",
            "spine.002": "spine2",
            "spine.003": "spine3",
        }
        found |= {"spine.004": "neck", "spine.005": "neck", "spine.006": "head"}
        suffix = ""
    else:
        return None
    limbs = {
        "thigh": "hip",
        "shin": "knee",
        "foot": "ankle",
        "toe": "foot",
        "upper_arm": "shoulder",
    }
    limbs |= {"forearm": "elbow", "hand": "wrist"}
    for letter, side in (("L", "left"), ("R", "right")):
        found[f"shoulder.{letter}"] = f"{side}_collar"
        found |= {f"{limb}{suffix}.{letter}": f"{side}_{part}" for limb, part in limbs.items()}
        for finger in FINGERS:
            bone = finger if finger == "thumb" else f"f_{finger}"
            found |= {f"{bone}.{k:02d}.{letter}": f"{side}_{finger}{k}" for k in (1, 2, 3)}
    # Without a suffix, the rig is the metarig, or an export of the deform bones alone, whose names
    # begin with DEF-.
    prefix = "" if "thigh.L" in names or suffix else "DEF-"
    return {prefix + bone: part for bone, part in found.items() if prefix + bone in names}


def by_name(bones: RestBones) -> dict[str, str]:
    """Map the bones whose names are known; of several candidates for a part, the one nearest to the
    root.

    :return: bone name -> body part.
    """
    cores = [tokens(name) for name in bones.names]
    depth = _depths(bones.parents)
    order = sorted(range(len(cores)), key=lambda i: (depth[i], bones.names[i]))
    found = _limbs_by_name(bones, cores, order)
    found |= _centre_by_name(bones, cores, order)
    thighs = [bones.names.index(b) for b, part in found.items() if part.endswith("_hip")]
    # The pelvis is the nearest common ancestor of both legs.
    if "pelvis" not in found.values() and len(thighs) == 2:
        shared = [
            i
            for i in _ancestors(bones.parents, thighs[0])
            if i in _ancestors(bones.parents, thighs[1])
        ]
        if shared:
            found[bones.names[shared[0]]] = "pelvis"
    return found


def _limbs_by_name(
    bones: RestBones, cores: list[tuple[str, str]], order: list[int]
) -> dict[str, str]:
    """Map arms and legs.

    :param cores: the ``tokens`` of every bone.
    :param order: the bones, nearest to the root first.
    """
    found: dict[str, str] = {}
    for side in ("left", "right"):
        sided = {i for i in order if cores[i][1] == side}
        # In SMPL's naming (hip, knee, ..., collar, shoulder) a shoulder is the upper arm.
        with_collar = any(cores[i][0] in ("clavicle", "collar") for i in sided)
        for part, words in _LIMBS.items():
            if part == "collar" and with_collar:
                words = words[:2]
            for word in words:
                first = next((i for i in order if i in sided and cores[i][0] == word), None)
                if first is not None and bones.names[first] not in found:
                    found[bones.names[first]] = f"{side}_{part}"
                    break
    return found


def _centre_by_name(
    bones: RestBones, cores: list[tuple[str, str]], order: list[int]
) -> dict[str, str]:
    """Map pelvis, spine, neck and head; parameters as in ``_limbs_by_name``."""
    found: dict[str, str] = {}
    for part, words in _CENTRE.items():
        candidates = [i for i in order if not cores[i][1] and cores[i][0] in words]
        if part == "spine":
            found |= {
                bones.names[i]: name
                for i, name in zip(candidates, _spread(len(candidates)), strict=True)
            }
        elif part == "neck":
            found |= {bones.names[i]: "neck" for i in candidates}
        elif candidates:
            found[bones.names[candidates[0]]] = part
    return found


def by_geometry(bones: RestBones) -> dict[str, str]:
    """Map bones by their positions: legs end lowest on either side, arms extend farthest, the head
    is highest.

    :return: bone name -> body part; empty if no pair of legs is found.
    """
    heads = bones.heads
    parents = bones.parents
    leaves = [i for i in range(len(parents)) if i not in set(parents.tolist())]
    height = max(float(np.ptp(heads[:, 2])), 1e-9)
    z = (heads[:, 2] - heads[:, 2].min()) / height
    axis = int(np.argmax(np.ptp(heads[:, :2], axis=0)))  # The arms extend along the wider axis.
    across = heads[:, axis] - np.median(heads[:, axis])
    across = across if axis == 0 else -across
    found: dict[str, str] = {}
    chains: dict[str, list[int]] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        legs = [i for i in leaves if sign * across[i] > 0.01 * height and z[i] < 0.15]
        arms = [i for i in leaves if sign * across[i] > 0.1 * height and z[i] > 0.3]
        if legs:
            chains[f"{side} leg"] = _chain(
                parents, min(legs, key=lambda i: len(_ancestors(parents, i)))
            )
        if arms:
            chains[f"{side} arm"] = _chain(parents, max(arms, key=lambda i: sign * across[i]))
    if not {"left leg", "right leg"} <= chains.keys():
        return {}
    shared = [i for i in chains["left leg"] if i in chains["right leg"]]
    if not shared:
        return {}
    found[bones.names[shared[-1]]] = "pelvis"
    for limb, chain in chains.items():
        side, kind = limb.split()
        other = chains.get(("right " if side == "left" else "left ") + kind, shared)
        own = [i for i in chain if i not in other]
        parts: tuple[str, ...]
        if kind == "leg":
            parts = ("hip", "knee", "ankle", "foot")
        else:
            lengths = [
                float(np.linalg.norm(heads[b] - heads[a]))
                for a, b in zip(own, own[1:], strict=False)
            ]
            collar = len(own) > 3 and lengths[0] < 0.7 * lengths[1]
            parts = ("collar",) * collar + ("shoulder", "elbow", "wrist")
        found |= {bones.names[i]: f"{side}_{part}" for i, part in zip(own, parts, strict=False)}
    top = _chain(parents, int(max(leaves, key=lambda i: z[i])))
    trunk = [i for i in top if i not in shared]
    arms = chains.get("left arm", [])
    spine = [i for i in trunk if i in arms]
    rest = [i for i in trunk if i not in arms]
    found |= {bones.names[i]: name for i, name in zip(spine, _spread(len(spine)), strict=True)}
    found |= {bones.names[i]: name for i, name in zip(rest, ("neck", "head"), strict=False)}
    return found


def _spread(count: int) -> list[str]:
    """Return the parts of the spine for ``count`` bones; the last is always the chest."""
    return [f"spine{int(np.ceil(3 * (k + 1) / count))}" for k in range(count)]


def _ancestors(parents: NDArray[np.intp], i: int) -> list[int]:
    found = []
    while parents[i] >= 0:
        i = int(parents[i])
        found.append(i)
    return found


def _chain(parents: NDArray[np.intp], i: int) -> list[int]:
    return [*reversed(_ancestors(parents, i)), i]


def _depths(parents: NDArray[np.intp]) -> list[int]:
    return [len(_ancestors(parents, i)) for i in range(len(parents))]
