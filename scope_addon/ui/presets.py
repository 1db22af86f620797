# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of the capture settings: chosen, added and removed in the header of the Capture panel."""

from __future__ import annotations

import contextlib

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ..options import Place, options_at
from .declared_properties import property_name

# What belongs to one clip, or to one person, is no preset.
_OF_THE_CLIP = ("take", "use_range", "start", "end", "heights_m")


class SCOPE_PT_capture_presets(PresetPanel, bpy.types.Panel):
    """Presets of the capture settings."""

    bl_label = "Capture Presets"
    preset_subdir = "scope/capture"
    preset_operator = "script.execute_preset"
    preset_add_operator = "scope.add_capture_preset"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the presets. Without a folder for them, Blender would complain of missing paths
        before the first one.
        """
        if not bpy.utils.preset_paths(self.preset_subdir):
            with contextlib.suppress(OSError):
                bpy.utils.user_resource(
                    "SCRIPTS", path=f"presets/{self.preset_subdir}", create=True
                )
        PresetPanel.draw(self, context)


class SCOPE_OT_add_capture_preset(AddPresetBase, bpy.types.Operator):
    """Add the capture settings as a preset, or remove a preset"""

    bl_idname = "scope.add_capture_preset"
    bl_label = "Add Capture Preset"
    preset_menu = "SCOPE_PT_capture_presets"
    preset_subdir = "scope/capture"
    # Whole paths: a Blender before 4.4 does not find what ``preset_defines`` defines if its Python
    # is 3.13.
    preset_values = [
        f"bpy.context.scene.scope.{property_name(option)}"
        for option in options_at(Place.PANEL)
        if option.name not in _OF_THE_CLIP
    ]


CLASSES = (SCOPE_PT_capture_presets, SCOPE_OT_add_capture_preset)
