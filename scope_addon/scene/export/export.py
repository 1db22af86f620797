# SPDX-License-Identifier: GPL-3.0-or-later
"""Exporting captures from the scene: .glb, .fbx, .blend, .bvh and .usdc. Files that follow from the
captured motion alone are written by ``without_scene``.

Captures are linked to a temporary scene, so that nothing else of the user's file is exported and
the result does not depend on selection or visibility. Files are written atomically. The bones can
have the names of other skeletons, for programs that know these: only the names change, the rest
pose is the body's T-pose, the bones those of the body.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
from bpy.types import Collection, Object

from ....solver.body import Body
from ...atomic_write import atomic_path, reason
from ...errors import OutputError, UsageError
from ...motion import Motion
from ...notices import Notice, notice
from ...output_paths import WITHOUT_SCENE, check_output, person_paths
from ...retarget.bone_names import OWN, SKELETONS, bone_names
from ...temporary import remove
from .. import actions
from ..budget import check_samples
from ..build import NEW_SCENE, BuildOptions, build_scene, check_choices
from ..datablocks import captures_of, modifiers_off, temporary_datablocks
from ..packed_motion import pack_motion
from . import formats
from .bvh import UNITS_PER_METRE
from .export_states import (
    actions_over_scene_range,
    all_evaluated,
    baked_meshes,
    external_parents_replaced,
    one_person,
    out_of_edit_mode,
    scaled,
    scene_of,
    temporary_scene,
    unit_of_captures,
)
from .mesh_modifiers import modifiers_applied

SHAPES = ("auto", "keys", "baked")


@dataclass(frozen=True)
class ExportOptions:
    """Options of ``export``."""

    # include the footage's camera in .glb, .fbx and .usdc; .blend always includes it
    camera: bool = False
    # "keys": morph targets whose value is the coefficient. "baked": a mesh of the fitted shape
    # without morph targets, for engines that clamp them to 0..1. "auto": keys, but baked in .usdc,
    # as USD importers clamp, also Blender's.
    shape: str = "auto"
    separate: bool = False  # one file per person, also in formats that can hold several
    bvh_unit: str = "cm"  # of the lengths in .bvh: "cm" or "m"
    deform_bones: bool = False  # leave out bones that deform nothing, in .glb, .fbx and .usdc
    skeleton: str = OWN  # whose names the bones have, in all formats but .blend
    take: str = ""  # name of the animation; empty: the capture's
    unit: float = 0.0  # metres that a length of 1 stands for; 0: as ``unit_of_captures`` says
    # is called with what users should know about the files
    warn: Callable[[Notice], None] = lambda _notice: None

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: when ``shape``, ``skeleton`` or ``bvh_unit`` is unknown.
        """
        check_choices(self, bvh_unit=UNITS_PER_METRE, skeleton=SKELETONS, shape=SHAPES)

    def bakes(self, suffix: str) -> bool:
        """Return whether the shape is baked into the mesh in files with this suffix."""
        return self.shape == "baked" or (self.shape == "auto" and suffix == ".usdc")


def export(
    path: str | Path,
    collections: Sequence[Collection] | None = None,
    options: ExportOptions | None = None,
) -> list[Path]:
    """Write captures in the format of the suffix, to one file, or one per person for .bvh and on
    request.

    :param collections: the captures; by default those of the active scene.
    :return: the files written.
    :raises UsageError: when the suffix is unknown, or there is nothing to export.
    :raises OutputError: when a file cannot be written.
    """
    path = check_output(path)
    suffix = path.suffix.lower()
    if suffix in WITHOUT_SCENE:
        raise UsageError(
            f"cannot write {path.name} from a scene: it follows from a motion file; write one, and "
            "convert it with scope import"
        )
    chosen = list(collections) if collections is not None else captures_of(bpy.context.scene)
    if not chosen:
        raise UsageError(
            f"cannot write {path.name}: the scene holds no capture; capture a video first"
        )
    options = options or ExportOptions()
    rigs = list(
        dict.fromkeys(obj for c in chosen for obj in c.all_objects if obj.type == "ARMATURE")
    )
    if not rigs:
        raise UsageError(
            f"cannot write {path.name}: the capture's armature was removed; undo that "
            "or capture again"
        )
    targets = person_paths(path, len(rigs), options.separate)
    if len(targets) == 1:
        _write_one(path, chosen, rigs, options)
        return [path]
    for number, (target, rig) in enumerate(zip(targets, rigs, strict=True), 1):
        with one_person(rig, rigs, chosen, f"person{number}") as parts:
            _write_one(target, parts, rigs, options)
    return targets


def _write_one(
    path: Path, collections: Sequence[Collection], rigs: Sequence[Object], options: ExportOptions
) -> None:
    """Write these collections over the frame range of all ``rigs``, so that separate files start at
    the same time.
    """
    suffix = path.suffix.lower()
    take = options.take or (collections[0].name if len(collections) == 1 else path.stem)
    unit = options.unit or unit_of_captures(rigs, bpy.context.scene.unit_settings.scale_length)
    by_scene = suffix in (".fbx", ".blend")  # which regard the scene's unit
    is_in_metres = by_scene or abs(unit - 1.0) < 1e-6
    with (
        temporary_datablocks(used=False),
        out_of_edit_mode(collections),
        # A .blend file goes on as a capture, whose bones are known by their names.
        renamed_bones(rigs, OWN if suffix == ".blend" else options.skeleton),
        # keeps hidden objects as they are
        nullcontext() if suffix == ".blend" else all_evaluated(collections),
        scene_of(collections, rigs, options.camera, unit if by_scene else 1.0) as scene,
        modifiers_off(scene.objects) if suffix == ".bvh" else nullcontext(),
        external_parents_replaced(scene)
        if suffix == ".glb" or not is_in_metres
        else nullcontext(),  # the exporter of .glb omits children of objects outside the scene
        nullcontext() if is_in_metres else scaled(scene, unit),
        # The exporter of .glb only reads actions, and so do meshes of the current shape, whose
        # expressions move.
        actions.nla_as_actions(scene)
        if suffix == ".glb" or options.bakes(suffix)
        else nullcontext(),
        baked_meshes(scene) if options.bakes(suffix) else nullcontext(),
        modifiers_applied(scene, path.name)
        if suffix in (".glb", ".fbx", ".usdc")
        else nullcontext(()) as notices,
        # A .blend file is worked on further, and its actions are as long as their keys.
        nullcontext() if suffix == ".blend" else actions_over_scene_range(scene),
    ):
        rig = next((obj for obj in scene.objects if obj.type == "ARMATURE"), None)
        if rig is None:  # none of them can be in this scene
            raise UsageError(
                f"cannot write {path.name}: the capture's armature is not in a scene; capture again"
            )
        leaves_controls_out = options.deform_bones and suffix in (".glb", ".fbx", ".usdc")
        if leaves_controls_out and not any(bone.use_deform for bone in rig.data.bones):
            raise UsageError(
                f"no bone of '{rig.name}' deforms anything, so none would be left; switch Only "
                "Deform Bones off, on the command line leave out --deform-bones"
            )
        written = [each for each in rigs if each in scene.objects.values()]
        if suffix != ".blend":  # which has keys alone
            check_samples(scene, rigs)
        writers = {
            ".bvh": lambda temporary: formats.write_bvh(temporary, scene, rig, options.bvh_unit),
            ".glb": lambda temporary: formats.write_glb(
                temporary, options.camera, take, options.deform_bones
            ),
            ".fbx": lambda temporary: formats.write_fbx(
                temporary, options.camera, take, options.deform_bones
            ),
            ".usdc": lambda temporary: formats.write_usd(
                temporary, options.camera, options.deform_bones
            ),
            ".blend": lambda temporary: formats.write_blend(temporary, scene),
        }
        _write(path, writers[suffix])
    for each in notices:
        options.warn(each)
    for armature in written if suffix in (".glb", ".fbx", ".usdc") else ():
        bones = [b.name for b in armature.data.bones if b.use_deform and b.bbone_segments > 1]
        if bones:
            options.warn(notice("bends_left_out", file=path.name, rig=armature.name, bones=bones))
        if suffix == ".glb" and armature.matrix_world.determinant() < 0.0:
            options.warn(notice("mirrored_rig", file=path.name, rig=armature.name))


def export_motions(
    motions: list[Motion],
    body: Body,
    path: Path | Sequence[Path],
    footage: str | Path | None = None,
    build_options: BuildOptions | None = None,
    export_options: ExportOptions | None = None,
) -> tuple[list[Path], list[Notice]]:
    """Build the motions in a temporary scene, write one or more files, and leave the session as it
    was.

    The scene has the motion's frame rate and the footage's resolution.

    :return: the files written, and the warnings of the build.
    :raises UsageError: when a suffix is not that of a file which holds a scene.
    :raises MotionFileError: when a motion does not belong to the body.
    :raises VideoError: when the footage is missing.
    :raises OutputError: when a file cannot be written.
    """
    paths = [path] if isinstance(path, Path) else list(path)
    for each in paths:
        check_output(each)
    written: list[Path] = []
    build_options = build_options or replace(NEW_SCENE, name=paths[0].stem)
    with temporary_datablocks(used=False), temporary_scene("Capturing"):
        result = build_scene(motions, body, footage, build_options)
        if any(each.suffix.lower() == ".blend" for each in paths):
            for person in result.people:
                pack_motion(person.armature, person.motion.to_bytes())
        for each in paths:
            written += export(each, [result.collection], export_options)
    return written, result.warnings


def _write(path: Path, writer: Callable[[Path], None]) -> None:
    """Run ``writer(temporary path)`` and rename its file to ``path``; remove it on failure.

    :raises OutputError: when the file cannot be written.
    """
    try:
        with atomic_path(path) as temporary:
            remove(temporary)  # Blender's writers differ in what they do with an existing file
            with formats.quiet():
                writer(temporary)
            if not temporary.is_file():
                raise OutputError(f"cannot write {path}: Blender wrote no file; try another format")
    except (RuntimeError, OSError) as error:
        raise OutputError(f"cannot write {path}: {_reason(error)}") from error


def _reason(error: RuntimeError | OSError) -> str:
    """Return the cause in one sentence, and what to do; Blender reports the whole traceback of a
    failed exporter.
    """
    if isinstance(error, OSError) and error.strerror:
        return reason(error)
    lines = [
        line
        for line in str(error).splitlines()
        if line and not line[0].isspace() and "Location: " not in line
    ]
    last = lines[-1] if lines else type(error).__name__
    cause = re.sub(r"^(?:\w*Error: )*(?:\[Errno \d+\] )?", "", last)
    # Blender's own writers give the system's reason, which is "Success" where a library has lost
    # it.
    is_systems = "[Errno " in last or cause in (os.strerror(code) for code in (0, *errno.errorcode))
    cause = "the file could not be written completely" if cause == os.strerror(0) else cause
    return (
        f"{cause}; "
        f"{'free some space or choose another folder' if is_systems else 'try another format'}"
    )


@contextmanager
def renamed_bones(rigs: Sequence[Object], skeleton: str) -> Iterator[None]:
    """Give the bones of captured people the names of a skeleton inside the block; vertex groups and
    keys follow.
    """
    names = {} if skeleton == OWN else bone_names(skeleton)
    renamed: list[tuple[bpy.types.Bone, str]] = []
    try:
        for armature in {rig.data for rig in rigs}:
            # A body without fingers has the middle of the hand, one with fingers has the knuckle.
            for joint in [joint for joint in names if joint in armature.bones]:
                bone = armature.bones[joint]
                renamed.append((bone, joint))
                bone.name = names[joint]
        yield
    finally:
        for bone, joint in reversed(renamed):
            bone.name = joint
