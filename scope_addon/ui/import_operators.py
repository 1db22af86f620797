# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that imports motion files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty
from bpy.types import Context, Event, Scene

from ..capture_report import Report
from ..errors import UsageError
from ..footage import FOOTAGE_SUFFIXES
from ..options import option
from ..scene.datablocks import captures_of
from .captures import hide_others
from .declared_properties import blender_property
from .file_field import selected_paths
from .preferences import body_file
from .reporting import ReportingOperator, iface_, rpt_, sentence
from .view_operators import show_new_capture

if TYPE_CHECKING:
    from ..notices import Notice
    from ..retarget.import_motions import Imported
    from ..scene.build import BuildOptions


class SCOPE_OT_import_motion(ReportingOperator):
    """Import captured motions of Scope"""

    bl_description = (
        "Import captured motions of Scope, of tools that use SMPL's joints, and of BVH files, as "
        "animated bodies"
    )
    bl_idname = "scope.import_motion"
    bl_label = "Import Motion"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE", "HIDDEN"})
    files: CollectionProperty(
        type=bpy.types.OperatorFileListElement, options={"SKIP_SAVE", "HIDDEN"}
    )
    filter_glob: StringProperty(
        default="*.npz;*.npy;*.pkl;*.pt;*.bvh", options={"HIDDEN", "SKIP_SAVE"}
    )
    up_axis: blender_property(option("up_axis"), {})
    motion_rate: blender_property(option("motion_rate"), {})
    body: blender_property(option("body"), {})
    set_rate: BoolProperty(
        name="Set Scene Frame Rate",
        default=False,
        description="Set the scene's frame rate to the motion's; otherwise keys may be between "
        "frames",
    )

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Use dropped files, or ask for some."""
        if self.filepath or self.directory:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def work(self, context: Context) -> str:
        """Read all files, then build them.

        :raises UsageError: no file was chosen.
        """
        from ..retarget.import_motions import import_motions
        from ..scene.transaction import all_or_nothing

        body = self._body(context)
        paths = self._paths()
        found = [
            (path, imported)
            for path in paths
            for imported in import_motions(path, body, self.up_axis.lower(), self.motion_rate)
        ]
        before = captures_of(context.scene)
        notes: list[Notice] = []
        with all_or_nothing(context.scene):
            for path, imported in found:
                notes += _build(context.scene, path, imported, self._build_options(context.scene))
        new = [each for each in captures_of(context.scene) if each not in before]
        hide_others(context.scene, new)
        show_new_capture(context, context.scene)
        texts = dict.fromkeys(note.text(iface_) for note in notes)
        if texts:
            self.report({"WARNING"}, sentence("; ".join(texts)))
            return ""
        return rpt_("Imported {files}", files=", ".join(path.name for path in paths))

    def _paths(self) -> list[Path]:
        """Return the chosen files.

        :raises UsageError: there are none.
        """
        paths = selected_paths(self)
        if os.path.isdir(paths[0]):
            raise UsageError("no motion file is chosen; choose an .npz file")
        return paths

    def _body(self, context: Context) -> str:
        """Return the name or file of the body.

        :raises UsageError: no file is chosen for the body.
        """
        if self.body != "FILE":
            return str(self.body).lower()
        path = body_file(context.scene)
        if not path:
            raise UsageError(
                "no body file is chosen; choose one under Options or in the preferences"
            )
        return path

    def _build_options(self, scene: Scene) -> BuildOptions:
        """Return the scene's options, but change the frame rate only on request."""
        from .capture_job import build_options

        options = build_options(scene)
        rate = "resample" if scene.scope.frame_rate == "RESAMPLE" else "keep"
        return replace(options, frame_rate="set" if self.set_rate else rate)


def _build(scene: Scene, path: Path, imported: Imported, options: BuildOptions) -> Sequence[Notice]:
    """Build one motion, store it and its result with the scene, and return what is to be known."""
    from ..scene.build import build_scene
    from ..scene.packed_motion import pack_motion
    from .capture_job import show_build

    motion = imported.motion
    footage = None
    view_footage: list[Path | None] = []
    seen = bool(motion.image_size.all())  # by a camera, as motions of other tools are not
    if seen:
        footage = _footage_beside(path, motion.source)
        sources = motion.views["view_sources"].tolist() if motion.views else []
        # Videos of the same name, from several folders, cannot lie beside the file together.
        is_unique = len({motion.source, *sources}) == 1 + len(sources)
        view_footage = [_footage_beside(path, source) if is_unique else None for source in sources]
    options = replace(
        options,
        name=path.stem,
        with_camera=options.with_camera and seen,
        view_footage=view_footage,
    )
    result = build_scene([motion], imported.body, footage, options)
    pack_motion(result.people[0].armature, motion.to_bytes())
    return show_build(
        scene,
        result,
        str(footage or ""),
        Report(warnings=imported.notes),
        keeps_rate=options.frame_rate == "keep",
        what="motion",
    )


def _footage_beside(path: Path, source: str) -> Path | None:
    """Return the footage that lies beside a motion file; None if it does not."""
    beside = path.parent / Path(source).name
    # Path.is_file raises where the name, which the motion's file says, is too long.
    is_footage = beside.suffix.lower() in FOOTAGE_SUFFIXES and os.path.isfile(beside)
    return beside if is_footage else None


CLASSES = (SCOPE_OT_import_motion,)
