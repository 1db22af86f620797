# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding the phalanges of a rig's fingers below the known wrists: by name, else by geometry; and
where mapped bones end, of which hands end at the knuckles.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from ...solver.names import FINGERS
from ..arrays import Float64Array, unit_vectors
from .rest_pose import RestPose

_WORDS = {
    "thumb": ("thumb",),
    "index": ("index", "pointer"),
    "ring": ("ring",),
    "pinky": ("pinky", "pinkie", "little"),
    # Last, because the second phalanx of any finger may be called so, as in ringMid.
    "middle": ("middle", "mid"),
}
# Bones of a hand that are not phalanges. A thumb's metacarpal moves, and counts as its first
# phalanx.
_NO_PHALANX = re.compile(r"end|nub|tip|site|master|palm|twist|pole|ik|target", re.IGNORECASE)
# Likewise, anywhere in a name; a spring is no ring finger.
_HELPERS = ("spring", "string", "jiggle", "helper", "physic", "collider", "socket")
_METACARPAL = re.compile(r"carpal|\bmeta\b", re.IGNORECASE)
_NUMBERED = re.compile(r"finger[ _.-]*(\d)", re.IGNORECASE)
_PHALANGES = 3


def find_fingers(rest: RestPose, parts: Mapping[str, str]) -> dict[str, str]:
    """Find the bones of the fingers below each wrist.

    :param parts: bone name -> part; those of the wrists matter.
    :return: bone name -> part (``left_index1``, ...).
    """
    found: dict[str, str] = {}
    for bone, part in parts.items():
        side, _, kind = part.partition("_")
        if kind != "wrist":
            continue
        wrist = rest.names.index(bone)
        below = rest.below(wrist)
        chains = _by_name(rest, below) or _by_geometry(rest, wrist, below)
        for finger, chain in chains.items():
            found |= {
                rest.names[i]: f"{side}_{finger}{k}" for k, i in enumerate(chain[:_PHALANGES], 1)
            }
    return found


def bone_ends(rest: RestPose, names: list[str], parts: dict[str, str]) -> Float64Array:
    """Return where the bones end (B, 3), metres; hands end at the knuckles of the long fingers."""
    row = {name: index for index, name in enumerate(rest.names)}
    phalanges = find_fingers(rest, parts)
    bone_of = {part: row[name] for name, part in parts.items()}
    knuckle_of = {part: row[name] for name, part in phalanges.items()}
    forward = np.zeros(3)
    if {"left_hip", "right_hip"} <= bone_of.keys():
        left = rest.heads[bone_of["left_hip"]] - rest.heads[bone_of["right_hip"]]
        forward = np.cross(left, [0.0, 0.0, 1.0])
        forward /= max(float(np.linalg.norm(forward)), 1e-9)
    ends = []
    for name in names:
        side, _, kind = parts[name].partition("_")
        long = [f"{side}_{finger}1" for finger in ("middle", "index", "ring", "pinky")]
        knuckles = [knuckle_of[part] for part in long if part in knuckle_of][:1]
        ends.append(
            rest.end(
                row[name],
                knuckles if kind == "wrist" else (),
                forward if kind == "ankle" else None,
            )
        )
    return np.array(ends).reshape(-1, 3)


def _by_name(rest: RestPose, below: list[int]) -> dict[str, list[int]]:
    """Return the bones of each finger from the knuckle on; empty if no name is that of a finger."""
    own: dict[str, set[int]] = {}
    numbered: dict[int, set[int]] = {}
    shared = [
        word
        for words in (*_WORDS.values(), _HELPERS)
        for word in words
        if all(word in rest.names[i].lower() for i in below)
    ]
    helpers = [word for word in _HELPERS if word not in shared]
    for i in below:
        name = rest.names[i].rsplit(":", 1)[-1]
        words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)
        if any(_NO_PHALANX.fullmatch(word) for word in words):
            continue
        if any(word in name.lower() for word in helpers):
            continue
        finger = _finger_of(name, shared)
        number = _NUMBERED.search(name)
        if finger == "thumb" or (finger and not _METACARPAL.search(name)):
            own.setdefault(finger, set()).add(i)
        elif finger is None and number:
            numbered.setdefault(int(number.group(1)), set()).add(i)
    unnamed = [finger for finger in FINGERS if finger not in own]
    own |= {finger: numbered[n] for finger, n in zip(unnamed, sorted(numbered), strict=False)}
    return {finger: _longest(rest, bones) for finger, bones in own.items()}


def _finger_of(name: str, shared: list[str]) -> str | None:
    """Return the finger of which a bone's name has a word; None if it has none.

    :param shared: words that all bones of the hand have, as in the name of a rig; they count where
        there is no other.
    """
    bare = name.lower()
    found = [
        (word in shared, finger)
        for finger, words in _WORDS.items()
        for word in words
        if word in bare
    ]
    return min(found, key=lambda each: each[0])[1] if found else None


def _by_geometry(rest: RestPose, wrist: int, below: list[int]) -> dict[str, list[int]]:
    """Identify five chains: the thumb is the one that diverges most, the others are ordered by
    distance from it.
    """
    heads = rest.heads
    leaves = [i for i in below if not rest.children[i]]
    chains = [rest.chains[leaf][rest.chains[leaf].index(wrist) + 1 :] for leaf in leaves]
    if len(chains) != len(FINGERS) or any(
        not _PHALANGES <= len(chain) <= _PHALANGES + 2 for chain in chains
    ):
        return {}
    along = unit_vectors(np.array([heads[chain[-1]] - heads[chain[0]] for chain in chains]))
    thumb = int((along @ along.sum(axis=0)).argmin())
    middles = np.array([heads[chain].mean(axis=0) for chain in chains])
    order = np.argsort(np.linalg.norm(middles - middles[thumb], axis=1), kind="stable")
    out = {}
    for finger, k in zip(FINGERS, order, strict=True):
        chain = chains[k]
        from_wrist = np.linalg.norm(heads[chain] - heads[wrist], axis=1)
        is_long = finger != "thumb" and len(chain) > _PHALANGES
        begins_in_palm = is_long and from_wrist[0] < 0.5 * from_wrist[1]
        out[finger] = chain[1:] if begins_in_palm else chain
    return out


def _longest(rest: RestPose, bones: set[int]) -> list[int]:
    """Return the longest chain from the top within ``bones``, without others between them."""
    chains = [[bone for bone in rest.chains[last] if bone in bones] for last in sorted(bones)]
    return max(chains, key=len)
