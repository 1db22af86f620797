# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of the capture settings are files that Blender runs."""

from pathlib import Path

import bpy


def test_a_preset_brings_the_settings_back(monkeypatch, tmp_path):
    monkeypatch.setattr(bpy.utils, "user_resource", lambda *_, **__: str(tmp_path))
    settings = bpy.context.scene.scope
    settings.quality, settings.people = "BEST", "ALL"
    assert bpy.ops.scope.add_capture_preset(name="everybody") == {"FINISHED"}
    (stored,) = Path(tmp_path).rglob("everybody.py")
    settings.quality, settings.people = "FAST", "LARGEST"
    exec(compile(stored.read_text(), stored, "exec"), {})
    assert (settings.quality, settings.people) == ("BEST", "ALL")
