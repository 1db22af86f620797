# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures to files: .glb .fbx .blend .bvh .usdc by what the scene holds, .npz by what was captured.

Captures are linked into a scene of their own for the time of the export, so that nothing else of the user's file goes
along and nothing depends on selection or visibility. Files are written beside their place and renamed into it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ....solver.body import Body
from ...atomic_write import atomic_path, reason
from ...errors import OutputError, UsageError
from ...motion import Motion
from ..animation_data import actions
from ..build import CAPTURE_TAG, NEW_SCENE, BuildOptions, BuildResult, Progress, build_scene
from ..character.bone_display import remove_if_unused
from . import formats
from .export_states import (
    actions_as_long_as,
    all_evaluated,
    alone,
    baked_meshes,
    out_of_edit_mode,
    scene_of,
    temporary_scene,
    with_carriers,
)
from .output_paths import check_output, person_paths

SHAPES = ("auto", "keys", "baked")


@dataclass(frozen=True)
class ExportOptions:
    """What goes into the files."""

    camera: bool = False  # the footage's camera, in .glb, .fbx and .usdc; .blend always has it
    # "keys": morph targets whose value is the coefficient. "baked": a plain mesh of the fitted shape, for engines that
    # clamp morphs to 0..1. "auto": keys, but baked in .usdc, because USD importers (Blender's among them) clamp.
    shape: str = "auto"
    separate: bool = False  # a file for each person, also in the formats that hold several

    def __post_init__(self) -> None:
        """Refuse values that are not offered."""
        if self.shape not in SHAPES:
            raise UsageError(f"shape must be one of {', '.join(SHAPES)}, but is '{self.shape}'")

    def bakes(self, suffix: str) -> bool:
        """Whether a file of this format gets the shape baked into its mesh."""
        return self.shape == "baked" or (self.shape == "auto" and suffix == ".usdc")


def captures(scene: bpy.types.Scene) -> list[bpy.types.Collection]:
    """The collections of a scene that hold captures."""
    return [c for c in scene.collection.children_recursive if CAPTURE_TAG in c]


def export(
    path: str | Path,
    collections: Sequence[bpy.types.Collection] | None = None,
    motions: Sequence[Motion] = (),
    options: ExportOptions | None = None,
) -> list[Path]:
    """Write captures to one file (.bvh and .npz, or where it is wanted: one per person) in the format of its suffix.

    :param collections: the captures; those of the active scene when not given.
    :param motions: needed for .npz, which holds what was captured rather than what the scene has become.
    :return: the files written.
    :raises UsageError: unknown suffix, or nothing to export. :raises OutputError: cannot be written.
    """
    path = check_output(path)
    suffix = path.suffix.lower()
    if suffix == ".npz" and motions:
        targets = person_paths(path, len(motions))
        for target, motion in zip(targets, motions, strict=True):
            motion.save(target)
        return targets
    chosen = list(collections) if collections is not None else captures(bpy.context.scene)
    if not chosen:
        raise UsageError(f"cannot write {path.name}: the scene holds no capture; capture a video first")
    options = options or ExportOptions()
    rigs = list(dict.fromkeys(obj for c in chosen for obj in c.all_objects if obj.type == "ARMATURE"))
    if not rigs:
        raise UsageError(f"cannot write {path.name}: the capture's armature was removed; undo that or capture again")
    if suffix == ".npz":
        raise UsageError(f"cannot write {path.name}: a motion file holds what was captured, so pass the motions")
    targets = person_paths(path, len(rigs), options.separate)
    if len(targets) == 1:
        _write_one(path, chosen, rigs, options)
        return [path]
    for number, (target, rig) in enumerate(zip(targets, rigs, strict=True), 1):
        with alone(rig, rigs, chosen, f"person{number}") as parts:
            _write_one(target, parts, rigs, options)
    return targets


def _write_one(
    path: Path,
    collections: Sequence[bpy.types.Collection],
    rigs: Sequence[bpy.types.Object],
    options: ExportOptions,
) -> None:
    """Write these collections, as long as all of ``rigs`` move: files of several people begin at the same time."""
    suffix = path.suffix.lower()
    with (
        out_of_edit_mode(collections),
        nullcontext() if suffix == ".blend" else all_evaluated(collections),  # a scene keeps what is hidden in it
        scene_of(collections, rigs, options.camera) as scene,
        with_carriers(scene) if suffix == ".glb" else nullcontext(),  # that exporter leaves out what hangs on others
        baked_meshes(scene) if options.bakes(suffix) else nullcontext(),
        actions.nla_as_actions(scene) if suffix == ".glb" else nullcontext(),  # that exporter reads actions alone
        actions_as_long_as(scene),
    ):
        rig = next((obj for obj in scene.objects if obj.type == "ARMATURE"), None)
        writers = {
            ".bvh": lambda temporary: formats.write_bvh(temporary, scene, rig),
            ".glb": lambda temporary: formats.write_glb(temporary, options.camera),
            ".fbx": lambda temporary: formats.write_fbx(temporary, options.camera),
            ".usdc": lambda temporary: formats.write_usd(temporary, options.camera),
            ".blend": lambda temporary: formats.write_blend(temporary, scene),
        }
        _write(path, writers[suffix])


def export_motions(
    motions: list[Motion],
    body: Body,
    path: str | Path | Sequence[str | Path],
    footage: str | Path | None = None,
    build_options: BuildOptions | None = None,
    export_options: ExportOptions | None = None,
    progress: Progress | None = None,
) -> tuple[list[Path], list[str]]:
    """Build the motions in a scene of their own, write one file or several, and leave the session as it was.

    The scene takes the motion's frame rate and the footage's resolution.

    :return: the files written, and the warnings of the build.
    """
    paths = [path] if isinstance(path, str | Path) else list(path)
    for each in paths:
        check_output(each)
    written: list[Path] = []
    warnings: list[str] = []
    scene_paths = [p for p in paths if Path(p).suffix.lower() != ".npz"]
    for each in (p for p in paths if p not in scene_paths):
        written += export(each, motions=motions)
    if not scene_paths:
        return written, warnings
    build_options = build_options or replace(NEW_SCENE, name=Path(scene_paths[0]).stem)
    with temporary_scene("Capturing"):
        result = build_scene(motions, body, footage, build_options, progress)
        try:
            for each in scene_paths:
                written += export(each, [result.collection], motions, export_options)
        finally:
            _remove(result)
    return written, result.warnings


def _remove(result: BuildResult) -> None:
    """Take what a build made out of the file again."""
    objects = list(result.collection.objects)
    data = {obj.data for obj in objects}
    owners = [*objects, *(obj.data.shape_keys for obj in objects if obj.type == "MESH")]
    owners += [obj.data for obj in objects if obj.type == "CAMERA"]
    used = {owner.animation_data.action for owner in owners if owner and owner.animation_data} - {None}
    materials = {m for block in data for m in getattr(block, "materials", ())}
    shown = {footage for block in data for picture in getattr(block, "background_images", ())
             for footage in (picture.clip, picture.image) if footage}  # fmt: skip
    bpy.data.batch_remove([result.collection, *objects, *data, *used, *materials])
    bpy.data.batch_remove([footage for footage in shown if footage.users == 0])
    remove_if_unused()


def _write(path: Path, writer) -> None:
    """Run ``writer(temporary path)`` and move its file into place; on failure nothing is left."""
    try:
        with atomic_path(path) as temporary:
            temporary.unlink()  # Blender's writers differ in what they do with an existing file
            with formats.quiet():
                writer(temporary)
            if not temporary.is_file():
                raise OutputError(f"cannot write {path}: Blender wrote nothing")
    except (RuntimeError, OSError) as error:
        raise OutputError(f"cannot write {path}: {_reason(error)}") from error


def _reason(error: RuntimeError | OSError) -> str:
    """One sentence, and what to do. Of an exporter that fails Blender hands on the whole traceback, and its place."""
    if isinstance(error, OSError) and error.strerror:
        return reason(error)
    lines = [line for line in str(error).splitlines() if line and not line[0].isspace() and "Location: " not in line]
    last = lines[-1] if lines else type(error).__name__
    said = re.sub(r"^(?:\w*Error: )*(?:\[Errno \d+\] )?", "", last)
    return f"{said}; {'free some space or choose another folder' if '[Errno ' in last else 'try another format'}"
