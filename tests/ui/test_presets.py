# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of the capture settings are files that Blender runs."""

from pathlib import Path
from unittest.mock import MagicMock

import bpy
import pytest
from scope.scope_addon.ui import presets


def test_a_preset_brings_the_settings_back(monkeypatch, tmp_path):
    monkeypatch.setattr(bpy.utils, "user_resource", lambda *_, **__: str(tmp_path))
    panel = presets.SCOPE_PT_capture_presets
    # Blender names the menu after the preset
    monkeypatch.setattr(panel, "bl_label", panel.bl_label)
    settings = bpy.context.scene.scope
    settings.quality = "BEST"
    settings.people = "ALL"
    assert bpy.ops.scope.add_capture_preset(name="everybody") == {"FINISHED"}
    (stored,) = Path(tmp_path).rglob("everybody.py")
    settings.quality = "FAST"
    settings.people = "LARGEST"
    exec(compile(stored.read_text("utf-8"), stored, "exec"), {})
    assert (settings.quality, settings.people) == ("BEST", "ALL")


@pytest.mark.parametrize("operator", ["import_motion", "export"])
def test_settings_of_file_windows_can_be_stored_but_not_the_file(operator):
    rna = getattr(bpy.ops.scope, operator).get_rna_type()
    assert "PRESET" in getattr(bpy.types, f"SCOPE_OT_{operator}").bl_options
    kept = {
        prop.identifier for prop in rna.properties if not (prop.is_skip_save or prop.is_hidden)
    } - {"rna_type"}
    assert not kept & {"filepath", "directory", "files", "filter_glob", "format"}
    assert kept >= (
        {"up_axis", "motion_rate", "body", "set_rate"}
        if operator == "import_motion"
        else {"camera"}
    )


def test_without_presets_blender_does_not_complain_of_missing_paths(monkeypatch, tmp_path):
    scripts = tmp_path / "scripts"
    monkeypatch.setenv("BLENDER_USER_SCRIPTS", str(scripts))
    panel = presets.SCOPE_PT_capture_presets
    labels = []
    assert not bpy.utils.preset_paths(panel.preset_subdir)
    stub = MagicMock(preset_subdir=panel.preset_subdir, preset_operator=panel.preset_operator)
    stub.path_menu = lambda *given, **named: bpy.types.Menu.path_menu(stub, *given, **named)
    stub.layout.label = lambda **given: labels.append(given["text"])
    panel.draw(stub, bpy.context)
    assert labels == []
    assert bpy.utils.preset_paths(panel.preset_subdir)
