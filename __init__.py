# SPDX-License-Identifier: GPL-3.0-or-later
"""Scope: markerless motion capture. Imports nothing until it is asked to, so that ``scope.solver``
needs no bpy.
"""


def register() -> None:
    """Register the extension; Blender calls this when it is enabled."""
    import gc

    collects = gc.isenabled()
    # importing leaves no garbage, and to look for some among all of Blender's objects takes long
    gc.disable()
    try:
        from .scope_addon import ui

        ui.register()
    finally:
        if collects:
            gc.enable()


def unregister() -> None:
    """Unregister the extension; Blender calls this when it is disabled."""
    from .scope_addon import ui

    ui.unregister()
