# SPDX-License-Identifier: GPL-3.0-or-later
"""The keyboard shortcut of Compare with Footage in the 3D viewport, which the user can change in
the preferences.
"""

from __future__ import annotations

import bpy

_OPERATOR = "scope.look_through"
_added: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def attach() -> None:
    """Add the shortcut; Blender without a window has no keymaps."""
    keymaps = bpy.context.window_manager.keyconfigs.addon
    if keymaps is None:
        return
    keymap = keymaps.keymaps.new(name="3D View", space_type="VIEW_3D")
    _added.append((keymap, keymap.keymap_items.new(_OPERATOR, "V", "PRESS", shift=True, alt=True)))


def detach() -> None:
    """Remove the shortcut."""
    for keymap, item in _added:
        keymap.keymap_items.remove(item)
    _added.clear()


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the shortcut as the preferences' keymap editor does, where it can be changed."""
    import rna_keymap_ui

    keymaps = context.window_manager.keyconfigs.user
    for keymap in [keymaps.keymaps.get(own.name) for own, _ in _added] if keymaps else ():
        item = keymap.keymap_items.find_from_operator(_OPERATOR) if keymap else None
        if item is not None:
            layout.context_pointer_set("keymap", keymap)
            rna_keymap_ui.draw_kmi([], keymaps, keymap, item, layout, 0)
