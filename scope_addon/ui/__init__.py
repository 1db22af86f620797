# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in Blender: properties, preferences, panels, operators, the modal job. Modules list
their ``CLASSES``.

Only bpy and the standard library are loaded when the extension is enabled. The solver's libraries
are loaded at the first use, so that Blender starts as fast as without them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

import bpy

from . import (
    action_operators,
    command,
    correction_operators,
    correction_panel,
    edit_panel,
    export_operators,
    file_field,
    handlers,
    import_operators,
    keymap,
    live_operators,
    live_panel,
    live_properties,
    menus,
    pin_tool,
    preferences,
    retarget_operators,
    retarget_panel,
    translations,
    upright_operators,
    view_operators,
    warm_up,
)
from .capture import capture_operators, capture_panel, captures, frame_rate_operators

# Panels come last: they are drawn in this order, and those within another after it.
_MODULES = (
    preferences,
    capture_operators,
    export_operators,
    import_operators,
    view_operators,
    file_field,
    menus,
    action_operators,
    frame_rate_operators,
    correction_operators,
    pin_tool,
    upright_operators,
    retarget_operators,
    live_properties,
    live_operators,
    captures,
    capture_panel,
    live_panel,
    edit_panel,
    correction_panel,
    retarget_panel,
)


def register() -> None:
    """Register everything with Blender; if that fails, nothing stays registered."""
    with ExitStack() as undo:
        for module in _MODULES:
            for cls in module.CLASSES:
                bpy.utils.register_class(cls)
                undo.callback(bpy.utils.unregister_class, cls)
        for attach, detach in _attachments():
            attach()
            undo.callback(detach)
        undo.pop_all()


def unregister() -> None:
    """Stop a running capture, live or not, and unregister everything."""
    capture_operators.end_capture()
    live_operators.end_live()
    pin_tool.detach()
    for _, detach in reversed(_attachments()):
        detach()
    for module in reversed(_MODULES):
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)


def _attachments() -> list[tuple[Callable[[], None], Callable[[], None]]]:
    """Return what attaches things other than classes to Blender, and what detaches them."""
    return [
        (capture_panel.attach, capture_panel.detach),
        (retarget_panel.attach, retarget_panel.detach),
        (live_properties.attach, live_properties.detach),
        (command.register, command.unregister),
        (correction_panel.attach, correction_panel.detach),
        (handlers.attach, handlers.detach),
        (import_operators.attach, import_operators.detach),
        (menus.attach, menus.detach),
        (keymap.attach, keymap.detach),
        (warm_up.attach, warm_up.detach),
        (translations.register, translations.unregister),
    ]
