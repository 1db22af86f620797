# SPDX-License-Identifier: GPL-3.0-or-later
"""Take the README's moving picture in a Blender with a window: the sample is captured, compared
with the footage, seen from the side, and retargeted to a character of boxes.

Usage: ``blender --python tour.py -- VIDEO OUT_FOLDER``. Writes OUT_FOLDER/tour_000.png and so on.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
from mathutils import Euler, Vector

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shared.session import FOOTAGE, OUT, addon, invoke, picture, run, show_tab, until, use, viewport

# Shares of the motion that are shown of it over the footage, from the side, and of the character.
PARTS = ((0.0, 0.55), (0.25, 0.8), (0.45, 1.0))
STEP = 4  # frames of the scene from one picture to the next
WHILE_CAPTURING = 8  # pictures
BESIDE_M = 1.3
DISTANCE_M = {1: 3.6, 2: 4.4}  # of the view, by the number of armatures
BOX_COLOUR = (0.9, 0.45, 0.1, 1.0)
taken = 0


def take() -> None:
    """Draw the window and take the next picture."""
    global taken
    with bpy.context.temp_override(**viewport()):
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
    picture(f"tour_{taken:03}")
    taken += 1


def while_capturing() -> Iterator[float]:
    """Capture, with a picture after each further part of the footage."""
    use(bpy.ops.scope.capture, "INVOKE_DEFAULT")
    for part in range(WHILE_CAPTURING):

        def is_reached(wanted: float = part / WHILE_CAPTURING) -> bool:
            job = addon().state.job
            if job is None:
                return True
            return job.progress.total > 0 and job.progress.done >= wanted * job.progress.total

        yield from until(is_reached, 600, "the next part of the footage")
        if addon().state.job is not None:
            take()
    yield from until(lambda: addon().state.job is None, 600, "the end of the capture")


def look_from(turned_deg: float, middle: Vector, distance_m: float) -> None:
    """Look at a place from a side of it, slightly from above."""
    view = viewport()["area"].spaces.active.region_3d
    view.view_perspective = "PERSP"
    view.view_rotation = Euler((math.radians(78), 0, math.radians(turned_deg))).to_quaternion()
    view.view_location = middle
    view.view_distance = distance_m


def frames_of(part: tuple[float, float]) -> range:
    """Return the scene frames to show of a part of the motion."""
    scene = bpy.context.scene
    count = scene.frame_end - scene.frame_start
    first, last = (scene.frame_start + round(share * count) for share in part)
    return range(first, last + 1, STEP)


def played(
    part: tuple[float, float], turned_deg: tuple[float, float], shown: list[bpy.types.Object]
) -> Iterator[float]:
    """Take pictures of a part of the motion of armatures, while the view turns and follows them."""
    frames = frames_of(part)
    for index, frame in enumerate(frames):
        share = index / len(frames)
        bpy.context.scene.frame_set(frame)
        places = [rig.matrix_world @ rig.pose.bones[0].head for rig in shown]
        middle = sum(places, Vector()) / len(places)
        turned = turned_deg[0] + share * (turned_deg[1] - turned_deg[0])
        look_from(turned, middle, DISTANCE_M[len(shown)])
        take()
        yield 0.01


def make_character(person: bpy.types.Object) -> bpy.types.Object:
    """Make a rig with Mixamo's prefix whose bones carry boxes; return its armature."""
    data = person.data.copy()
    rig = bpy.data.objects.new("boxes", data)
    bpy.context.scene.collection.objects.link(rig)
    material = bpy.data.materials.new("boxes")
    material.diffuse_color = BOX_COLOUR
    for bone in data.bones:
        bone.name = f"mixamorig:{bone.name}"
        thick = min(0.4 * bone.length, 0.08)
        bpy.ops.mesh.primitive_cube_add(size=1.0)
        box = bpy.context.object
        box.data.materials.append(material)
        box.scale = (2 * thick, 0.9 * bone.length, 2 * thick)
        box.parent = rig
        box.parent_type = "BONE"
        box.parent_bone = bone.name
        box.location = (0.0, -0.5 * bone.length, 0.0)
    return rig


def steps() -> Iterator[float]:
    """Run the session; yield the seconds to wait before each next step."""
    scene = bpy.context.scene
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    yield 1.0
    show_tab()
    bpy.ops.scope.choose_footage(filepath=FOOTAGE)
    yield 2.0
    for _ in range(3):
        take()
    yield from while_capturing()
    yield 2.0
    assert scene.scope.result.collection is not None, addon().state.message
    person = next(o for o in scene.scope.result.collection.objects if o.type == "ARMATURE")

    invoke(bpy.ops.scope.look_through)
    yield 5.0  # Blender moves the panels below gradually
    for frame in frames_of(PARTS[0]):
        scene.frame_set(frame)
        take()
        yield 0.01
    invoke(bpy.ops.scope.look_through)
    yield 1.0
    for item in scene.scope.result.collection.objects:
        item.hide_set(item.type in {"ARMATURE", "CAMERA"})
    yield from played(PARTS[1], (20.0, 90.0), [person])

    rig = make_character(person)
    settings = scene.scope_retarget
    settings.rig = rig
    settings.captured = "beside"
    rig.location.x += BESIDE_M
    use(bpy.ops.scope.guess_bones)
    use(bpy.ops.scope.retarget)
    rig.hide_set(True)
    yield 1.0
    yield from played(PARTS[2], (-25.0, 25.0), [person, rig])
    (OUT / "tour.json").write_text(json.dumps({"pictures": taken}))


run(steps())
