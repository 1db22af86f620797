# SPDX-License-Identifier: GPL-3.0-or-later
"""The active captured person, and the data of the capture that is stored with its armature."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

from ..errors import UsageError
from ..scene.datablocks import holds
from ..scene.stored_values import stored_numbers, stored_text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ...solver.body import Body
    from ..motion import Motion


# Custom property of a rig: the captured armature that it was retargeted from; its name in older
# .blend files.
PERSON = "scope_person"


def captured_armature(context: bpy.types.Context) -> bpy.types.Object | None:
    """Return the captured armature of the active object, or else the only one of the selected
    capture or scene.
    """
    obj = context.view_layer.objects.active if context.view_layer else None
    while obj is not None:
        if "scope_source" in obj:
            return obj
        person = _retargeted_from(context.scene, obj)
        if person is not None:
            return person
        found = [child for child in obj.children if "scope_source" in child]
        if len(found) == 1:
            return found[0]
        obj = obj.parent
    collection = context.scene.scope.capture
    found = captured_people(context)
    last = [o for o in found if holds(collection, o)] if collection else []
    return last[0] if len(last) == 1 else found[0] if len(found) == 1 else None


def _retargeted_from(scene: bpy.types.Scene, rig: bpy.types.Object) -> bpy.types.Object | None:
    """Return the captured armature in the scene that a rig was retargeted from."""
    person = rig.get(PERSON)
    if isinstance(person, str):
        person = scene.objects.get(person)
    if not isinstance(person, bpy.types.Object) or "scope_source" not in person:
        return None
    return person if holds(scene.collection, person) else None


def captured_people(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the captured armatures of the scene."""
    return [
        obj for obj in context.scene.objects if obj.type == "ARMATURE" and "scope_source" in obj
    ]


def has_captured_person(context: bpy.types.Context) -> bool:
    """Return whether the scene contains a captured person, or one is active."""
    return captured_armature(context) is not None or bool(captured_people(context))


def draw_active_person(
    layout: bpy.types.UILayout, context: bpy.types.Context
) -> bpy.types.Object | None:
    """Draw the name of the active captured armature, or a request to select one; return the
    armature.
    """
    armature = captured_armature(context)
    text = armature.name if armature else "Select a Captured Person"
    layout.label(
        text=text, icon="OUTLINER_OB_ARMATURE" if armature else "INFO", translate=armature is None
    )
    return armature


def library_of(armature: bpy.types.Object) -> bpy.types.Library | None:
    """Return the library that the armature or its action is linked from, overridden or not; None if
    both are local.
    """
    blocks = [armature, armature.animation_data.action if armature.animation_data else None]
    for block in filter(None, blocks):
        original = block.override_library.reference if block.override_library else block
        if original is not None and original.library is not None:
            return original.library
    return None


def body_of(armature: bpy.types.Object) -> Body:
    """Return the body that the person was captured with.

    :raises ModelFileError: the body's file no longer exists or cannot be read.
    :raises UsageError: the armature does not store which body it is.
    """
    from ..untrusted.body_file import load_body

    which = stored_text(armature, "scope_body_file") or stored_text(armature, "scope_body")
    if not which:
        raise UsageError(
            f"'{armature.name}' does not store which body it is; undo what changed "
            "it, or capture again"
        )
    return load_body(which)


def betas_of(armature: bpy.types.Object, body: Body) -> NDArray[np.float64]:
    """Return the person's shape coefficients, (P,).

    :raises UsageError: the armature does not store them.
    """
    import numpy as np

    betas = np.array(stored_numbers(armature, "scope_betas"))
    if betas.shape != (body.P,):
        raise UsageError(f"'{armature.name}' has no stored body shape; capture again")
    return betas


def motion_of(armature: bpy.types.Object) -> Motion:
    """Return the captured motion, before any editing but with its corrections.

    :raises UsageError: the armature does not store it.
    :raises MotionFileError: what it stores is damaged.
    """
    from ..scene.packed_motion import stored_motion

    return stored_motion(armature)


def set_motion_of(armature: bpy.types.Object, motion: Motion, keys: bytes = b"") -> None:
    """Store a motion as the armature's captured one. Undo restores the former one, and its
    duplicates keep it.

    :param keys: the keys from before the motion's corrections, see
        ``scene/character/uncorrected_keys.py``.
    """
    from ..scene.packed_motion import pack_motion

    pack_motion(armature, motion.to_bytes(), keys)
