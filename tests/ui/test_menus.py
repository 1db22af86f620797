# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a Blender user looks for motion capture: menus, shortcut, presets.

Presets of the capture settings are files that Blender runs.
"""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import pytest
import scope
from scope.scope_addon.ui import capture_panel, export_operators, menus, preferences
from scope.scope_addon.ui.capture_panel import SCOPE_OT_add_capture_preset

ROOT = Path(scope.__file__).resolve().parent


def functions(menu):
    return getattr(getattr(bpy.types, menu).draw, "_draw_funcs", [])


def test_the_menus_have_entries_only_while_enabled():
    for menu, draw in menus._ENTRIES:
        assert functions(menu).count(draw) == 1
    scope.unregister()
    try:
        for menu, draw in menus._ENTRIES:
            assert draw not in functions(menu)
    finally:
        scope.register()


def test_labels_have_the_words_that_people_search_for():
    layout = MagicMock()
    menus.draw_import_video(layout, "NONE")
    entry = layout.operator.call_args.kwargs["text"].lower()
    assert all(word in entry for word in ("motion capture", "mocap", "video"))
    assert "mocap" in menus.SCOPE_MT_export.bl_label.lower()
    assert len(bpy.types.SCOPE_OT_import_video.bl_label) < 20, (
        "the button of the file browser cuts longer labels off"
    )


def test_the_shortcut_exists_only_while_enabled():
    keymaps = bpy.context.window_manager.keyconfigs.addon
    if keymaps is None:
        pytest.skip("this Blender has no keymaps without a window")

    def own():
        found = keymaps.keymaps.get("3D View")
        return (
            [item.type for item in found.keymap_items if item.idname == "scope.look_through"]
            if found
            else []
        )

    assert own() == ["V"]
    scope.unregister()
    try:
        assert own() == []
        assert preferences._shortcuts == []
    finally:
        scope.register()


@pytest.mark.parametrize(("operators", "says"), [(("usd_export",), False), ((), True)])
def test_the_greyed_usd_button_says_why(monkeypatch, operators, says):
    blender = SimpleNamespace(ops=SimpleNamespace(wm=SimpleNamespace(**dict.fromkeys(operators))))
    monkeypatch.setattr(export_operators, "bpy", blender)
    assert export_operators.is_available("USDC") != says
    tooltip = export_operators.SCOPE_OT_export.description(None, SimpleNamespace(format="USDC"))
    assert ("built without USD" in tooltip) == says
    assert "Omniverse" in tooltip
    assert "USD" not in export_operators.SCOPE_OT_export.description(
        None, SimpleNamespace(format="FBX")
    )


def test_the_documentation_is_a_file_that_comes_with_scope(monkeypatch, tmp_path):
    assert preferences.guide() == ROOT / "docs" / "guide.md"  # in a checkout
    module = tmp_path / "scope_addon" / "ui" / "preferences.py"
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "guide.html").touch()
    monkeypatch.setattr(preferences, "__file__", str(module))
    assert preferences.guide() == tmp_path / "docs" / "guide.html"
    opened = MagicMock()
    with monkeypatch.context() as patch:
        patch.setattr(preferences, "bpy", SimpleNamespace(ops=SimpleNamespace(wm=opened)))
        assert preferences.SCOPE_OT_documentation.execute(None, None) == {"FINISHED"}
    opened.url_open.assert_called_once_with(url=(tmp_path / "docs" / "guide.html").as_uri())


def test_presets_store_settings_but_nothing_of_one_clip():
    names = {
        value.removeprefix("bpy.context.scene.scope.")
        for value in SCOPE_OT_add_capture_preset.preset_values
    }
    assert {"quality", "people", "hands", "face", "frame_rate"} <= names
    of_one_clip = {"take", "person", "crop", "range_start", "range_end", "height_cm", "footage"}
    assert not names & of_one_clip
    settings = bpy.context.scene.scope
    assert all(hasattr(settings, name) for name in names | of_one_clip)


def test_a_preset_brings_the_settings_back(monkeypatch, tmp_path):
    monkeypatch.setattr(bpy.utils, "user_resource", lambda *_, **__: str(tmp_path))
    panel = capture_panel.SCOPE_PT_capture_presets
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
    panel = capture_panel.SCOPE_PT_capture_presets
    labels = []
    assert not bpy.utils.preset_paths(panel.preset_subdir)
    stub = MagicMock(preset_subdir=panel.preset_subdir, preset_operator=panel.preset_operator)
    stub.path_menu = lambda *given, **named: bpy.types.Menu.path_menu(stub, *given, **named)
    stub.layout.label = lambda **given: labels.append(given["text"])
    panel.draw(stub, bpy.context)
    assert labels == []
    assert bpy.utils.preset_paths(panel.preset_subdir)
