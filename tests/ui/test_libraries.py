# SPDX-License-Identifier: GPL-3.0-or-later
"""Libraries that another Blender has removed are put back, or the message says what to do."""

import sys
from types import SimpleNamespace

import bpy
import pytest
from scope.scope_addon.errors import SetupError
from scope.scope_addon.ui import reporting


@pytest.fixture
def enabled(tmp_path, monkeypatch):
    """Scope is enabled as an extension, and needs a library that is in a folder of wheels."""
    folder = tmp_path / "wheels"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setattr(reporting, "_NEEDED", ("scope_needs_this",))
    preferences = SimpleNamespace(addons={reporting._PACKAGE: None})
    monkeypatch.setattr(
        reporting, "bpy", SimpleNamespace(context=SimpleNamespace(preferences=preferences))
    )
    return folder / "scope_needs_this.py"


def use_blender(monkeypatch, extensions_refresh):
    monkeypatch.setitem(
        sys.modules, "addon_utils", SimpleNamespace(extensions_refresh=extensions_refresh)
    )


def test_a_removed_library_is_put_back(enabled, monkeypatch):
    asked = []

    def extensions_refresh(ensure_wheels):
        asked.append(ensure_wheels)
        enabled.write_text("")

    use_blender(monkeypatch, extensions_refresh)
    reporting.restore_libraries()
    assert asked == [True]
    reporting.restore_libraries()
    assert asked == [True]
    # One that was loaded is missing for a worker all the same.
    __import__("scope_needs_this")
    enabled.unlink()
    reporting.restore_libraries()
    assert asked == [True, True]
    del sys.modules["scope_needs_this"]


def test_one_that_stays_missing_is_said_with_what_to_do(enabled, monkeypatch):
    use_blender(monkeypatch, lambda ensure_wheels: None)
    with pytest.raises(SetupError, match=r"missing \(scope_needs_this\).*disable Scope.*enable it"):
        reporting.restore_libraries()


def test_outside_of_an_extension_nothing_is_done(monkeypatch):
    use_blender(monkeypatch, lambda ensure_wheels: pytest.fail("it was asked"))
    monkeypatch.setattr(reporting, "_NEEDED", ("scope_needs_this",))
    assert reporting._PACKAGE not in bpy.context.preferences.addons
    reporting.restore_libraries()
