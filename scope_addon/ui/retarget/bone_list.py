# SPDX-License-Identifier: GPL-3.0-or-later
"""The bone map as the panel's list shows it."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import bpy

if TYPE_CHECKING:
    from ...retarget.bone_map import BoneMap


def guess_into_list(settings: bpy.types.PropertyGroup) -> None:
    """Fill the list with a guess for the chosen rig; leave it empty if nothing can be guessed.

    :param settings: of retargeting, with a rig.
    """
    from ....solver.errors import ScopeError
    from ...scene.rigs.rig_retarget import guess_bone_map

    settings.pairs.clear()
    try:
        fill_list(settings, guess_bone_map(settings.rig))
    except ScopeError:
        return  # the operators report why


def fill_list(settings: bpy.types.PropertyGroup, bone_map: BoneMap) -> None:
    """Fill the list with a map, in the order of the body's parts."""
    from ...retarget.bone_map import PARTS

    settings.pairs.clear()
    for bone, part in sorted(bone_map.parts.items(), key=lambda pair: PARTS.index(pair[1])):
        pair = settings.pairs.add()
        pair.bone = bone
        pair.part = part
        pair.confidence = bone_map.confidence.get(bone, 1.0)
    settings.active = 0


def listed_map(settings: bpy.types.PropertyGroup) -> BoneMap:
    """Return the list as a map; entries without a bone or a part are left out."""
    from ...retarget.bone_map import BoneMap

    pairs = [pair for pair in settings.pairs if pair.bone and pair.part]
    return BoneMap(
        {pair.bone: pair.part for pair in pairs}, {pair.bone: pair.confidence for pair in pairs}
    )


def common_prefix(bones: list[str]) -> str:
    """Return what all names begin with, up to a separator, such as ``mixamorig:``; empty if there
    is nothing.
    """
    shared = os.path.commonprefix(bones) if len(bones) > 1 else ""
    return shared[: 1 + max(shared.rfind(separator) for separator in ":_. ")]
