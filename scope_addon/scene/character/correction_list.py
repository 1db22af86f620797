# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of a captured armature's corrections, stored with it so that drawing the panel reads no motion."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import bpy

if TYPE_CHECKING:
    from ...edit.pins.corrections import Correction
    from ...motion import Motion

_LIST = "scope_corrections"  # custom property of the armature
_ENTRY = {"kind": str, "text": str, "joint": str, "first": int, "last": int}


def listed_corrections(armature: bpy.types.Object) -> list[dict[str, Any]]:
    """Return the corrections in their order: ``kind``, ``text``, ``joint``, scene frames ``first`` and ``last``.

    A .blend file may be hostile: entries that are something else are left out.
    """
    try:
        listed = json.loads(armature.get(_LIST, "[]"))
    except (TypeError, ValueError, RecursionError):
        return []
    return [each for each in listed if _is_entry(each)] if isinstance(listed, list) else []


def _is_entry(value: object) -> bool:
    return isinstance(value, dict) and all(type(value.get(name)) is kind for name, kind in _ENTRY.items())


def store_corrections(armature: bpy.types.Object, motion: Motion, rate: float) -> None:
    """Store the list of a motion's corrections with its armature.

    :param rate: scene frames per second.
    :raises MotionFileError: the motion's corrections are damaged.
    """
    from ...edit.pins.corrected_motion import corrections_of

    armature[_LIST] = json.dumps([_entry(armature, motion, c, rate) for c in corrections_of(motion)])


def _entry(armature: bpy.types.Object, motion: Motion, correction: Correction, rate: float) -> dict[str, Any]:
    """Describe a correction."""
    from ...edit.pins.corrections import Contact, Pin
    from .corrected_keys import scene_frame

    if isinstance(correction, Pin):
        kind, text, span = "PIN", correction.joint.replace("_", " ").title(), (correction.frame,) * 2
    elif isinstance(correction, Contact):
        kind, text, span = "CONTACT", f"{correction.foot.title()} Foot Stands", (correction.first, correction.last)
    else:
        what = {"both": "Left and Right", "arms": "Arms", "legs": "Legs"}[correction.limbs]
        kind, text, span = "EXCHANGE", f"{what} Exchanged", (correction.first, correction.last)
    first, last = (round(scene_frame(armature, motion, frame, rate)) for frame in span)
    joint = correction.joint if isinstance(correction, Pin) else ""
    return {"kind": kind, "text": text, "first": first, "last": last, "joint": joint}
