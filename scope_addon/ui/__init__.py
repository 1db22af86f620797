# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's side: properties, preferences, panel, operators, the modal job. Each module lists its ``CLASSES``.

Only bpy and the standard library are loaded when the extension is enabled; the solver's libraries come with the first
use, so that they cost nothing when Blender starts.
"""

from __future__ import annotations

import bpy

from . import command, drop, export_operators, preferences
from .capture import capture_operators, capture_panel, capture_properties
from .edit import edit_operators, edit_panel
from .retarget import retarget_operators, retarget_panel, retarget_properties
from .view import view_after_undo, view_operators

_MODULES = (
    *(capture_properties, preferences, capture_operators, export_operators, view_operators, edit_operators, drop),
    *(retarget_properties, retarget_operators),
    *(capture_panel, edit_panel, retarget_panel),
)


def register() -> None:
    """Add everything to Blender."""
    done = []
    try:
        for module in _MODULES:
            for cls in module.CLASSES:
                bpy.utils.register_class(cls)
                done.append(cls)
        capture_properties.attach()
        retarget_properties.attach()
        command.register()
        view_after_undo.attach()
    except Exception:
        for cls in reversed(done):
            bpy.utils.unregister_class(cls)
        raise


def unregister() -> None:
    """Take everything out of Blender again, a running capture included."""
    capture_operators.end_capture()
    view_after_undo.detach()
    command.unregister()
    retarget_properties.detach()
    capture_properties.detach()
    for module in reversed(_MODULES):
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)
