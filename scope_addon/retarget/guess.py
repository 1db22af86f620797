# SPDX-License-Identifier: GPL-3.0-or-later
"""Guessing the bone map of a rig from the names and the rest positions of its bones.

Names say which bones may be a part; the hierarchy decides among them: a shin descends from its
thigh, and the trunk lies between the pelvis and the arms. What names do not give, the shape of the
rest pose does, and what they give must be possible in it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import product

import numpy as np

from ...solver.names import FINGERS
from ..arrays import Float64Array
from ..kinematics.mirrored_limbs import OTHER_SIDE, other_side
from .bone_map import PHALANGES, SPINE, BoneMap
from .bone_names import CENTRE, LIMBS, BoneName, bone_names, parse_names
from .fingers import find_fingers
from .rest_pose import RestPose, faces_backwards, rest_faults

_LEG = ("hip", "knee", "ankle", "foot")
_ARM = ("collar", "shoulder", "elbow", "wrist")
# Other parts of a limb may be missing.
_JOINTS = (*_LEG[:3], *_ARM[1:])
# Confidence where name and geometry agree, of a name alone, of geometry alone, and of what cannot
# be right at rest.
_AGREED = 1.0
_NAMED = 0.8
SHAPED = 0.5
IMPOSSIBLE = 0.2
# What it costs a choice of bones for a limb to lack a part, and to have a part that does not
# descend from the one before; names cost their places in the list of words.
_LACKED = {part: 10.0 for part in (*_LEG, *_ARM)} | {"collar": 8.0, "foot": 8.0}
_PER_WORD = 0.5
_DETACHED = 8.0
_PER_LEVEL = 0.01
_FK_BONUS = 0.5
# By shape, a collar is shorter than this share of the arm after it.
_MAX_COLLAR = 0.4
# Bones are at one place if their distance is below this share of the rig's size.
_NEAR = 0.005
# Lengths of mirror images differ by no more than this share.
_ALIKE = 0.03
_SLIGHT = 0.01  # The weight of a bone without a mirror image.
# Wings are behind arms by more than this share of the rig's size.
_BEHIND = 0.02
# Toes lie ahead of ankles by more than this multiple of how far they lie below; ankles do not lie
# so far ahead of knees.
_LEVEL = 0.5
# What is no lower than this share of the highest bone in the middle belongs to the head.
_HIGH = 0.9
# The tip of a head is above it by more than this multiple of the neck's bones.
_TIP_LENGTH = 1.4


def guess(rest: RestPose, *, is_mirrored: bool = False, held: Collection[str] = ()) -> BoneMap:
    """Guess the most likely map: by name, and by geometry where names say nothing.

    Confidence is 1 where name and geometry agree, 0.8 for a name alone, 0.5 for geometry alone, and
    0.2 where the rest pose contradicts.

    :param is_mirrored: whether the rig as a whole is, so that what its names call left is on its
        right; where it has toes, they tell.
    :param held: bones that constraints turn; others that begin where they do are preferred.
    """
    rigify = _rigify(rest.names)
    if rigify is None and (spare := _spare(rest, held)):
        whole = guess(rest, is_mirrored=is_mirrored)
        free = guess(_without(rest, spare), is_mirrored=is_mirrored)
        while needed := _irreplaceable(rest, spare, whole.parts, free.parts):
            spare -= needed
            free = guess(_without(rest, spare), is_mirrored=is_mirrored)
        return whole if _is_impossible(rest, free.parts) else _with_limbs(free, whole)
    shaped = by_geometry(rest)
    named = rigify or by_name(rest)
    if is_mirrored and any(name.side for name in parse_names(rest.names)):
        named = {bone: other_side(part) for bone, part in named.items()}
    if _is_impossible(rest, named) and not _is_impossible(rest, shaped):
        named = {}
    parts = named | _lacking(named, shaped)
    backwards = faces_backwards(_heads_of(rest, parts))
    if backwards:
        parts = {bone: other_side(part) for bone, part in parts.items()}
    if rigify is None:
        for bone, part in find_fingers(rest, parts).items():
            parts.setdefault(bone, part)
    impossible = {part for fault in rest_faults(_heads_of(rest, parts)) for part in fault.parts}
    confidence = {
        bone: IMPOSSIBLE
        if part in impossible
        else SHAPED
        if bone not in named and part.partition("_")[2] not in PHALANGES
        else _AGREED
        if shaped.get(bone) == part and not backwards
        else _NAMED
        for bone, part in parts.items()
    }
    if not named:
        confidence = {bone: min(each, SHAPED) for bone, each in confidence.items()}
    return BoneMap(parts, confidence)


def from_humanoid(table: Mapping[str, str], names: list[str]) -> BoneMap:
    """Return the map of VRM's humanoid table.

    :param table: bone of each of VRM's parts, such as ``leftUpperLeg``; others are left out.
    :param names: bones of the rig.
    """
    parts: dict[str, str] = {}
    spine = [table[part] for part in ("spine", "chest", "upperChest") if table.get(part) in names]
    parts |= dict(zip(spine, _spread(len(spine)), strict=True))
    parts |= {table[vrm]: part for vrm, part in _vrm_parts(table).items() if table[vrm] in names}
    return BoneMap(parts, dict.fromkeys(parts, _AGREED))


def _vrm_parts(table: Mapping[str, str]) -> dict[str, str]:
    """Return the body part of each of VRM's parts that the table has, except the spine."""
    found = {
        name: part
        for part, name in bone_names("vrm").items()
        if part not in SPINE and not part.endswith("_hand")
    }
    # Version 1 counts a thumb from its metacarpal, version 0 from the proximal phalanx.
    if "leftThumbMetacarpal" not in table and "rightThumbMetacarpal" not in table:
        for side in ("left", "right"):
            for k, phalanx in enumerate(("Proximal", "Intermediate", "Distal"), 1):
                found[f"{side}Thumb{phalanx}"] = f"{side}_thumb{k}"
    return {vrm: part for vrm, part in found.items() if vrm in table}


def _heads_of(rest: RestPose, parts: Mapping[str, str]) -> dict[str, Float64Array]:
    """Return the head of each part, of several bones the first."""
    heads: dict[str, Float64Array] = {}
    for bone, part in parts.items():
        heads.setdefault(part, rest.heads[rest.names.index(bone)])
    return heads


def _is_impossible(rest: RestPose, parts: Mapping[str, str]) -> bool:
    """Return whether a map lacks a leg, or has parts that the rest pose contradicts."""
    heads = _heads_of(rest, parts)
    legs = [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee")]
    return not all(leg in heads for leg in legs) or bool(rest_faults(heads))


def _lacking(named: Mapping[str, str], shaped: Mapping[str, str]) -> dict[str, str]:
    """Return the bones, by the shape, of parts of which names give none: of whole limbs, and beside
    parts for which names and shape have the same bone, or this has found one.
    """
    if not named:
        return dict(shaped)
    limbs = set(map(_limb_of, named.values()))
    agreed = {part for bone, part in named.items() if shaped.get(bone) == part}
    found = {}
    for bone, part in shaped.items():
        if bone in named or part in named.values():
            continue
        side, _, kind = part.partition("_")
        limb = _LEG if kind in _LEG else _ARM
        beside = set()
        if kind:
            place = limb.index(kind)
            beside = {f"{side}_{each}" for each in limb[max(place - 1, 0) : place + 2]}
        elif part in SPINE and "pelvis" in agreed:
            beside = set(SPINE)
        if _limb_of(part) not in limbs or beside & agreed:
            found[bone] = part
            agreed.add(part)
    return found


def _spare(rest: RestPose, held: Collection[str]) -> set[str]:
    """Return the held bones that begin where one begins that is not."""
    free = rest.heads[[name not in held for name in rest.names]]
    return {
        name
        for name, head in zip(rest.names, rest.heads, strict=True)
        if name in held and (np.linalg.norm(free - head, axis=1) < _NEAR * rest.size).any()
    }


def _without(rest: RestPose, bones: Collection[str]) -> RestPose:
    """Return the pose without some bones; those above them carry what they carried."""
    kept: list[int] = []
    row_of = {-1: -1}
    for bone, parent in enumerate(rest.parents.tolist()):
        if rest.names[bone] in bones:
            row_of[bone] = row_of[parent]
        else:
            row_of[bone] = len(kept)
            kept.append(bone)
    parents = [row_of[int(rest.parents[bone])] for bone in kept]
    return RestPose([rest.names[bone] for bone in kept], np.array(parents, int), rest.heads[kept])


def _with_limbs(free: BoneMap, whole: BoneMap) -> BoneMap:
    """Return the first map with the limbs of the second of which it lacks a joint."""
    there = set(free.parts.values())
    limbs = set(map(_limb_of, there))
    lacking = {
        _limb_of(part)
        for part in set(whole.parts.values()) - there
        if part.endswith(_JOINTS) or _limb_of(part) not in limbs
    }
    parts = {bone: part for bone, part in free.parts.items() if _limb_of(part) not in lacking}
    parts |= {bone: part for bone, part in whole.parts.items() if _limb_of(part) in lacking}
    known = whole.confidence | free.confidence
    return BoneMap(parts, {bone: known[bone] for bone in parts})


def _irreplaceable(
    rest: RestPose, spare: Collection[str], whole: Mapping[str, str], free: Mapping[str, str]
) -> set[str]:
    """Return the spare bones of limbs and spines that cannot do without them: none of the bones
    that they have otherwise begins where a spare one does.

    :param whole: the parts of bones, guessed from all of them.
    :param free: those guessed without the spare ones.
    """
    limbs = set()
    for bone in whole.keys() & spare:
        limb = _limb_of(whole[bone])
        if limb.endswith((" leg", " arm")) and not whole[bone].endswith(_JOINTS):
            continue
        others = [rest.names.index(each) for each, part in free.items() if _limb_of(part) == limb]
        away = np.linalg.norm(rest.heads[others] - rest.heads[rest.names.index(bone)], axis=1)
        if not (away < _NEAR * rest.size).any():
            limbs.add(limb)
    return {bone for bone in whole.keys() & spare if _limb_of(whole[bone]) in limbs}


def _limb_of(part: str) -> str:
    """Return what is either named as a whole or not: a limb of one side, or a part of the trunk."""
    side, _, kind = part.partition("_")
    if kind in _LEG:
        return f"{side} leg"
    if kind:
        return f"{side} arm"
    return "spine" if part in SPINE else part


def _rigify(bones: list[str]) -> dict[str, str] | None:
    """Map Rigify's bones, whose trunk, neck and head are numbered consecutively; None for other
    rigs.
    """
    names = set(bones)
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


def by_name(rest: RestPose) -> dict[str, str]:
    """Map the bones whose names are known; of several candidates for a part, those that form a
    limb, nearest to the root.

    :return: bone name -> body part.
    """
    names = parse_names(rest.names)
    found: dict[int, str] = {}
    for side in ("left", "right"):
        for limb in (_LEG, _ARM):
            chosen = _limb_by_name(rest, names, side, limb)
            found |= {bone: f"{side}_{part}" for part, bone in chosen.items()}
    found |= _trunk_by_name(rest, names, {part: bone for bone, part in found.items()})
    return {rest.names[bone]: part for bone, part in found.items()}


def _limb_by_name(
    rest: RestPose, names: list[BoneName], side: str, limb: tuple[str, ...]
) -> dict[str, int]:
    """Choose the bones of a limb whose words fit best and that descend from each other."""
    options: list[list[tuple[int | None, float]]] = []
    for part in limb:
        words = LIMBS[part]
        known = [
            (bone, _PER_WORD * words.index(name.core) - _FK_BONUS * name.is_fk)
            for bone, name in enumerate(names)
            if name.side == side and not name.is_goal and name.core in words
        ]
        ranked = [(bone, rank + _PER_LEVEL * len(rest.chains[bone])) for bone, rank in known]
        nearest = sorted(ranked, key=lambda option: (option[1], rest.names[option[0]]))
        options.append([*nearest[:5], (None, _LACKED[part])])

    def cost(choice: tuple[tuple[int | None, float], ...]) -> float:
        bones = [bone for bone, _ in choice if bone is not None]
        if len(set(bones)) < len(bones):
            return float("inf")
        detached = sum(
            not rest.is_below(lower, upper) for upper, lower in zip(bones, bones[1:], strict=False)
        )
        return sum(each for _, each in choice) + _DETACHED * detached

    best = min(product(*options), key=cost)
    return {part: bone for part, (bone, _) in zip(limb, best, strict=True) if bone is not None}


def _trunk_by_name(
    rest: RestPose, names: list[BoneName], limbs: Mapping[str, int]
) -> dict[int, str]:
    """Map pelvis, spine, neck and head: the pelvis carries legs and spine, the spine lies between
    it and the arms.

    :param limbs: the bone of each part of arms and legs.
    """

    def named(part: str) -> list[int]:
        bones = [
            bone
            for bone, name in enumerate(names)
            if not name.side and not name.is_goal and name.core in CENTRE[part]
        ]
        return sorted(bones, key=lambda bone: (len(rest.chains[bone]), rest.names[bone]))

    thighs = [limbs[part] for part in ("left_hip", "right_hip") if part in limbs]
    collars = [
        limbs.get(f"{side}_collar", limbs.get(f"{side}_shoulder", -1)) for side in OTHER_SIDE
    ]
    arms = [bone for bone in collars if bone >= 0]
    above_arms = {bone for arm in arms for bone in rest.chains[arm]}
    head = max(
        named("head"),
        key=lambda bone: len(above_arms.intersection(rest.chains[bone])),
        default=None,
    )
    chest = _chest(rest, arms, head, named("spine"))
    pelvis = _pelvis(rest, thighs, chest, named("pelvis"))
    central = rest.chains[chest] if chest is not None else []
    # With Biped, a bone of the spine may carry the legs, and the neck the arms: they stay still
    # in the pelvis and in the chest.
    carrying = {bone for thigh in thighs for bone in rest.chains[thigh]}
    carrying.update(named("neck") if len(arms) == 2 else [])
    spine = named("spine")
    if pelvis in central:
        between = [b for b in central[central.index(pelvis) + 1 :] if b not in carrying]
        spine = [bone for bone in between if bone in spine] or _distinct(rest, between)
        if chest == head:
            spine = [bone for bone in spine if bone != head]
    else:  # The hierarchy of a control rig need not lead from the pelvis to the arms.
        spine = [bone for bone in spine if bone != pelvis]
    necks = named("neck")
    if head is not None:
        necks = [bone for bone in necks if rest.is_below(head, bone)] or necks
    if not necks and len(arms) == 2 and head is not None and chest in rest.chains[head]:
        chain = rest.chains[head]
        necks = _distinct(rest, chain[chain.index(chest) + 1 : -1])
    necks = [bone for bone in necks if bone not in spine and bone not in central]
    found = {} if pelvis is None else {pelvis: "pelvis"}
    found |= dict(zip(spine, _spread(len(spine)), strict=True))
    found |= dict.fromkeys(necks, "neck")
    return found if head is None else found | {head: "head"}


def _chest(rest: RestPose, arms: list[int], head: int | None, spine: list[int]) -> int | None:
    """Return the bone that carries both arms and the head; without both arms, the head or, without
    that too, the last bone of the spine, is the end of the trunk.
    """
    heads = [] if head is None else [head]
    if len(arms) == 2:
        return rest.shared([*arms, *heads])
    carried = heads or spine[-1:]
    return rest.shared(carried) if carried else None


def _pelvis(rest: RestPose, thighs: list[int], chest: int | None, named: list[int]) -> int | None:
    """Return the bone that carries legs and trunk: the first of those with the name, or else the
    deepest that they share.

    Below a bone ``hip`` that carries everything, DAZ and Character Creator have a bone ``pelvis``
    that carries the legs alone.
    """
    if len(thighs) < 2:
        return named[0] if named else None
    for carried in ([*thighs, chest], thighs):
        bones = [bone for bone in carried if bone is not None]
        carrying = [bone for bone in named if all(rest.is_below(each, bone) for each in bones)]
        if carrying:
            return carrying[0]
        shared = rest.shared(bones)
        # A root at the feet carries the goals of a control rig, too.
        if shared is not None and shared not in bones and not _is_at_feet(rest, shared, thighs):
            return shared
    if named and chest is not None:
        # Beside the spine, the hips are carried by what carries both, as a centre of gravity.
        shared = rest.shared([named[0], chest])
        return named[0] if shared is None or _is_at_feet(rest, shared, thighs) else shared
    shared = rest.shared(thighs)
    return named[0] if named else shared if shared not in thighs else None


def _is_at_feet(rest: RestPose, bone: int, thighs: list[int]) -> bool:
    """Return whether a bone lies in the lower quarter of the legs."""
    low = float(rest.heads[:, 2].min())
    hips = float(rest.heads[thighs, 2].mean())
    return hips > low and float(rest.heads[bone, 2]) < low + 0.25 * (hips - low)


def _distinct(rest: RestPose, bones: list[int]) -> list[int]:
    """Return the bones without those that begin where their parent does."""
    return [
        bone
        for bone in bones
        if rest.parents[bone] < 0
        or np.linalg.norm(rest.heads[bone] - rest.heads[rest.parents[bone]]) > _NEAR * rest.size
    ]


def by_geometry(rest: RestPose) -> dict[str, str]:
    """Map bones by their positions: legs end lowest on either side, arms extend farthest, the head
    is highest.

    :return: bone name -> body part; empty if no pair of legs is found.
    """
    upwards, leftwards = _places(rest)
    leaves = [
        bone
        for bone, children in enumerate(rest.children)
        if not children and not parse_names([rest.names[bone]])[0].is_goal
    ]
    ends = _limb_ends(rest, leaves, upwards, leftwards)
    if not (ends["left leg"] and ends["right leg"]):
        return {}
    central = np.flatnonzero(abs(leftwards) < 0.1).tolist() or leaves
    highest = max(upwards[bone] for bone in central)
    ends["head"] = [bone for bone in central if upwards[bone] >= _HIGH * highest]
    person = _person(rest, ends)
    for limb, bones in ends.items():
        ends[limb] = [bone for bone in bones if person in rest.chains[bone]] or bones
    for side in OTHER_SIDE:
        ends[f"{side} arm"] = _before_wings(rest, ends, side)
    chains: dict[str, list[int]] = {}
    for side, outwards in (("left", leftwards), ("right", -leftwards)):
        chains[f"{side} leg"] = min((rest.chains[b] for b in ends[f"{side} leg"]), key=len)
        if hands := ends[f"{side} arm"]:
            # One hand's fingers, not another chain that ends at the same place.
            chains[f"{side} arm"] = rest.chains[hands[int(np.argmax(outwards[hands]))]]
    shared = [bone for bone in chains["left leg"] if bone in chains["right leg"]]
    if not shared:
        return {}
    top = rest.chains[max(ends["head"], key=lambda bone: upwards[bone])]
    carrying = [bone for bone in shared if bone in top]
    found = {rest.names[carrying[-1] if carrying else shared[-1]]: "pelvis"}
    for limb, chain in chains.items():
        side, kind = limb.split()
        other = chains.get(f"{OTHER_SIDE[side]} {kind}", shared)
        own = _distinct(rest, [bone for bone in chain if bone not in other])
        parts = _leg_parts(rest, own) if kind == "leg" else _arm_parts(rest, own)
        found |= {rest.names[bone]: f"{side}_{part}" for bone, part in parts.items()}
    trunk = [bone for bone in top if bone not in shared]
    arm = chains.get("left arm", [])
    spine = [bone for bone in trunk if bone in arm]
    above = [bone for bone in trunk if bone not in arm]
    found |= dict(zip((rest.names[b] for b in spine), _spread(len(spine)), strict=True))
    found |= {rest.names[bone]: part for bone, part in _neck_parts(rest, above).items()}
    if faces_backwards(_heads_of(rest, found)):
        return {bone: other_side(part) for bone, part in found.items()}
    return found


def _places(rest: RestPose) -> tuple[Float64Array, Float64Array]:
    """Return how high and how far to the left each bone begins, as shares of the rig's height."""
    heads = rest.heads
    height = max(float(np.ptp(heads[:, 2])), 1e-9)
    leftwards = heads[:, :2] @ _sideways(rest)
    leftwards -= np.median(leftwards)
    signs = {"left": 1.0, "right": -1.0, "": 0.0}
    named = leftwards @ [signs[name.side] for name in parse_names(rest.names)]
    if named < 0.0:
        leftwards = -leftwards
    return (heads[:, 2] - heads[:, 2].min()) / height, leftwards / height


def _sideways(rest: RestPose) -> Float64Array:
    """Return the horizontal axis (2,) from side to side, whichever way the rig is turned: that
    which leads from bones to those that may be their mirror images, as long as they are, at the end
    of chains of the same length.
    """
    places = rest.heads[:, :2]
    lengths = np.linalg.norm(rest.heads - rest.heads[rest.parents], axis=1)
    lengths[rest.parents < 0] = 0.0
    reaches = np.array([lengths[chain].sum() for chain in rest.chains])
    around = places - places.mean(axis=0)
    spread = _SLIGHT * around.T @ around  # the arms tell, where no bone has a mirror image
    for bone, (length, reach) in enumerate(zip(lengths, reaches, strict=True)):
        is_alike = abs(lengths - length) <= _ALIKE * length
        is_alike &= abs(reaches - reach) <= _ALIKE * reach
        apart = places[is_alike] - places[bone]
        spread += apart.T @ apart
    x, y = np.linalg.eigh(spread)[1][:, -1]
    # Without names and toes, a rig is taken to look along -y rather than y, and along -x.
    sign = np.sign(x if abs(x) >= abs(y) else -y)
    return sign * np.array([x, y])


def _limb_ends(
    rest: RestPose, leaves: list[int], upwards: Float64Array, leftwards: Float64Array
) -> dict[str, list[int]]:
    """Return the bones at which each limb may end, such as ``left leg``.

    :param leaves: bones without children.
    """
    ends: dict[str, list[int]] = {}
    for side, outwards in (("left", leftwards), ("right", -leftwards)):
        ends[f"{side} leg"] = [b for b in leaves if _is_leg(rest.chains[b], upwards, outwards)]
        ends[f"{side} arm"] = [b for b in leaves if outwards[b] > 0.1 and upwards[b] > 0.3]
    return ends


def _person(rest: RestPose, ends: Mapping[str, list[int]]) -> int:
    """Return the bone that carries most of limbs and head: of those, one that is called FK, or the
    deepest, as a rig may have the same person several times. What hangs down to the feet from the
    chest, as a coat does, has more bones than the legs, and is none.

    :param ends: the bones at which each of them may end.
    """
    carried: list[set[str]] = [set() for _ in rest.names]
    for limb, bones in ends.items():
        for bone in bones:
            for above in rest.chains[bone]:
                carried[above].add(limb)
    most = max(map(len, carried))
    legs: dict[int, int] = {}  # the number of bones down to the nearest foot of each person
    for foot in (*ends["left leg"], *ends["right leg"]):
        chain = rest.chains[foot]
        person = next((bone for bone in reversed(chain) if len(carried[bone]) == most), None)
        if person is not None:
            legs[person] = min(len(chain), legs.get(person, len(chain)))
    found = [
        bone
        for bone, length in legs.items()
        if all(legs.get(above, length) >= length for above in rest.chains[bone])
    ]
    is_fk = [name.is_fk for name in parse_names(rest.names)]
    return max(
        found or range(len(rest.names)),
        key=lambda bone: (len(carried[bone]), is_fk[bone], len(rest.chains[bone])),
    )


def _before_wings(rest: RestPose, ends: Mapping[str, list[int]], side: str) -> list[int]:
    """Return the ends of the arm on a side without those of wings: of several limbs, of three bones
    and more, that one bone carries, arms are where the toes point. Without toes, nothing tells.

    :param ends: the bones at which each limb may end.
    """
    toes = [*ends["left leg"], *ends["right leg"]]
    ways = rest.heads[toes] - rest.heads[rest.parents[toes]]
    lengths = np.linalg.norm(ways[:, :2], axis=1)
    forward = ways[lengths > _LEVEL * abs(ways[:, 2])].sum(axis=0) * [1.0, 1.0, 0.0]
    length = float(np.linalg.norm(forward))
    if length < 1e-9:
        return ends[f"{side} arm"]
    forward /= length
    across = {above for hand in ends[f"{OTHER_SIDE[side]} arm"] for above in rest.chains[hand]}
    limbs: dict[int, list[int]] = {}
    for hand in ends[f"{side} arm"]:
        own = [bone for bone in rest.chains[hand] if bone not in across]
        if len(own) > 2:
            limbs.setdefault(own[0], own)
    ahead = {first: float((rest.heads[own] @ forward).mean()) for first, own in limbs.items()}
    wings = {
        first
        for first in ahead
        for other in ahead
        if rest.parents[first] == rest.parents[other]
        and ahead[other] - ahead[first] > _BEHIND * rest.size
    }
    return [hand for hand in ends[f"{side} arm"] if not wings.intersection(rest.chains[hand])]


def _is_leg(chain: list[int], upwards: Float64Array, outwards: Float64Array) -> bool:
    """Return whether bones lead down to a foot on one side. Goals of IK lie at the feet as well,
    but on no leg.
    """
    foot = chain[-1]
    if outwards[foot] <= 0.01 or upwards[foot] >= 0.15:
        return False
    beside = [bone for bone in chain if outwards[bone] > 0.01]
    return len(beside) >= 2 and any(upwards[bone] > 0.3 for bone in beside)


def _neck_parts(rest: RestPose, chain: list[int]) -> dict[int, str]:
    """Return the parts of the bones from the chest up: the last is the head, or else the tip of the
    head, far above it.
    """
    lengths = np.linalg.norm(np.diff(rest.heads[chain], axis=0), axis=1)
    if len(chain) > 2 and lengths[-1] > _TIP_LENGTH * lengths[:-1].max():
        chain = chain[:-1]
    return dict.fromkeys(chain[:-1], "neck") | dict.fromkeys(chain[-1:], "head")


def _leg_parts(rest: RestPose, chain: list[int]) -> dict[int, str]:
    """Return the part of each bone of a leg: its knee is nearest to the middle, twist bones lie
    between.
    """
    if len(chain) <= len(_LEG):
        return dict(zip(chain, _LEG, strict=False))
    steps = np.diff(rest.heads[chain], axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    falls = -steps[:, 2] > 0.6 * lengths
    ankle = 1 + max((k for k in range(1, len(steps)) if falls[k]), default=1)
    toe = min(ankle + 1, len(chain) - 1)
    knee = _middle(lengths[:ankle])
    out = {chain[0]: "hip", chain[knee]: "knee", chain[ankle]: "ankle"}
    return out | ({chain[toe]: "foot"} if toe > ankle else {})


def _arm_parts(rest: RestPose, chain: list[int]) -> dict[int, str]:
    """Return the part of each bone of an arm; fingers begin where the chain branches, and twist
    bones may lie between.
    """
    lengths = np.linalg.norm(np.diff(rest.heads[chain], axis=0), axis=1)
    has_collar = len(chain) > 3 and lengths[0] < _MAX_COLLAR * lengths[1:].sum()
    collar = {chain[0]: "collar"} if has_collar else {}
    first = len(collar)
    forks = [k for k in range(first + 2, len(chain)) if len(rest.children[chain[k]]) >= 3]
    # Beyond the wrist there is less than an upper arm, unless twist bones were counted.
    beyond = lengths[first + 2 :].sum()
    wrist = forks[0] if forks else first + 2
    # A damaged rig may have an arm of a single bone, which has no length.
    if not forks and beyond > lengths[first : first + 2].max(initial=0.0):
        wrist = len(chain) - 1
    if wrist >= len(chain):
        return collar | dict(zip(chain[first:], _ARM[1:], strict=False))
    elbow = first + _middle(lengths[first:wrist])
    return collar | {chain[first]: "shoulder", chain[elbow]: "elbow", chain[wrist]: "wrist"}


def _middle(lengths: Float64Array) -> int:
    """Return the inner joint of a chain of segments that is nearest to the middle of its length."""
    reached = np.cumsum(lengths)
    inner = reached[:-1]
    return 1 + int(np.argmin(np.abs(inner - reached[-1] / 2)))


def _spread(count: int) -> list[str]:
    """Return the parts of the spine for ``count`` bones; the last is always the chest."""
    return [f"spine{int(np.ceil(3 * (k + 1) / count))}" for k in range(count)]
