# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of files: their texts, and the operator that chooses a file for any of them."""

from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import pytest
from scope.scope_addon.ui.file_field import SCOPE_OT_choose_file, draw_file

SETTINGS = [("scope", "body_file"), ("scope", "calibration_file"), ("scope_live", "file")]


@pytest.fixture
def saved(tmp_path):
    """Save the scene, and return its folder."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    preferred = bpy.context.preferences.filepaths
    before = preferred.use_relative_paths
    yield tmp_path
    preferred.use_relative_paths = before


@pytest.fixture
def preferences():
    """Return the preferences of the extension as it is where it is enabled."""
    addon = bpy.context.preferences.addons.new()
    addon.module = "scope"
    yield addon.preferences
    bpy.context.preferences.addons.remove(addon)


@pytest.mark.parametrize(("owner", "setting"), [*SETTINGS, ("scope", "footage")])
def test_the_text_of_a_path_shows_and_sets_it(owner, setting):
    settings = getattr(bpy.context.scene, owner)
    setattr(settings, f"{setting}_text", "/a/b.mp4")
    assert getattr(settings, setting) == "/a/b.mp4"
    setattr(settings, setting, "//c.npz")
    assert getattr(settings, f"{setting}_text") == "//c.npz"


def test_a_name_that_is_not_utf8_can_be_shown_and_confirmed():
    settings = bpy.context.scene.scope
    settings.footage = "/a/caf\udce9.mp4"
    assert settings.footage_text == "/a/caf\ufffd.mp4"
    settings.footage_text = settings.footage_text
    assert settings.footage == "/a/caf\udce9.mp4"


@pytest.mark.parametrize(("owner", "setting"), SETTINGS)
def test_a_chosen_file_is_the_settings(owner, setting):
    chosen = {"filepath": "/a/any.suffix", "owner": owner, "setting": setting}
    assert bpy.ops.scope.choose_file(**chosen) == {"FINISHED"}
    assert getattr(getattr(bpy.context.scene, owner), setting) == "/a/any.suffix"


@pytest.mark.parametrize(("owner", "setting"), SETTINGS)
def test_only_the_browser_of_a_video_shows_every_movie_that_blender_knows(owner, setting):
    opened = []
    context = SimpleNamespace(window_manager=SimpleNamespace(fileselect_add=opened.append))
    operator = SimpleNamespace(
        setting=setting, _settings=lambda _: getattr(bpy.context.scene, owner)
    )
    assert SCOPE_OT_choose_file.invoke(operator, context, None) == {"RUNNING_MODAL"}
    assert opened == [operator]
    assert operator.filter_movie is (setting == "file")
    assert ("*.mp4" in operator.filter_glob.split(";")) is (setting == "file")


@pytest.mark.parametrize("setting", ["body_file", "detector_file", "keypoints_file"])
def test_a_chosen_file_is_that_of_the_preferences(saved, preferences, setting):
    bpy.context.preferences.is_dirty = False
    chosen = str(saved / "any.suffix")
    assert bpy.ops.scope.choose_file(filepath=chosen, owner="preferences", setting=setting) == {
        "FINISHED"
    }
    assert getattr(preferences, setting) == chosen  # no matter which .blend file is open
    assert getattr(preferences, f"{setting}_text") == chosen
    assert bpy.context.preferences.is_dirty  # or Blender would not save them


def test_without_preferences_no_file_is_chosen_for_them():
    assert bpy.ops.scope.choose_file(filepath="/a", owner="preferences", setting="body_file") == {
        "CANCELLED"
    }


def test_the_button_beside_a_field_chooses_the_file_of_that_field(preferences):
    scene = bpy.context.scene
    for settings, path, drawn in (
        (scene.scope, "body_file", ("scope", "body_file")),
        (scene.scope_live, "file", ("scope_live", "file")),
        (preferences, "body_file", ("preferences", "body_file")),
    ):
        layout = MagicMock()
        row = draw_file(layout, settings, path)
        assert row.prop.call_args.args == (settings, f"{path}_text")
        assert row.operator.call_args.args == ("scope.choose_file",)
        button = row.operator.return_value
        assert (button.owner, button.setting) == drawn


@pytest.mark.parametrize(
    ("is_relative", "stored"), [(True, "//clips/a.mp4"), (False, "{folder}/clips/a.mp4")]
)
def test_a_chosen_file_is_stored_as_the_user_prefers(saved, fake_worker, is_relative, stored):
    fake_worker("finish()")
    bpy.context.preferences.filepaths.use_relative_paths = is_relative
    (saved / "clips").mkdir()
    (saved / "clips" / "a.mp4").touch()
    chosen = {"filepath": str(saved / "clips" / "a.mp4")}
    settings = bpy.context.scene.scope
    for owner, setting in SETTINGS:
        bpy.ops.scope.choose_file(owner=owner, setting=setting, **chosen)
        assert getattr(getattr(bpy.context.scene, owner), setting) == stored.format(folder=saved)
    for operator in (bpy.ops.scope.choose_footage, bpy.ops.scope.import_video):
        settings.footage = ""
        assert operator(**chosen) == {"FINISHED"}
        assert settings.footage == stored.format(folder=saved)


def test_a_chosen_file_of_another_drive_is_stored_as_it_is(saved, monkeypatch):
    def relpath(path):  # as on Windows
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr(bpy.path, "relpath", relpath)
    bpy.ops.scope.choose_file(filepath="D:\\a.npz", owner="scope", setting="body_file")
    assert bpy.context.scene.scope.body_file == "D:\\a.npz"


@pytest.mark.parametrize("operator", ["choose_footage", "import_video"])
def test_footage_whose_name_is_too_long_is_an_error(operator):
    with pytest.raises(RuntimeError, match="aaa is not a file") as caught:
        getattr(bpy.ops.scope, operator)(filepath="/" + "a" * 300)
    assert "Traceback" not in str(caught.value)
