# SPDX-License-Identifier: GPL-3.0-or-later
"""Enabling and disabling under both of the package's names, and the libraries that this loads."""

import subprocess
import sys
from importlib import import_module

import addon_utils
import bpy
import pytest
import scope


@pytest.fixture
def unregistered():
    scope.unregister()
    yield
    scope.register()


def ours():
    return sorted(name for name in dir(bpy.types) if name.startswith("SCOPE_"))


def test_registering_twice_in_a_shell(unregistered):
    assert ours() == []
    for _ in range(2):
        scope.register()
        assert {"SCOPE_PT_capture", "SCOPE_FH_footage"} <= set(ours())
        assert bpy.context.scene.scope.quality == "BEST"
        scope.unregister()
        assert ours() == []
        assert not hasattr(bpy.types.Scene, "scope")


def test_enabling_twice_as_an_extension_with_preferences(unregistered, tmp_path, root):
    (tmp_path / "scope").symlink_to(root)
    repository = bpy.context.preferences.extensions.repos.new(
        name="test", module="scope_test", custom_directory=str(tmp_path), remote_url=""
    )
    name = "bl_ext.scope_test.scope"
    try:
        addon_utils.extensions_refresh()
        for _ in range(2):
            assert addon_utils.enable(name, default_set=True) is not None
            assert bpy.context.preferences.addons[name].preferences.cache_limit_gb == 2
            assert bpy.context.preferences.addons[name].preferences.provider == "AUTO"
            assert "SCOPE_PT_capture" in ours()
            folder = import_module(f"{name}.scope_addon.ui.preferences").cache().root
            assert folder.is_relative_to(bpy.utils.extension_path_user(name))
            addon_utils.disable(name, default_set=True)
            assert ours() == []
    finally:
        bpy.context.preferences.extensions.repos.remove(repository)


def test_enabling_loads_no_heavy_library_and_collects_no_garbage():
    heavy = {"numba", "cv2", "onnxruntime", "llvmlite"}
    slow = {
        "json",
        "hashlib",
        "subprocess",
        "tempfile",
        "shutil",
        "textwrap",
        "gpu_extras",
    }  # 20 ms of a start, together
    # not before a capture begins
    ours = {"scope.solver.body", "scope.scope_addon.job", "scope.scope_addon.capture"}
    code = (
        f"import gc, sys, os, bpy, scope; [sys.modules.pop(name, None) for name in {slow}]; "
        "collected = [];"
        "gc.callbacks.append(lambda _, about: collected.append(about['generation'])); "
        "scope.register();"
        "gc.callbacks.clear(); assert gc.isenabled();"
        f"print(sorted({heavy | slow | ours} & set(sys.modules)), max(collected, default=0), "
        "flush=True); os._exit(0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().splitlines()[-1] == "[] 0"


def test_what_the_solver_tells_programmers_is_not_printed_in_blender():
    code = (
        "import os, warnings, bpy, scope; from scope.solver.errors import UnitsWarning; "
        "scope.register(); warnings.warn('lengths in millimetres', UnitsWarning); "
        "warnings.warn('of another add-on'); os._exit(0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "UserWarning: of another add-on" in done.stderr
    assert "UnitsWarning: " not in done.stderr  # Python 3.13 prints the code itself


def test_a_failing_registration_leaves_nothing(unregistered, monkeypatch):
    from scope.scope_addon.ui import translations

    def refuse():
        raise RuntimeError("refused")

    def drawn():
        menus = (bpy.types.VIEW3D_MT_pose, bpy.types.TOPBAR_MT_file_import)
        return [len(menu._dyn_ui_initialize()) for menu in menus]

    handlers = len(bpy.app.handlers.undo_pre)
    entries = drawn()
    with monkeypatch.context() as patch:
        patch.setattr(translations, "attach", refuse)
        with pytest.raises(RuntimeError, match="refused"):
            scope.register()
    assert not hasattr(bpy.types.Scene, "scope")
    assert not hasattr(bpy.types.Collection, "scope_result")
    assert len(bpy.app.handlers.undo_pre) == handlers
    assert drawn() == entries
    assert ours() == []


def test_every_operator_and_setting_has_a_tooltip():
    from scope.scope_addon import ui

    for module in ui._MODULES:
        for cls in module.CLASSES:
            if issubclass(cls, bpy.types.Operator):
                tooltip = getattr(cls, "bl_description", cls.__doc__)
                assert len(tooltip) > 10, cls
                assert not tooltip.endswith("."), cls  # Blender adds the full stop
                assert "\n" not in tooltip, cls
                assert cls.bl_idname.startswith("scope.")
    shown = [bpy.context.scene.scope.bl_rna, ui.preferences.SCOPE_AP_preferences.bl_rna]
    for rna in shown:
        for prop in rna.properties:
            if prop.identifier not in ("rna_type", "name", "bl_idname", "no_result"):
                assert prop.description.strip(), prop.identifier
                if prop.type == "ENUM":
                    assert all(item.description for item in prop.enum_items), prop.identifier


def test_the_command_runs_the_command_line(monkeypatch, capsys):
    from scope.scope_addon import ui

    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    # the command sets it for its process; restored after the test
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    assert ui.run_command(["capture", "/nowhere/at/all.mp4", "-o", "/nowhere/a.npz"]) != 0
    assert "nowhere" in capsys.readouterr().err
