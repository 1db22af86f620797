# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's preferences, the folder of its files, and the keyboard shortcut of Compare with
Footage in the 3D viewport, which the user can change in the preferences.
"""

from __future__ import annotations

import math
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import IntProperty, StringProperty
from bpy.types import Context, Operator, Scene, UILayout

from ..options import Place
from .declared_properties import split, with_options
from .file_field import draw_file, path_text
from .reporting import iface_, rpt_

if TYPE_CHECKING:
    from ..job.cache import Cache

# "bl_ext.<repository>.scope" in Blender, "scope" outside
PACKAGE = __package__.rpartition(".scope_addon")[0]
DEFAULT_CACHE_GB = 2
_BODY_FILE = {
    "name": "Body File",
    "description": "Custom SMPL, SMPL+H, SMPL-X or STAR model, for scenes without a body file of "
    "their own",
}
_measured: dict[Path, tuple[int, float]] = {}  # cache folder: bytes, and time of the measurement
_SHORTCUT_OPERATOR = "scope.look_through"  # of the shortcut
_shortcuts: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


@with_options(Place.PREFERENCES)
class SCOPE_AP_preferences(bpy.types.AddonPreferences):
    """Preferences of Scope"""

    bl_idname = PACKAGE

    body_file: StringProperty(subtype="FILE_PATH", **_BODY_FILE)
    body_file_text: path_text("body_file", **_BODY_FILE)
    cache_folder: StringProperty(
        name="Cache Folder",
        subtype="DIR_PATH",
        description="Folder for captured motion, so the same footage is not captured twice; if "
        "empty, Blender's user "
        "folder",
    )
    cache_limit_gb: IntProperty(
        name="Cache Size",
        default=DEFAULT_CACHE_GB,
        min=1,
        max=1000,
        subtype="UNSIGNED",
        description="Gigabytes of captured motion to keep; the least recently used is removed "
        "first",
    )

    def draw(self, context: Context) -> None:
        """Draw the preferences."""
        layout = split(self.layout)
        layout.prop(self, "threads")
        layout.prop(self, "provider")
        draw_file(layout, self, "detector_file")
        draw_file(layout, self, "keypoints_file")
        draw_file(layout, self, "body_file")
        layout.prop(self, "cache_folder")
        layout.prop(self, "cache_limit_gb", text="Keep at Most (GB)")
        _draw_shortcut(layout, context)
        row = layout.row()
        row.alignment = "RIGHT"
        row.operator("scope.documentation", icon="HELP")
        row = layout.row()
        row.alignment = "RIGHT"
        folder = cache().root
        size = _size_text(_cache_size(folder))
        row.label(text=iface_("{size} of captures in {folder}", size=size, folder=folder))
        row.operator("scope.clear_cache")


class SCOPE_OT_clear_cache(Operator):
    """Remove captured motion from the cache"""

    bl_description = (
        "Remove captured motion from the cache. Existing scenes and the compiled solver are not "
        "affected"
    )
    bl_idname = "scope.clear_cache"
    bl_label = "Clear Cache"

    def execute(self, context: Context) -> set[str]:
        """Remove the files."""
        freed = cache().clear()
        _measured.clear()
        self.report({"INFO"}, rpt_("Freed {size}", size=_size_text(freed)))
        return {"FINISHED"}


class SCOPE_OT_documentation(Operator):
    """Open the guide, which comes with Scope, in the web browser; the network is not used"""

    bl_idname = "scope.documentation"
    bl_label = "Documentation"

    def execute(self, context: Context) -> set[str]:
        """Open it."""
        bpy.ops.wm.url_open(url=guide().as_uri())
        return {"FINISHED"}


def guide() -> Path:
    """Return the file of the guide: a page of the extension, or in a checkout the text from which
    that is made.
    """
    docs = Path(__file__).resolve().parents[2] / "docs"
    page = docs / "guide.html"
    return page if page.is_file() else page.with_suffix(".md")


def preferences() -> SCOPE_AP_preferences | None:
    """Return the user's preferences; None if the package is registered without being enabled as an
    extension.
    """
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None


def body_file(scene: Scene) -> str:
    """Return the path of the body file that is chosen in a scene or else in the preferences; empty
    if none is.
    """
    chosen = preferences()
    path = scene.scope.body_file or (chosen.body_file if chosen else "")
    return str(bpy.path.abspath(path))


def cache() -> Cache:
    """Return the cache: in the folder of the preferences, or else in the user folder, also where
    that of the preferences is relative to a .blend file that was never saved.
    """
    from ..job.cache import Cache

    chosen = preferences()
    folder = bpy.path.abspath(chosen.cache_folder) if chosen else ""
    if os.path.isabs(folder):
        # In a subfolder, because clearing the cache must never remove the user's files.
        return Cache(Path(folder) / "scope-cache")
    return Cache(user_folder() / "cache")


def python_command() -> list[str]:
    """Return the command of Blender's own Python, which leaves out the user's packages."""
    # Blender 4.2 has no such attribute; its Python is isolated as well.
    return [sys.executable, *getattr(bpy.app, "python_args", ("-I",))]


def keep_machine_code() -> None:
    """Keep what the solver compiles inside Blender in the cache, never in the extension's folder.

    Operators that solve call this first: it loads numba.
    """
    from ..machine_code.code_folders import keep_in

    keep_in(cache().kernels)


def user_folder() -> Path:
    """Return a folder that upgrades keep; one among the user's caches if Scope is not enabled as an
    extension.
    """
    from ..private_folder import private_folder

    try:
        return Path(bpy.utils.extension_path_user(PACKAGE, create=True))
    except ValueError:
        return private_folder()


def _cache_size(root: Path) -> int:
    """Measure the cache, at most every few seconds: the window is redrawn at every movement of the
    mouse.
    """
    from ..job.cache import Cache

    size, when = _measured.get(root, (0, -math.inf))
    if time.monotonic() - when > 3.0:
        size = Cache(root).size()
        _measured[root] = size, time.monotonic()
    return size


def _size_text(size: float) -> str:
    for unit in ("bytes", "kB", "MB"):
        if size < 1000:
            return f"{size:.0f} {unit}"
        size /= 1000
    return f"{size:.1f} GB"


def attach() -> None:
    """Add the shortcut; Blender without a window has no keymaps."""
    keymaps = bpy.context.window_manager.keyconfigs.addon
    if keymaps is None:
        return
    keymap = keymaps.keymaps.new(name="3D View", space_type="VIEW_3D")
    item = keymap.keymap_items.new(_SHORTCUT_OPERATOR, "V", "PRESS", shift=True, alt=True)
    _shortcuts.append((keymap, item))


def detach() -> None:
    """Remove the shortcut."""
    for keymap, item in _shortcuts:
        keymap.keymap_items.remove(item)
    _shortcuts.clear()


def _draw_shortcut(layout: UILayout, context: Context) -> None:
    """Draw the shortcut as the preferences' keymap editor does, where it can be changed."""
    import rna_keymap_ui

    keymaps = context.window_manager.keyconfigs.user
    for keymap in [keymaps.keymaps.get(own.name) for own, _ in _shortcuts] if keymaps else ():
        item = keymap.keymap_items.find_from_operator(_SHORTCUT_OPERATOR) if keymap else None
        if item is not None:
            layout.context_pointer_set("keymap", keymap)
            rna_keymap_ui.draw_kmi([], keymaps, keymap, item, layout, 0)


CLASSES = (SCOPE_OT_clear_cache, SCOPE_OT_documentation, SCOPE_AP_preferences)
