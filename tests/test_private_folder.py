# SPDX-License-Identifier: GPL-3.0-or-later
"""Code that runs is never read from a folder that another user can have prepared."""

import os
import stat
import sys

import pytest
from scope.scope_addon.private_folder import private_folder

from .required import package

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="with the folders of Linux")


@pytest.fixture
def caches(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    private_folder.cache_clear()
    yield tmp_path / "caches"
    private_folder.cache_clear()


def mode(folder):
    return stat.S_IMODE(folder.stat().st_mode)


def test_it_is_the_users_own_and_lasts(caches):
    found = private_folder()
    assert found.parent == caches
    assert mode(found) == 0o700
    private_folder.cache_clear()
    assert private_folder() == found


def test_access_for_others_is_taken_away(caches):
    (caches / "scope-mocap").mkdir(parents=True)
    (caches / "scope-mocap").chmod(0o777)
    assert mode(private_folder()) == 0o700


@pytest.mark.parametrize("kind", ["link", "file", "foreign", "no room"])
def test_what_others_prepared_is_not_used(caches, monkeypatch, kind):
    theirs = caches / "scope-mocap"
    caches.mkdir()
    if kind == "link":
        (caches / "elsewhere").mkdir()
        theirs.symlink_to(caches / "elsewhere")
    elif kind == "file":
        theirs.write_text("")
    elif kind == "foreign":
        theirs.mkdir()
        monkeypatch.setattr(os, "geteuid", lambda: theirs.stat().st_uid + 1)
    else:
        caches.rmdir()
        caches.write_text("no folder")
    found = private_folder()
    assert found.parent == caches.parent
    assert found.name.startswith("scope-mocap-")
    assert mode(found) == 0o700
    assert not any(found.iterdir())


@pytest.mark.usefixtures("blender_module")
def test_the_extensions_fallback_is_this_folder(caches):
    package("bpy")
    from scope.scope_addon.ui.preferences import user_folder

    assert user_folder() == private_folder()
