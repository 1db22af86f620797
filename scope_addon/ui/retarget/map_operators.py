# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators on the bone map and on the expression map share: their poll, their files, and
editing their lists.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import BoolProperty, StringProperty

from ...scene.datablocks import is_in_layer
from ..reporting import ReportingOperator, rpt_, tip_


def is_in_view_layer(
    cls: type[bpy.types.Operator], context: bpy.types.Context, chosen: bpy.types.Object
) -> bool:
    """Return whether an object that was chosen can be animated here: one that is deleted stays
    chosen.
    """
    if is_in_layer(context.view_layer, chosen):
        return True
    cls.poll_message_set(
        tip_(
            "'{rig}' is not in the scene's view layer: add it to the scene, or enable its "
            "collection in the Outliner",
            rig=chosen.name,
        )
    )
    return False


class MapFileOperator(ReportingOperator):
    """An operator on the file of a map, which the file browser asks for. Not registered."""

    filepath: StringProperty(subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SaveMapOperator(MapFileOperator):
    """Writes a map; a subclass has ``save``, and the file's usual name. Not registered."""

    bl_options = {"REGISTER"}  # it changes a file only, so there is nothing to undo

    # the file browser asks before it overwrites
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    def check(self, context: bpy.types.Context) -> bool:
        """Add the suffix while the name is typed, so that the file browser sees which file would be
        overwritten.
        """
        path: str = bpy.path.ensure_ext(self.filepath, ".json")
        changed = path != self.filepath
        self.filepath = path
        return bool(changed)

    def work(self, context: bpy.types.Context) -> str:
        """Write the file.

        :raises UsageError: the file has no name, or is beside a .blend file that was never saved.
        """
        from ..files.output_file import output_file

        path = str(output_file(self.filepath, ".json"))
        self.save(context.scene.scope_retarget, path)
        return rpt_("Saved {file}", file=path)

    if TYPE_CHECKING:  # implemented by each operator

        def save(self, settings: bpy.types.PropertyGroup, path: str) -> None:
            """Write the map of the settings to a path.

            :raises InputError: it could not be loaded again.
            """


class LoadMapOperator(MapFileOperator):
    """Reads a map; a subclass has ``load``. Not registered."""

    def work(self, context: bpy.types.Context) -> str:
        """Fill the list."""
        self.load(context.scene.scope_retarget, bpy.path.abspath(self.filepath))
        return rpt_("Loaded {file}", file=self.filepath)

    if TYPE_CHECKING:  # implemented by each operator

        def load(self, settings: bpy.types.PropertyGroup, path: str) -> None:
            """Fill the list of the settings from a path."""


def edit_list(action: str, pairs: Any, active: int) -> int:
    """Add an entry to a list's collection, or remove the active one; return which one is active
    then.

    :param action: ``ADD`` or ``REMOVE``.
    """
    if action == "ADD":
        pairs.add()
        return len(pairs) - 1
    if len(pairs):
        pairs.remove(active)
        return max(0, min(active, len(pairs) - 1))
    return active
