# SPDX-License-Identifier: GPL-3.0-or-later
"""Building a Blender scene from motions: a collection with a camera, and an armature and a mesh for
each person; and removing a capture with everything that was made for it, and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np
from bpy.types import ID, Collection, Object, Scene

from ...solver.body import Body
from ..arrays import BoolArray, Float64Array
from ..errors import MotionFileError, UsageError
from ..footage import display_text
from ..kinematics.face import body_with_mouth, expressions_of
from ..kinematics.foot_skin import under_floor
from ..motion import Motion
from ..notices import Notice, notice
from . import camera, timing
from .actions import Channels
from .budget import check_content, check_last_frame
from .character import animation, armature, body_mesh, other_curves
from .character.armature import remove_unused_ring
from .character.correction_list import store_corrections
from .character.keys import bake_whole_frames
from .datablocks import (
    CAPTURE_TAG,
    MARKERS,
    NAME_TAG,
    SOURCE_TAG,
    captures_of,
    check_local,
    enter_object_mode,
    is_part,
    parts_of,
    remove_blocks,
    short_name,
    tag_part,
    with_data,
)
from .packed_motion import motion_texts
from .transaction import all_or_nothing
from .visibility import select_only, world_matrix


@dataclass(frozen=True)
class BuildOptions:
    """Options of ``build_scene``."""

    name: str = ""  # of the capture; empty: the footage's or the motion's source name
    # "keep": the scene's rate, with keys at the times of the pictures. "resample": the scene's
    # rate, with a key on every whole frame. "set": the motion's rate.
    frame_rate: str = "keep"
    resolution: str = "keep"  # "keep": the scene's. "set": the footage's size and pixel aspect
    set_frame_range: bool = True
    active_camera: bool = False  # make the capture's camera the scene's active camera
    start_frame: float = 0.0  # the scene frame of timestamp 0
    shape: str = "keyed"  # "keyed": shape keys. "baked": into the mesh
    with_camera: bool = True
    with_markers: bool = True  # at the review spans, on the timeline
    # Of the motion's further cameras, in their order; None, or fewer: not shown.
    view_footage: Sequence[str | Path | None] = ()

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: when a value is unknown.
        """
        check_choices(
            self,
            frame_rate=timing.RATE_POLICIES,
            resolution=timing.POLICIES,
            shape=body_mesh.MODES,
        )


def check_choices(options: object, **choices: Iterable[str]) -> None:
    """Check that options have one of their valid values.

    :raises UsageError: one has another.
    """
    for option, valid in choices.items():
        value = getattr(options, option)
        if value not in valid:
            raise UsageError(f"{option} must be one of {', '.join(valid)}, but is '{value}'")


NEW_SCENE = BuildOptions(frame_rate="set", resolution="set", active_camera=True)


@dataclass
class Person:
    """The objects of one motion."""

    armature: Object
    mesh: Object
    camera: Object | None
    motion: Motion = field(repr=False)
    frames: Float64Array = field(repr=False)  # (T,) scene frame of each pose
    under_floor: BoolArray = field(repr=False)  # (T,) poses with a foot under the floor


@dataclass
class BuildResult:
    """The result of ``build_scene``."""

    collection: Collection
    people: list[Person]
    frame_rate: float  # of the scene, frames per second
    frame_range: tuple[float, float]  # first and last key
    warnings: list[Notice] = field(default_factory=list)


def build_scene(
    motions: list[Motion],
    body: Body,
    footage: str | Path | None = None,
    options: BuildOptions | None = None,
) -> BuildResult:
    """Build the motions of one capture in the active scene.

    The options determine whether the scene's frame rate and resolution change. When anything fails,
    the scene is left as it was.

    :param body: the body that the motions were fitted with; it must have their joints and shape
        coefficients.
    :param footage: video or picture to show as the camera's background.
    :raises UsageError: when there are no motions, or the active scene is linked.
    :raises MotionFileError: when a motion does not belong to the body.
    :raises VideoError: when the footage is missing.
    """
    options = options or BuildOptions()
    if not motions:
        raise UsageError("there is no motion to build; capture a video first")
    for motion in motions:
        _check(motion, body)
    scene = bpy.context.scene
    check_local(scene)
    with all_or_nothing(scene):
        return _build(scene, motions, body, footage, options)


def _build(
    scene: Scene,
    motions: list[Motion],
    body: Body,
    footage: str | Path | None,
    options: BuildOptions,
) -> BuildResult:
    name = short_name(
        options.name or display_text(Path(str(footage or motions[0].source or "capture")).stem)
    )
    warnings = _face_warnings(motions, body)
    if options.frame_rate == "set" and len(motions[0]) > 1:  # a still image has none
        timing.set_scene_rate(scene, motions[0].mocap_framerate)
    rate = timing.scene_rate(scene)
    collection = bpy.data.collections.new(name)
    collection[NAME_TAG] = name = collection.name  # numbered if there is one of that name
    collection[CAPTURE_TAG] = motions[0].source or name
    camera.store_resolution(collection, motions[0])
    scene.collection.children.link(collection)
    people: list[Person] = []
    for index, motion in enumerate(motions):
        label = name if len(motions) == 1 else f"{name}_person{index + 1}"
        people.append(_build_person(label, motion, body, collection, rate, options))
    if options.with_markers:
        names: list[str] = []
        for index, person in enumerate(people):
            prefix = "" if len(people) == 1 else f"person {index + 1} "
            names += other_curves.add_review_markers(
                scene, prefix, person.motion, person.frames, person.under_floor
            )
        collection[MARKERS] = "\n".join(names)
    if options.with_camera:
        warnings += _build_cameras(name, people, collection, footage, options)
    unit = scene.unit_settings.scale_length
    if abs(unit - 1.0) > 1e-6:
        warnings.append(notice("scene_unit", unit_m=unit, scale=1 / unit))
    warnings += timing.stretched_time_notices(scene)
    if options.resolution == "set":
        camera.set_resolution(scene, collection)
    if options.active_camera and people[0].camera is not None:
        scene.camera = people[0].camera
    first = float(min(person.frames[0] for person in people))
    last = float(max(person.frames[-1] for person in people))
    if options.set_frame_range:
        _set_frame_range(scene, collection, first, last)
    scene.frame_set(math.floor(first) if options.set_frame_range else scene.frame_current)
    select_only(bpy.context.view_layer, *(person.armature for person in people))
    return BuildResult(collection, people, rate, (first, last), warnings)


def _face_warnings(motions: list[Motion], body: Body) -> list[Notice]:
    if expressions_of(body) or not any(motion.face for motion in motions):
        return []
    return [notice("no_expressions", body=body.name)]


def _set_frame_range(scene: Scene, collection: Collection, first: float, last: float) -> None:
    """Set the scene's frame range to a capture's, together with that of the captures before."""
    if captures_of(scene) != [collection]:
        first = min(first, scene.frame_start)
        last = max(last, scene.frame_end)
    timing.set_frame_range(scene, first, last)


def _build_person(
    label: str,
    motion: Motion,
    body: Body,
    collection: Collection,
    rate: float,
    options: BuildOptions,
) -> Person:
    rest = armature.rest_pose(body, motion.betas)
    rig = armature.build_armature(label, body, rest, collection)
    baked = options.shape == "baked"
    drawn = body_with_mouth(body) if motion.face else body
    vertices = body_mesh.rest_vertices_world(drawn, rest.lift, motion.betas if baked else None)
    mesh = body_mesh.build_mesh(f"{label}_body", drawn, vertices, collection)
    tag_part(mesh)
    frames = timing.key_frames(motion.timestamps, rate, options.start_frame)
    check_last_frame(frames[-1])
    shaped = body_mesh.rest_vertices_world(body, rest.lift, motion.betas)
    armature.show_bones(rig, body, rest, shaped)
    action = bpy.data.actions.new(label)
    # kept in the file when the armature gets another action or NLA strips
    action.use_fake_user = True
    tag_part(action)
    channels = animation.animate_armature(rig, action, body, motion, rest, frames)
    other_curves.key_measurements(rig, channels, body, motion, frames)
    if options.frame_rate == "resample":
        bake_whole_frames(rig, body, rate)
        rig["scope_resampled"] = True  # smoothing again resamples too
    of_keys = None
    if not baked and body.P:
        body_mesh.add_shape_keys(mesh, drawn, motion.betas)
        of_keys = body_mesh.key_shape(mesh, action, motion.betas, frames[0])
    if motion.face and body_mesh.add_expression_keys(mesh, drawn):
        of_keys = of_keys or Channels(mesh.data.shape_keys, action)
        body_mesh.key_expressions(mesh, of_keys, motion, frames, options.frame_rate == "resample")
    body_mesh.skin_to_armature(mesh, rig, drawn)
    rig[SOURCE_TAG] = motion.source
    rig["scope_body"] = body.name
    rig["scope_body_file"] = body.file
    rig["scope_start"] = options.start_frame
    if motion.uneven_ground:
        rig["scope_uneven_ground"] = True
    timing.store_rate(rig, rate)
    rig["scope_betas"] = [float(b) for b in motion.betas]
    if motion.corrections:
        store_corrections(rig, motion, rate)
    return Person(rig, mesh, None, motion, frames, under_floor(motion, body))


def _build_cameras(
    name: str,
    people: list[Person],
    collection: Collection,
    footage: str | Path | None,
    options: BuildOptions,
) -> list[Notice]:
    """Create the camera of every person, shared by people in the same clip; return warnings."""
    warnings: list[Notice] = []
    for index, person in enumerate(people):
        shared = next(
            (p.camera for p in people[:index] if camera.same_camera(p.motion, person.motion)), None
        )
        if shared is not None:
            person.camera = shared
            continue
        person.camera = camera.build_camera(
            f"{name}_camera", person.motion, collection, person.frames
        )
        tag_part(person.camera)
        if camera.pixel_aspect(person.motion) != (1.0, 1.0) and options.resolution == "keep":
            warnings.append(notice("pixel_aspect"))
        if footage is not None:
            warnings += camera.show_footage(person.camera, footage, person.motion, person.frames)
        warnings += _build_views(name, person, collection, options.view_footage)
    return warnings


def _build_views(
    name: str, person: Person, collection: Collection, footage: Sequence[str | Path | None]
) -> list[Notice]:
    """Create the further cameras of a person's motion; return warnings."""
    warnings: list[Notice] = []
    for number in range(person.motion.view_count):
        label = f"{name}_camera{number + 2}"
        obj = camera.build_view(label, person.motion, number, collection, person.frames)
        tag_part(obj)
        if number < len(footage) and (path := footage[number]) is not None:
            seen = person.motion.from_view(number)
            warnings += camera.show_footage(obj, path, seen, person.frames)
    return warnings


def _check(motion: Motion, body: Body) -> None:
    """Check that a motion has the body's joints and shape coefficients, finite numbers, and no more
    frames than its content explains.

    :raises MotionFileError: when it has not.
    """
    motion.check_body(body)
    for name in ("poses", "trans", "betas", "intrinsics", "world_from_camera"):
        if not np.isfinite(getattr(motion, name)).all():
            raise MotionFileError(
                f"the motion's {name} contain NaN or infinity; capture the video again"
            )
    check_content(motion)


def delete_capture(scene: Scene, collection: Collection) -> None:
    """Remove a capture's people, camera, footage, actions and markers, and its collection.

    Objects of the user's in the collection stay where they are, in each scene's own collection if
    they are in no other. So does data that something else uses, assets, and what the user keeps by
    a fake user.
    """
    enter_object_mode(bpy.context.view_layer)
    own = parts_of(collection)
    used = [*_data_of(own), *motion_texts(own)]
    for child in [child for obj in own for child in obj.children if child not in own]:
        place = world_matrix(child)
        child.parent = None
        child.matrix_world = place
    collections = [collection, *collection.children_recursive]
    for obj in [obj for obj in collection.all_objects if obj not in own]:
        _keep_in_scenes(obj, collections)
    _remove_markers(scene, collection)
    remove_blocks(own)
    bpy.data.batch_remove(collections)
    # What the objects used is free now, unless something else uses it too; actions are freed by the
    # data that they animate.
    used = [block for block in used if not _is_kept(block)]
    while unused := [block for block in used if block.users == int(block.use_fake_user)]:
        used = [block for block in used if block not in unused]
        bpy.data.batch_remove(unused)
    remove_unused_ring()


@contextmanager
def names_free(collection: Collection) -> Iterator[None]:
    """Give a capture other names inside the block, so that a second one built there gets the same
    names without Blender's numbers.
    """
    own = parts_of(collection)
    blocks = [collection, *own, *_data_of(own), *motion_texts(own)]
    names = [(block, block.name) for block in blocks if block.library is None]
    try:
        for block, name in names:
            block.name = f"former {name}"
        yield
    finally:
        for block, name in names:
            block.name = name


def _keep_in_scenes(obj: Object, collections: Sequence[Collection]) -> None:
    """Keep an object in its scenes when some collections are removed."""
    others = set(obj.users_collection) - set(collections)
    for scene in obj.users_scene:
        if scene.library is None and others.isdisjoint(
            (scene.collection, *scene.collection.children_recursive)
        ):
            scene.collection.objects.link(obj)


def _is_kept(block: ID) -> bool:
    """Return whether the user keeps a datablock, also without a use."""
    return block.asset_data is not None or (block.use_fake_user and not is_part(block))


def _data_of(objects: Iterable[Object]) -> list[ID]:
    """Return the local data that objects use: meshes, armatures, cameras, materials, footage and
    actions.
    """
    found: list[ID | None] = []
    for obj in objects:
        data = obj.data
        found += [data, *(slot.material for slot in obj.material_slots)]
        owners = with_data(obj)
        if obj.type == "CAMERA":
            pictures = [each.image or each.clip for each in data.background_images]
            found += pictures
            owners += pictures
        found += [action for owner in owners for action in timing.played_actions(owner)]
    return [block for block in dict.fromkeys(found) if block is not None and block.library is None]


def _remove_markers(scene: Scene, collection: Collection) -> None:
    """Remove the markers at a capture's review spans, where the user has left them as they were."""
    names = collection.get(MARKERS)
    for name in names.split("\n") if isinstance(names, str) else ():
        marker = scene.timeline_markers.get(name)
        if marker is not None:
            scene.timeline_markers.remove(marker)
