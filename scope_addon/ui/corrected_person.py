# SPDX-License-Identifier: GPL-3.0-or-later
"""Changing the corrections of a captured armature: in its motion, in its keys and in the list for
the panel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy

from ..scene.character.correction_list import store_corrections
from .captured_person import body_of, motion_of, set_motion_of
from .edit_base import EditOperator
from .preferences import keep_machine_code

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...solver.body import Body
    from ..edit.corrections import Correction, Pin
    from ..motion import Motion


class CorrectionOperator(EditOperator):
    """A correction after which Blender evaluates the current frame again. Not registered."""

    def work(self, context: bpy.types.Context) -> str:
        """Correct the motion and its keys."""
        message = super().work(context)
        context.scene.frame_set(context.scene.frame_current, subframe=context.scene.frame_subframe)
        return message


def change_corrections(
    armature: bpy.types.Object,
    body: Body,
    rate: float,
    change: Callable[[tuple[Correction, ...]], tuple[Correction, ...]],
    added: Correction | None = None,
    rise: float = 0.0,
) -> Motion:
    """Change the corrections of a captured person: of the motion, the keys and the list.

    :param rate: scene frames per second.
    :param change: returns the new corrections for the present ones.
    :param added: the one that this adds; a pin or an edit holds even if edited keys differ from the
        motion.
    :param rise: metres by which all keys are raised, which is an edit of its own.
    :return: the corrected motion.
    :raises UsageError: the motion is no longer there, or keys are missing.
    """
    from ..edit.corrected_motion import corrections_of, with_corrections
    from ..scene.character.corrected_keys import pinned_places, rewrite_changed_keys
    from ..scene.packed_motion import stored_keys

    keep_machine_code()
    before = motion_of(armature)
    after = with_corrections(before, body, change(corrections_of(before)))
    keys = rewrite_changed_keys(
        armature, body, rate, (before, after), stored_keys(armature), added, rise
    )
    set_motion_of(armature, after, keys.to_bytes() if len(keys.times) else b"")
    store_corrections(armature, after, rate, pinned_places(armature, body, rate, after))
    return after


def change_world(
    scene: bpy.types.Scene,
    armature: bpy.types.Object,
    rate: float,
    change: Callable[[tuple[Correction, ...]], tuple[Correction, ...]],
    rise: float = 0.0,
) -> None:
    """Change the upright line or floor of everybody that the same camera has captured, and move the
    camera with them.

    :param rate: scene frames per second.
    :param change: returns the new corrections for the present ones, and changes the same of
        everybody.
    :param rise: metres by which the keys of this person are raised.
    :raises UsageError: the root motion is on an object, or keys are missing.
    """
    import numpy as np

    from ..edit.corrected_motion import corrections_of
    from ..edit.corrections import world_of
    from ..scene.camera import same_camera, view_number
    from ..scene.character.upright_scene import turn_camera
    from ..scene.transaction import all_or_nothing

    motion = motion_of(armature)
    near = [obj for c in armature.users_collection for obj in c.all_objects]
    people = [obj for obj in near if obj != armature and "scope_source" in obj]
    together = [armature, *(obj for obj in people if same_camera(motion_of(obj), motion))]
    every_camera = [obj for obj in near if obj.type == "CAMERA"]
    further = [obj for obj in every_camera if view_number(obj) is not None]
    cameras = [*[obj for obj in every_camera if obj not in further][:1], *further]
    was = world_of(corrections_of(motion))
    now = world_of(change(corrections_of(motion)))
    turn = (np.eye(4) if now is None else now) @ np.linalg.inv(np.eye(4) if was is None else was)
    with all_or_nothing(scene, *together[1:], *cameras):
        for person in together:
            change_corrections(
                person, body_of(person), rate, change, rise=rise if person == armature else 0.0
            )
        for camera in cameras:
            turn_camera(camera, armature, turn, to_captured=now is None)


def without_kinds(corrections: tuple[Correction, ...], kinds: set[str]) -> tuple[Correction, ...]:
    """Return the corrections without those that move the world; the list calls them ``UPRIGHT`` and
    ``FLOOR``.
    """
    from ..edit.corrections import Floor, Upright, removed

    return removed(
        corrections, tuple(cls for cls in (Upright, Floor) if cls.__name__.upper() in kinds)
    )


def shown_frame(scene: bpy.types.Scene, armature: bpy.types.Object, motion: Motion) -> int:
    """Return the footage's frame at the scene's current frame.

    :raises UsageError: the motion has none there.
    """
    from ..scene.character.corrected_keys import source_frame
    from ..scene.timing import scene_rate

    return source_frame(
        armature, motion, scene.frame_current + scene.frame_subframe, scene_rate(scene)
    )


def pin_at(
    context: bpy.types.Context,
    armature: bpy.types.Object,
    motion: Motion,
    joint: str,
    place: tuple[Any, bool, float],
) -> Pin:
    """Return a pin at the scene's current frame.

    :param place: the joint's position in the scene (3,); whether it was placed in the view of the
        capture's camera; and the seconds over which the correction fades out. A pin in the image
        needs the camera where it was captured.
    :raises UsageError: the current frame is outside of the motion.
    """
    import numpy as np

    from ..edit.corrected_motion import corrections_of, shot_of
    from ..edit.corrections import Pin, world_of
    from ..scene.character.corrected_keys import captured_points

    scene = context.scene
    (location, in_image, reach) = place
    context.view_layer.update()
    current = scene.frame_current + scene.frame_subframe
    frame = shown_frame(scene, armature, motion)
    points = [np.array(location, float)]
    if in_image and scene.camera is not None:
        points.append(np.array(scene.camera.matrix_world.translation))
    at = captured_points(armature, current, np.array(points))
    row = int(np.abs(motion.frames - frame).argmin())
    centre = motion.world_from_camera[row, :3, 3]
    if len(at) == 2 and np.linalg.norm(at[1] - centre) < 0.02:
        u, v = shot_of(motion).project(frame, at[0])
        return Pin(frame, joint, pixel=(float(u), float(v)), reach=reach)
    world = world_of(corrections_of(motion))
    x, y, z = at[0] if world is None else (np.linalg.inv(world) @ [*at[0], 1.0])[:3]
    return Pin(frame, joint, position=(float(x), float(y), float(z)), reach=reach)
