# SPDX-License-Identifier: GPL-3.0-or-later
"""Exporting the user's own rig: from a rig file, in place of the captured body, or from the
scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import bpy

from ...solver.body import Body
from ..errors import UsageError
from ..motion import Motion
from ..notices import Notice, notice
from ..output_paths import check_output
from ..retarget.expression_map import ExpressionMap
from ..retarget.rig_source import RigSource
from .build import BuildOptions, build_scene
from .datablocks import action_of, temporary_datablocks
from .export.export import ExportOptions, export
from .export.export_states import temporary_scene
from .face_retarget import (
    captured_expressions,
    driven_keys,
    faces_of,
    guess_face_bones,
    only_bones_move,
    retarget_expressions,
)
from .rig_file import load_rig, rig_bone_map, with_meshes
from .rig_retarget import RetargetOptions, common_travel, retarget


def export_on_rig(
    motions: list[Motion],
    body: Body,
    paths: Sequence[Path],
    source: RigSource,
    build_options: BuildOptions,
    footage: Path | None = None,
    *,
    root: str = "bone",
    export_options: ExportOptions | None = None,
) -> tuple[list[Path], list[Notice]]:
    """Retarget every person's motion to a copy of the rig, write one or more files, and leave the
    session as it was.

    :param root: where the root motion goes, see ``RetargetOptions``.
    :return: the files written, and the warnings.
    :raises InputError: when the rig cannot be used; see ``load_rig``.
    :raises UsageError: when the choice of armature is ambiguous, a suffix unknown, or the
        expression map is not for the rig's meshes.
    :raises OutputError: when a file cannot be written.
    """
    for path in paths:
        check_output(path)
    written: list[Path] = []
    with temporary_datablocks(), temporary_scene("Retargeting"):
        result = build_scene(motions, body, footage, build_options)
        warnings = list(result.warnings)
        travel: float | None = None  # of one person: their own
        for number, person in enumerate(result.people, 1):
            rig = load_rig(source, result.collection)
            bones = rig_bone_map(source, rig)
            if len(motions) > 1:
                if travel is None:
                    travel = common_travel(
                        body, [each.motion.betas for each in result.people], rig, bones
                    )
                rig.name = f"{rig.name}_person{number}"
            betas = person.motion.betas
            rate = result.frame_rate
            faces = faces_of(with_meshes(rig, bpy.context.scene.objects))
            retargeting = RetargetOptions(
                root=root, face=_face_of_bones(rig, faces, source), travel=travel
            )
            warnings += retarget(
                person.armature, body, betas, rig, bones, rate, retargeting
            ).warnings
            warnings += _retarget_face(
                person.armature, faces, source, bones_move_it=retargeting.face is not None
            )
        bpy.data.batch_remove(
            [obj for person in result.people for obj in (person.armature, person.mesh)]
        )
        options = replace(export_options or ExportOptions(), warn=warnings.append)
        for path in paths:
            written += export(path, [result.collection], options=options)
    return written, warnings


def _face_of_bones(
    rig: bpy.types.Object, faces: Sequence[bpy.types.Object], source: RigSource
) -> ExpressionMap | None:
    """Return the expression map if bones move the rig's face; a guess is made only where no shape
    keys do.
    """
    if source.expression_map is not None:
        return source.expression_map if source.expression_map.controls else None
    return guess_face_bones(rig) if only_bones_move(rig, faces) else None


def _retarget_face(
    armature: bpy.types.Object,
    faces: Sequence[bpy.types.Object],
    source: RigSource,
    *,
    bones_move_it: bool,
) -> list[Notice]:
    """Retarget the captured expressions, if there are any, to the rig's meshes; return warnings.

    :param bones_move_it: whether bones show the expressions, so that there may be no shape keys.
    :raises UsageError: when an expression map was given, and no mesh has any of its shape keys.
    """
    captured = captured_expressions(armature)
    given = source.expression_map
    if captured is None or (bones_move_it and not (given and given.keys)):
        return []
    try:
        retarget_expressions(captured, faces, given, armature.name)
    except UsageError as error:
        if given is not None:
            raise
        return [notice("face_not_retargeted", reason=str(error))]
    return driven_keys(faces, given)


def export_rig(path: Path, rig: bpy.types.Object, options: ExportOptions) -> list[Path]:
    """Write an animated rig of the scene with the meshes that it deforms; return the files written.

    Its size is the one that it has in the unit of the scene.

    :param options: without a ``take``, the animation is named after the rig's action.
    :raises UsageError: when the suffix is unknown.
    :raises OutputError: when a file cannot be written.
    """
    action = action_of(rig)
    unit = bpy.context.scene.unit_settings.scale_length
    options = replace(
        options, take=options.take or (action.name if action else rig.name), unit=unit
    )
    collection = bpy.data.collections.new(rig.name)
    parts = with_meshes(rig, bpy.context.scene.objects)
    try:
        for obj in parts:
            below = obj.children_recursive
            # a parent of other objects would export them as well
            if rig not in below or set(below) <= set(parts):
                collection.objects.link(obj)
        return export(path, [collection], options=options)
    finally:
        bpy.data.collections.remove(collection)
