# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that exports captures."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy.types import Collection, Context, Event, Object, Scene

from ..errors import UsageError
from ..options import Place
from ..output_paths import SUFFIXES, check_output, files_of_people, left_over, person_paths
from ..scene.datablocks import action_of, captures_of, holds
from ..temporary import hold, release
from .captured_person import body_of, motion_of, retargeted_from, stored_person
from .captures import people_of, shown_capture
from .comparison import cameras_of
from .declared_properties import split, with_options
from .file_field import SavingOperator, output_file
from .reporting import refuse, rpt_, tip_

if TYPE_CHECKING:
    from ..notices import Notice
    from ..scene.build import BuildOptions
    from ..scene.export.export import ExportOptions

FORMATS = (
    (
        "FBX",
        "FBX",
        "For Unreal Engine, Unity, Maya and MotionBuilder: armature, mesh and animation",
        0,
    ),
    ("GLB", "glTF", "For the web, Godot and other engines: one .glb file with everything", 1),
    ("BVH", "BVH", "Only the motion of the skeleton, one file per person", 2),
    ("USDC", "USD", "For Omniverse, Houdini and other studio tools", 3),
    (
        "NPZ",
        "NPZ",
        "For research: SMPL-style arrays of the captured motion with its corrections, one file per "
        "person",
        4,
    ),
    (
        "TRC",
        "TRC",
        "For OpenSim and Pose2Sim: markers of the captured motion with its corrections, one file "
        "per person",
        5,
    ),
    (
        "MOT",
        "MOT",
        "For OpenSim: joint angles of the captured motion with its corrections, one file per "
        "person",
        6,
    ),
    (
        "C3D",
        "C3D",
        "For Visual3D, Mokka and other biomechanics: markers of the captured motion with its "
        "corrections, one file per person",
        7,
    ),
    (
        "VRMA",
        "VRMA",
        "For VRM avatars: an animation of the captured motion with its corrections, without the "
        "face, one file per person",
        8,
    ),
)
# Formats that hold the captured motion, not the scene's.
_OF_MOTION = ("NPZ", "TRC", "MOT", "C3D", "VRMA")
_NO_USD = "This Blender was built without USD; use a build from blender.org, or another format"
_SUFFIX = {key: f".{key.lower()}" for key, *_ in FORMATS}
_FORMAT_OF = {suffix: key for key, suffix in _SUFFIX.items()}


@with_options(Place.EXPORT)
class SCOPE_OT_export(SavingOperator):
    """Write captures to a file"""

    bl_idname = "scope.export"
    bl_label = "Export Capture"
    bl_options = {"REGISTER", "PRESET"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.fbx", options={"HIDDEN", "SKIP_SAVE"})
    format: EnumProperty(
        name="Format",
        items=FORMATS,
        default="FBX",
        description="File format",
        options={"HIDDEN", "SKIP_SAVE"},
    )
    which: EnumProperty(
        name="Captures",
        items=(
            (
                "SHOWN",
                "Selected",
                "The capture that is selected in the panel, with all its people",
                3,
            ),
            ("ALL", "All in the Scene", "Every capture of the scene, with all its people", 0),
            ("ACTIVE", "Active", "The capture that the active object belongs to", 1),
            (
                "RIG",
                "My Rig",
                "The rig chosen under Retarget, with its current animation and its meshes",
                2,
            ),
        ),
        default="SHOWN",
        description="What to export",
        # or what was exported last would be written under the selected capture's name
        options={"SKIP_SAVE"},
    )
    shape: EnumProperty(
        name="Shape",
        items=(
            (
                "AUTO",
                "Automatic",
                "Shape keys, or in the mesh for formats whose readers limit shape keys",
                0,
            ),
            ("KEYS", "Shape Keys", "Morph targets whose values are the shape coefficients", 1),
            ("BAKED", "In the Mesh", "For engines that limit morph targets to 0..1", 2),
        ),
        default="AUTO",
        description="How the body's shape is exported",
    )
    camera: BoolProperty(name="Camera", default=False, description="Export the estimated camera")
    separate: BoolProperty(
        name="File per Person", default=False, description="Write a separate file for each person"
    )

    @classmethod
    def description(cls, context: Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the tooltip of the button for the format, and why the format is not available."""
        text = next(text for key, _, text, _ in FORMATS if key == properties.format)
        return tip_(text) if is_available(properties.format) else f"{tip_(text)}. {tip_(_NO_USD)}"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a capture in the scene."""
        if not captures_of(context.scene):
            return refuse(cls, "The scene contains no capture yet")
        return True

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for the file."""
        self.filepath = str(_beside_nobody(_proposed(context, self.suffix())))
        self.filter_glob = f"*{self.suffix()}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def suffix(self) -> str:
        """Return that of the format."""
        return _SUFFIX[self.format]

    def check(self, context: Context) -> bool:
        """Let a suffix that is typed choose the format; complete other names."""
        before = self.format
        self.format = _FORMAT_OF.get(Path(self.filepath).suffix.lower(), before)
        return SavingOperator.check(self, context) or self.format != before

    def draw(self, context: Context) -> None:
        """Draw the options in the sidebar of the file browser."""
        layout = split(self.layout)
        layout.prop(self, "which")
        if self.format == "BVH":
            layout.prop(self, "bvh_unit")
        elif self.format not in _OF_MOTION:
            layout.prop(self, "shape")
            if self.which == "RIG" and self.format in ("FBX", "GLB", "USDC"):
                layout.prop(self, "deform_bones")
            if self.which != "RIG":
                layout.prop(self, "camera")
                layout.prop(self, "separate")

    def work(self, context: Context) -> str:
        """Write the files.

        :raises UsageError: the file has no name or folder, its suffix is that of a format which
            only the command line writes, or there is nothing of what is to be written.
        """
        typed = Path(self.filepath)
        self.format = _FORMAT_OF.get(typed.suffix.lower(), self.format)
        path = output_file(self.filepath, self.suffix())
        if typed.suffix.lower() in set(SUFFIXES).difference(_FORMAT_OF):
            check_output(typed, tuple(_FORMAT_OF))
        _check_available(self.format)
        warnings: list[Notice] = []
        options = self._options(warnings)
        if self.which == "RIG":
            written = self._write_rig(context.scene, path, options)
        else:
            written = write_captures(path, self.format, self._captures(context), options)
        if others := left_over([path], written):
            warnings.append(others)
        message = rpt_(
            "Wrote {files} in {folder}",
            files=", ".join(p.name for p in written),
            folder=written[0].parent,
        )
        return self.report_all(message, warnings)

    def _options(self, warnings: list[Notice]) -> ExportOptions:
        """Return the options of the export, which adds what it warns of to ``warnings``."""
        from ..scene.export.export import ExportOptions

        return ExportOptions(
            camera=self.camera,
            shape=self.shape.lower(),
            separate=self.separate,
            bvh_unit=self.bvh_unit.lower(),
            deform_bones=self.deform_bones and self.which == "RIG",
            warn=warnings.append,
        )

    def _captures(self, context: Context) -> list[Collection]:
        """Return the captures that are to be written.

        :raises UsageError: the active object belongs to none.
        """
        collections = captures_of(context.scene)
        if self.which == "SHOWN":
            return [c for c in collections if c == shown_capture(context.scene)]
        if self.which == "ACTIVE":
            active = context.view_layer.objects.active
            collections = [c for c in collections if active and holds(c, active)]
            if not collections:
                raise UsageError(
                    "the active object belongs to no capture; select one of a capture's objects, "
                    "or append the capture's collection rather than its objects"
                )
        return collections

    def _write_rig(self, scene: Scene, path: Path, options: ExportOptions) -> list[Path]:
        """Write the chosen rig; return the files.

        :raises UsageError: no rig is chosen, or the format has none.
        """
        from ..notices import notice
        from ..scene.rig_action import is_outdated
        from ..scene.rig_file import export_rig

        rig = scene.scope_retarget.rig
        if self.format in _OF_MOTION:
            raise UsageError(
                f"a file of the format {self.format} contains the captured motion, not a rig; "
                "choose another format"
            )
        if rig is None:
            raise UsageError(
                "no rig is chosen under Retarget; choose a rig there and press Retarget first"
            )
        take = _take_of(rig, captures_of(scene))
        written = export_rig(path, rig, replace(options, take=take))
        person = retargeted_from(scene, rig)
        action = action_of(rig)
        if person is not None and action is not None and is_outdated(action, person):
            options.warn(notice("outdated_rig", rig=rig.name, person=person.name))
        return written


def write_captures(
    path: Path, kind: str, captures: list[Collection], options: ExportOptions | None = None
) -> list[Path]:
    """Write captures in a format, a key of ``FORMATS``; return the files.

    :raises UsageError: this build of Blender cannot write the format, or nobody is left of the
        captures.
    :raises OutputError: a file cannot be written.
    """
    from ..scene.export.export import export

    _check_available(kind)
    if kind in _OF_MOTION:
        return _write_motions(path, captures)
    return export(path, captures, options=options)


def write_at_own_rate(
    path: Path, kind: str, capture: Collection, options: BuildOptions
) -> list[Path]:
    """Write a capture that nobody has edited as if it were built in a scene of the motion's frame
    rate; return the files.

    :param kind: as of `write_captures`, whose errors are raised.
    :param options: with which it was built.
    """
    from ..scene.build import names_free
    from ..scene.export.export import ExportOptions, export_motions

    if kind in _OF_MOTION:
        return write_captures(path, kind, [capture])
    _check_available(kind)
    people = people_of(capture)
    options = replace(options, name=capture.name, frame_rate="set")
    motions = [motion_of(person) for person in people]
    named = ExportOptions(take=capture.name)
    with names_free(capture):
        written, _ = export_motions(motions, body_of(people[0]), path, None, options, named)
    return written


@contextmanager
def unused_path(folder: Path, capture: Collection, kind: str) -> Iterator[Path]:
    """Give a path for a capture's file, with the capture's name, and a number where files of that
    name exist, or another Blender is going to write them.

    :param kind: a key of ``FORMATS``.
    """
    name = _file_name(capture)
    held: list[Path] = []
    for number in itertools.count(1):
        stem = name if number == 1 else f"{name}_{number}"
        path = folder / f"{stem}{_SUFFIX[kind]}"
        if _is_taken(path):
            continue
        lock = folder / f".{path.name}.lock"
        try:
            if not hold(lock):
                continue
            held.append(lock)
        except OSError:  # there are no locks; what else is wrong, writing says
            break
        if not _is_taken(path):  # by whoever held the lock until now
            break
        release(held.pop())
    try:
        yield path
    finally:
        for lock in held:
            release(lock)


def _beside_nobody(path: Path) -> Path:
    """Return a path, with a number where there are files of several people of its name: the file
    browser asks before it replaces a file of the name itself, but not before those.
    """
    for number in itertools.count(1):
        other = path if number == 1 else path.with_stem(f"{path.stem}_{number}")
        if files_of_people(other) in ([], [other]):
            break
    return other


def _is_taken(path: Path) -> bool:
    """Return whether there is a result of this name, of one person or several."""
    # By their names, too: a disk may take capital and small letters for the same.
    names = [path, *person_paths(path, 2, separate=True)]
    return any(map(os.path.lexists, names)) or bool(files_of_people(path))


def _write_motions(path: Path, collections: list[Collection]) -> list[Path]:
    """Write the captured motions themselves; return the files.

    :raises UsageError: nobody is left of the captures.
    """
    from ..scene.export.without_scene import write_without_scene

    people = [person for capture in collections for person in people_of(capture)]
    if not people:
        raise UsageError(
            f"cannot write {path.name}: the capture's armature was removed; undo that or "
            "capture again"
        )
    motions = [motion_of(obj) for obj in people]
    bodies = [body_of(obj) for obj in people]
    return write_without_scene(check_output(path), motions, bodies)


class SCOPE_OT_save_calibration(SavingOperator):
    """Save the lenses and places of the cameras, for further takes of the same cameras"""

    bl_idname = "scope.save_calibration"
    bl_label = "Save Calibration"

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a capture with several cameras."""
        return len(cameras_of(context.scene)) > 1

    def suffix(self) -> str:
        """Return that of a calibration."""
        return ".toml"

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for the file."""
        self.filepath = str(_proposed(context, self.suffix()))
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def work(self, context: Context) -> str:
        """Write the file.

        :raises UsageError: the file has no name or folder, or the captured person was deleted.
        """
        from ..capture.camera.calibration import write_calibration

        path = check_output(output_file(self.filepath, self.suffix()), (self.suffix(),))
        people = people_of(shown_capture(context.scene))
        if not people:
            raise UsageError("the captured person was deleted; undo that or capture again")
        write_calibration(path, motion_of(people[0]))
        return rpt_("Wrote {files} in {folder}", files=path.name, folder=path.parent)


def _proposed(context: Context, suffix: str) -> Path:
    """Return the file that is proposed for the shown capture."""
    shown = shown_capture(context.scene)
    name = _file_name(shown) if shown else "capture"
    folder = Path(bpy.data.filepath).parent if bpy.data.filepath else Path.home()
    return folder / f"{name}{suffix}"


def _file_name(capture: Collection) -> str:
    """Return a capture's name without what a file's name cannot hold."""
    return re.sub(r'[\\/:*?"<>|]', "_", capture.name)


def is_available(kind: str) -> bool:
    """Return whether this build of Blender can write a format, a key of ``FORMATS``."""
    return kind != "USDC" or "usd_export" in dir(bpy.ops.wm)


def _check_available(kind: str) -> None:
    """Check that this build of Blender can write a format.

    :raises UsageError: it cannot.
    """
    if not is_available(kind):
        raise UsageError(_NO_USD[0].lower() + _NO_USD[1:])


def _take_of(rig: Object, collections: list[Collection]) -> str:
    """Return the name of the capture whose motion a rig has; empty if it is unknown."""
    person = stored_person(rig)
    return next((c.name for c in collections if person and holds(c, person)), "")


CLASSES = (SCOPE_OT_export, SCOPE_OT_save_calibration)
