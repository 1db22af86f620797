# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's preferences, and the folder where it keeps its files."""

from __future__ import annotations

import math
import tempfile
import time
from pathlib import Path

import bpy
from bpy.props import IntProperty, StringProperty

from ..job.cache import Cache
from ..options import Place
from .declared_properties import with_options

PACKAGE = __package__.rpartition(".scope_addon")[0]  # "bl_ext.<repository>.scope" in Blender, "scope" outside
DEFAULT_CACHE_GB = 2
_measured: dict[Path, tuple[int, float]] = {}  # cache folder: bytes, and when they were counted


@with_options(Place.PREFERENCES)
class SCOPE_AP_preferences(bpy.types.AddonPreferences):
    """Preferences of Scope."""

    bl_idname = PACKAGE

    body_file: StringProperty(
        name="Body File",
        subtype="FILE_PATH",
        description="Your own SMPL, SMPL+H, SMPL-X or STAR model, for scenes that name no other",
    )
    cache_folder: StringProperty(
        name="Cache Folder",
        subtype="DIR_PATH",
        description="Where captured motion is kept, so that none is captured twice; Blender's user folder when empty",
    )
    cache_limit_gb: IntProperty(
        name="Cache Size",
        default=DEFAULT_CACHE_GB,
        min=1,
        max=1000,
        subtype="UNSIGNED",
        description="Gigabytes of captured motion to keep; the motion used longest ago goes first",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """In the preferences window."""
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "threads")
        layout.prop(self, "provider")
        layout.prop(self, "detector_file")
        layout.prop(self, "keypoints_file")
        layout.prop(self, "body_file")
        layout.prop(self, "cache_folder")
        layout.prop(self, "cache_limit_gb", text="Keep at Most (GB)")
        row = layout.row()
        row.alignment = "RIGHT"
        row.label(text=f"{_size_text(_cache_size(cache().root))} in {cache().root}")
        row.operator("scope.clear_cache")


class SCOPE_OT_clear_cache(bpy.types.Operator):
    """Remove captured motion from the cache. Scenes that were built from it stay as they are"""

    bl_idname = "scope.clear_cache"
    bl_label = "Clear Cache"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove the files."""
        freed = cache().clear()
        _measured.clear()
        self.report({"INFO"}, f"{_size_text(freed)} freed")
        return {"FINISHED"}


def preferences() -> SCOPE_AP_preferences | None:
    """The user's preferences; None where the package was registered without being enabled as an extension."""
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None


def cache() -> Cache:
    """The cache in the folder of the preferences, of the extension, or of the system."""
    chosen = preferences()
    if chosen and chosen.cache_folder:
        # A folder of our own inside: clearing the cache must never touch the user's files.
        return Cache(Path(bpy.path.abspath(chosen.cache_folder)) / "scope-cache")
    return Cache(user_folder() / "cache")


def user_folder() -> Path:
    """A folder of ours that upgrades leave alone; under the system's temporary files when Scope is no extension."""
    try:
        return Path(bpy.utils.extension_path_user(PACKAGE, create=True))
    except ValueError:
        return Path(tempfile.gettempdir()) / "scope-user"


def _cache_size(root: Path) -> int:
    """Measured every few seconds at most: the window is drawn at every move of the mouse."""
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


CLASSES = (SCOPE_OT_clear_cache, SCOPE_AP_preferences)
