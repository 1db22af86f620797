# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of a captured armature's corrections, stored with it so that drawing the panel reads no
motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bpy.types import Object

from ..budget import LAST_FRAME

if TYPE_CHECKING:
    from ...arrays import Float64Array
    from ...edit.corrections import Correction, Pin
    from ...motion import Motion

_LIST = "scope_corrections"  # custom property of the armature
_MISSED_PX = 2.0
_MISSED_M = 0.01
_ENTRY = {"kind": str, "text": str, "joint": str, "first": int, "last": int}


def listed_corrections(armature: Object) -> list[dict[str, Any]]:
    """Return the corrections in their order: ``kind``, ``text``, ``joint``, scene frames ``first``
    and ``last``.

    A pin that its joint cannot reach has the distance in ``missed``, with its unit; otherwise, this
    is empty.

    A .blend file may be hostile: entries that are something else are left out.
    """
    if _LIST not in armature:
        return []
    import json  # here, because Blender loads this module when it starts

    try:
        listed = json.loads(armature.get(_LIST, "[]"))
    except (TypeError, ValueError, RecursionError):
        return []
    found = [each for each in listed if _is_entry(each)] if isinstance(listed, list) else []
    return [{**each, "missed": str(each.get("missed", ""))} for each in found]


def _is_entry(value: object) -> bool:
    if not isinstance(value, dict) or not all(
        type(value.get(name)) is kind for name, kind in _ENTRY.items()
    ):
        return False
    return all(-LAST_FRAME <= int(value[name]) <= LAST_FRAME for name in ("first", "last"))


def store_corrections(
    armature: Object, motion: Motion, rate: float, places: dict[Pin, Float64Array] | None = None
) -> None:
    """Store the list of a motion's corrections with its armature.

    :param rate: scene frames per second.
    :param places: where edited keys have the pinned joints, (3,) metres in the world; as in the
        motion if None.
    :raises MotionFileError: the motion's corrections are damaged.
    """
    import json

    from ...edit.corrected_motion import corrections_of
    from ...edit.corrections import Pin

    entries = []
    for correction in corrections_of(motion):
        entries.append(_entry(armature, motion, correction, rate))
        if isinstance(correction, Pin):
            entries[-1]["missed"] = _missed(motion, correction, (places or {}).get(correction))
    armature[_LIST] = json.dumps(entries)


def _entry(armature: Object, motion: Motion, correction: Correction, rate: float) -> dict[str, Any]:
    """Describe a correction."""
    from ...edit.corrections import FeetOnFloor, Floor, Pin, Upright
    from .corrected_keys import frames_that_show, scene_frame

    kind, text = _kind_and_text(correction)
    if isinstance(correction, Pin | Floor):
        span = (correction.frame,) * 2
    elif isinstance(correction, Upright | FeetOnFloor):
        span = int(motion.frames[0]), int(motion.frames[-1])
    else:
        span = correction.first, correction.last
    if span[0] == span[1]:
        first, last = frames_that_show(armature, motion, span[0], rate)
    else:
        first, last = (round(scene_frame(armature, motion, frame, rate)) for frame in span)
    joint = correction.joint if isinstance(correction, Pin) else ""
    return {"kind": kind, "text": text, "first": first, "last": last, "joint": joint}


def _kind_and_text(correction: Correction) -> tuple[str, str]:
    """Return the kind of a correction, and what the list calls it."""
    from ...edit.corrections import (
        FEET,
        Contact,
        DepthFlip,
        Exchange,
        FeetOnFloor,
        Interpolation,
        Pin,
        Upright,
    )

    if isinstance(correction, Pin):
        return "PIN", _title(correction.joint)
    if isinstance(correction, Contact):
        part = _title(correction.part)
        return "CONTACT", f"{part} Foot Stands" if correction.part in FEET else part
    if isinstance(correction, DepthFlip):
        is_body = correction.part == "body"
        return "FLIP", "Turned Around" if is_body else _title(correction.part)
    if isinstance(correction, Exchange):
        what = {"both": "Sides", "arms": "Arms", "legs": "Legs"}[correction.limbs]
        return "EXCHANGE", f"{what} Exchanged"
    if isinstance(correction, Interpolation):
        return "INTERPOLATION", "Interpolated"
    if isinstance(correction, Upright):
        return "UPRIGHT", "Upright Line"
    if isinstance(correction, FeetOnFloor):
        return "FEET", "Feet on the Floor"
    return "FLOOR", "Floor"


def _title(name: str) -> str:
    return name.replace("_", " ").title()


def _missed(motion: Motion, pin: Pin, place: Float64Array | None) -> str:
    """Return how far a joint is from a pin that it cannot reach, with the unit; empty if it is
    there.
    """
    from ...edit.corrected_motion import distance_from_pin

    distance = distance_from_pin(motion, pin, place)
    if distance < (_MISSED_M if pin.pixel is None else _MISSED_PX):
        return ""
    return f"{100 * distance:.0f} cm" if pin.pixel is None else f"{distance:.0f} px"
