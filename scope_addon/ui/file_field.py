# SPDX-License-Identifier: GPL-3.0-or-later
"""Files in the interface: fields for them, file browsers that show at first only what fits, and
footage and motion files that are dropped from the system's file browser into the 3D viewport.

Blender draws a folder beside every path, which opens a browser that shows all files. A field is
therefore drawn as a text of the same value, with a button of our own. Every browser's filter can be
switched off in its header.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, StringProperty
from bpy.types import Context, Event, Operator, PropertyGroup, UILayout

from ..errors import UsageError
from ..footage import FOOTAGE_SUFFIXES, VIDEO_SUFFIXES, display_text
from .reporting import ReportingOperator, rpt_

_ASSETS = Path(__file__).resolve().parents[2] / "assets"
_TEXT = "_text"  # ends the name of the text of a path
_VIDEOS = ";".join(f"*{suffix}" for suffix in VIDEO_SUFFIXES)
FOOTAGE = ";".join(f"*{suffix}" for suffix in FOOTAGE_SUFFIXES)
_FILTERS = {  # by the name of the setting
    "file": _VIDEOS,
    "body_file": "*.npz;*.pkl;*.pickle",
    "calibration_file": "*.json;*.toml;*.yml;*.yaml;*.pickle;*.pkl",
    "detector_file": "*.onnx",
    "keypoints_file": "*.onnx",
}


class FootageBrowser:
    """Properties of an operator that asks for footage: the browser shows folders, pictures and
    videos of any suffix.
    """

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default=FOOTAGE, options={"HIDDEN", "SKIP_SAVE"})
    # what Blender knows as such, too
    filter_movie: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})

    def ask(self, context: Context) -> set[str]:
        """Open the browser, in the folder of the present footage."""
        self.filepath = present(context.scene.scope.footage)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SeveralFootageBrowser(FootageBrowser):
    """Properties of an operator that asks for one or several files of footage."""

    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE", "HIDDEN"})
    files: CollectionProperty(
        type=bpy.types.OperatorFileListElement, options={"SKIP_SAVE", "HIDDEN"}
    )

    if TYPE_CHECKING:  # implemented by each operator

        def execute(self, context: Context) -> set[str]:
            """Use the chosen files."""

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Use a dropped file, or ask for some."""
        return self.execute(context) if self.filepath else self.ask(context)


class SavingOperator(ReportingOperator):
    """An operator that writes a file, for which the file browser asks. Not registered."""

    bl_options = {"REGISTER"}  # it changes a file only, so there is nothing to undo

    # the file browser asks before it overwrites
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    if TYPE_CHECKING:  # of each operator
        filepath: str

        def suffix(self) -> str:
            """Return the suffix of the file, with its dot."""

    def check(self, context: Context) -> bool:
        """Add the suffix while the name is typed, so that the file browser sees which file would be
        overwritten.
        """
        path: str = bpy.path.ensure_ext(self.filepath, self.suffix())
        changed = path != self.filepath
        self.filepath = path
        return bool(changed)


def selected_paths(operator: Any) -> list[Path]:
    """Return the paths that are selected in the browser of an operator with ``directory``,
    ``files`` and ``filepath``; the current folder if there is none.

    A script may give ``filepath`` and no directory.
    """
    names = [each.name for each in operator.files if each.name and operator.directory]
    chosen = [os.path.join(operator.directory, name) for name in names] or [operator.filepath]
    return [Path(bpy.path.abspath(path)) for path in chosen]


def chosen_files(operator: Any) -> list[str]:
    """Return the paths of the files that are chosen in the browser of an operator, a
    `SeveralFootageBrowser`; none, and an error of the operator, if one does not exist.
    """
    paths = selected_paths(operator)
    for path in paths:
        if not os.path.isfile(path):  # Path.is_file raises where a name is too long
            said = rpt_("{path} is not a file; choose a video or image", path=path)
            operator.report({"ERROR"}, said)
            return []
    return [str(path) for path in paths]


def present(path: str) -> str:
    """Return a setting's file for the browser to begin with; empty where Blender's usual folder is
    better.

    It is if the file is gone, and if it is the sample clip, beside which are only the extension's
    own files.
    """
    file = Path(bpy.path.abspath(path))
    # Path.is_file raises where a name is too long, or a folder cannot be read.
    return str(file) if path and os.path.isfile(file) and _ASSETS not in file.parents else ""


def stored_path(context: Context, path: str) -> str:
    """Return how a setting of the scene stores a chosen file: relative to the .blend file if the
    user prefers that.

    Blender's own button beside a path does the same.
    """
    if not bpy.data.filepath or not context.preferences.filepaths.use_relative_paths:
        return path
    try:
        return str(bpy.path.relpath(path))
    except ValueError:  # on another drive of Windows
        return path


def path_text(
    path: str, typed: Callable[[Any], None] = lambda _settings: None, **keywords: Any
) -> Any:
    """Return the text property of a path property, which stores nothing itself.

    :param path: name of the path property in the same group. That of the text is the same with
        ``_text`` after it.
    :param typed: called with the group after another path was typed.
    :param keywords: of the property.
    """

    def get(settings: PropertyGroup) -> str:
        return display_text(getattr(settings, path))

    def put(settings: PropertyGroup, text: str) -> None:
        # nothing was typed: of a name that is not UTF-8, the text is not the name
        if text == get(settings):
            return
        is_quoted = len(text) > 1 and text[0] == text[-1] == '"'  # as Windows copies a path
        setattr(settings, path, text[1:-1] if is_quoted else text)
        typed(settings)

    return StringProperty(get=get, set=put, **keywords)


def text_name(path: str) -> str:
    """Return the name of the text property of a path property."""
    return path + _TEXT


def draw_file(layout: UILayout, settings: Any, path: str, **keywords: Any) -> UILayout:
    """Draw the field of a path and the button that chooses a file; return their row.

    :param path: name of the path property in ``settings``, which has a ``path_text`` of it.
    :param keywords: of ``UILayout.prop``.
    """
    row = layout.row(align=True)
    row.prop(settings, text_name(path), **keywords)
    if path == "footage":
        row.operator("scope.choose_footage", text="", icon="FILEBROWSER")
        return row
    button = row.operator("scope.choose_file", text="", icon="FILEBROWSER")
    is_preferences = isinstance(settings, bpy.types.AddonPreferences)
    button.owner = "preferences" if is_preferences else settings.path_from_id()
    button.setting = path
    return row


class SCOPE_OT_choose_file(Operator):
    """Choose the file in the file browser"""

    bl_idname = "scope.choose_file"
    bl_label = "Choose File"
    bl_options = {"UNDO", "INTERNAL"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    filter_movie: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})  # what Blender knows as such, too
    filter_folder: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    # has the setting: scope, scope_live, preferences
    owner: StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    setting: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    def invoke(self, context: Context, event: Event) -> set[str]:
        """Ask for the file, in the folder of the present one."""
        settings = self._settings(context)
        if settings is None:
            return {"CANCELLED"}
        self.filepath = present(getattr(settings, self.setting))
        self.filter_glob = _FILTERS[self.setting]
        self.filter_movie = self.filter_glob == _VIDEOS
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Context) -> set[str]:
        """Set the setting to the file."""
        settings = self._settings(context)
        if settings is None:
            return {"CANCELLED"}
        if self.owner == "preferences":
            setattr(settings, self.setting, self.filepath)
            context.preferences.is_dirty = True
        else:
            setattr(settings, self.setting, stored_path(context, self.filepath))
        return {"FINISHED"}

    def _settings(self, context: Context) -> Any:
        """Return what has the setting; None if nothing has."""
        addon = context.preferences.addons.get(__package__.rpartition(".scope_addon")[0])
        of_addon = addon.preferences if addon else None
        owner = (
            of_addon if self.owner == "preferences" else getattr(context.scene, self.owner, None)
        )
        return owner if self.setting in _FILTERS and hasattr(owner, self.setting) else None


class _ViewportFileHandler(bpy.types.FileHandler):
    """Takes files that are dropped into a 3D viewport. Not registered."""

    @classmethod
    def poll_drop(cls, context: Context) -> bool:
        """Accept files over a 3D viewport, where the panel is."""
        return bool(context.area) and context.area.type == "VIEW_3D"


class SCOPE_FH_footage(_ViewportFileHandler):
    """Make a dropped video or image the scene's footage."""

    bl_idname = "SCOPE_FH_footage"
    bl_label = "Capture with Scope"
    bl_import_operator = "scope.choose_footage"
    bl_file_extensions = ";".join(FOOTAGE_SUFFIXES)


class SCOPE_FH_motion(_ViewportFileHandler):
    """Import dropped motion files."""

    bl_idname = "SCOPE_FH_motion"
    bl_label = "Import Motion with Scope"
    bl_import_operator = "scope.import_motion"
    bl_file_extensions = ".npz"


CLASSES = (
    SCOPE_OT_choose_file,
    SCOPE_FH_footage,
    SCOPE_FH_motion,
)


def output_file(typed: str, suffix: str) -> Path:
    """Return the path of a file to write, with its suffix.

    :param typed: as the user has entered it; ``//`` at its beginning is the folder of the .blend
        file.
    :param suffix: with its dot.
    :raises UsageError: the file has no name, or is beside a .blend file that was never saved.
    """
    if not bpy.path.basename(typed).removesuffix(suffix):
        raise UsageError("the file has no name; enter one")
    if typed.startswith("//") and not bpy.data.filepath:
        raise UsageError(
            f"'{typed}' is relative to this .blend file, which was never saved; save it, or choose "
            "a folder"
        )
    return Path(bpy.path.ensure_ext(bpy.path.abspath(typed), suffix))
