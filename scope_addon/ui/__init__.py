# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in Blender: properties, preferences, panels, operators, the modal job. Modules list
their ``CLASSES``.

Only bpy and the standard library are loaded when the extension is enabled. The solver's libraries
are loaded at the first use, so that Blender starts as fast as without them.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import ExitStack

import bpy
from bpy.app.handlers import persistent

from ..errors import keep_solver_hints_from_users
from . import (
    action_operators,
    capture_operators,
    capture_panel,
    captures,
    comparison,
    correction_operators,
    edit_panel,
    export_operators,
    file_field,
    frame_rate_operators,
    import_operators,
    live_operators,
    live_properties,
    menus,
    person_picker,
    pin_tool,
    preferences,
    retarget_operators,
    retarget_panel,
    translations,
    upright_operators,
    view_operators,
    warm_up,
)

_command: object | None = None
# Modules that attach things other than classes to Blender.
_ATTACHING = (
    capture_panel,
    retarget_panel,
    live_properties,
    comparison,
    menus,
    preferences,
    warm_up,
    translations,
)
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
    person_picker,
    upright_operators,
    retarget_operators,
    live_properties,
    captures,
    capture_panel,
    live_operators,
    edit_panel,
    retarget_panel,
)


def register() -> None:
    """Register everything with Blender; if that fails, nothing stays registered."""
    keep_solver_hints_from_users()
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


def run_command(argv: list[str]) -> int:
    """Run the shell's command line inside Blender, with the arguments after ``blender --background
    --command scope``; return the exit status. Blender calls this.
    """
    os.environ.setdefault("NUMBA_CACHE_DIR", str(preferences.cache().kernels))
    from ..cli import main

    # A batch starts one Blender process per clip, because exports need Blender.
    return int(main(argv, program=(bpy.app.binary_path, "--background", "--command", "scope")))


def _add_command() -> None:
    global _command
    _command = bpy.utils.register_cli_command("scope", run_command)


def _remove_command() -> None:
    global _command
    if _command is not None:
        bpy.utils.unregister_cli_command(_command)
    _command = None


@persistent
def _unlink_rings(*_: object) -> None:
    """Take the rings that bones of an appended armature show out of the scene, where Blender puts
    them.
    """
    from ..scene.character.armature import unlink_rings

    unlink_rings()


def _add_ring_handler() -> None:
    # Before 4.3, Blender says nothing of appended files, and the rings stay.
    if hasattr(bpy.app.handlers, "blend_import_post"):
        bpy.app.handlers.blend_import_post.append(_unlink_rings)


def _remove_ring_handler() -> None:
    if hasattr(bpy.app.handlers, "blend_import_post"):
        bpy.app.handlers.blend_import_post.remove(_unlink_rings)


def _attachments() -> list[tuple[Callable[[], None], Callable[[], None]]]:
    """Return what attaches things other than classes to Blender, and what detaches them."""
    return [
        (_add_command, _remove_command),
        (_add_ring_handler, _remove_ring_handler),
        *((module.attach, module.detach) for module in _ATTACHING),
    ]
