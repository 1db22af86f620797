# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's own rig to files: one out of a file in the captured body's place, or one that moves in the scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy

from ....solver.body import Body
from ...motion import Motion
from ...retarget.rig_source import RigSource
from ..build import BuildOptions, build_scene
from ..export.export import ExportOptions, export, temporary_scene
from ..export.output_paths import check_output
from .rig_file import rig_bone_map, forgotten, load_rig, with_meshes
from .rig_retarget import RetargetOptions, retarget


def export_on_rig(
    motions: list[Motion],
    body: Body,
    paths: Sequence[Path],
    source: RigSource,
    build_options: BuildOptions,
    root: str = "bone",
    footage: Path | None = None,
    export_options: ExportOptions | None = None,
) -> tuple[list[Path], list[str]]:
    """Put every person's motion on a rig of its own, write one file or several, and leave the session as it was.

    :param root: where the way over the floor is kept, see ``RetargetOptions``.
    :return: the files written, and the warnings.
    :raises InputError, UsageError: the rig cannot be used; see ``load_rig``. :raises OutputError: cannot be written.
    """
    for path in paths:
        check_output(path)
    written: list[Path] = []
    with forgotten(), temporary_scene("Retargeting"):
        result = build_scene(motions, body, footage, build_options)
        warnings = list(result.warnings)
        for number, person in enumerate(result.people, 1):
            rig = load_rig(source, result.collection)
            bones = rig_bone_map(source, rig)
            if number == 1 and any(c <= 0.5 for c in bones.confidence.values()):
                warnings.append(f"the bones of '{rig.name}' were guessed by its rest pose alone; look at the result")
            if len(motions) > 1:
                rig.name = f"{rig.name}_person{number}"
            betas, options = person.motion.betas, RetargetOptions(root=root)
            warnings += retarget(person.armature, body, betas, rig, bones, result.frame_rate, options).warnings
        bpy.data.batch_remove([obj for person in result.people for obj in (person.armature, person.mesh)])
        for path in paths:
            written += export(path, [result.collection], options=export_options)
    return written, warnings


def export_rig(path: Path, rig: bpy.types.Object, options: ExportOptions) -> list[Path]:
    """Write a rig of the scene as it moves there, with the meshes that it moves; returns the files written.

    :raises UsageError: unknown suffix. :raises OutputError: cannot be written.
    """
    collection, parts = bpy.data.collections.new(rig.name), with_meshes(rig, bpy.context.scene.objects)
    try:
        for obj in parts:
            below = obj.children_recursive
            if rig not in below or set(below) <= set(parts):  # what carries other things too would take them along
                collection.objects.link(obj)
        return export(path, [collection], options=options)
    finally:
        bpy.data.collections.remove(collection)
