# SPDX-License-Identifier: GPL-3.0-or-later
"""A release: its checks, its contents, and that Blender's own tool installs and updates from it."""

import hashlib
import json
import os
import re
import sys
import threading
import zipfile
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from .script_modules import ROOT, script

CHANGELOG = """# Changelog

## 0.2.0, 2026-12-01

### Capture

- More.

## 0.1.0, 2026-11-01

- First.
"""


@pytest.fixture(scope="module")
def release():
    return script("make_release")


@pytest.fixture
def repository(release, tmp_path, monkeypatch):
    """A repository with one commit."""
    root = tmp_path / "repository"
    root.mkdir()
    monkeypatch.setattr(release, "ROOT", root)
    for name in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{name}_NAME", "somebody")
        monkeypatch.setenv(f"GIT_{name}_EMAIL", "somebody@example.com")
    release.git("init", "--quiet")
    commit(release, root, "first")
    return root


def commit(release, root, text):
    (root / "file").write_text(text)
    release.git("add", ".")
    release.git("commit", "--quiet", "--message", text)


def test_the_notes_are_the_section_of_the_version(release):
    heading, notes = release.section_of("0.2.0", CHANGELOG)
    assert heading == "0.2.0, 2026-12-01"
    assert notes == "### Capture\n\n- More.\n"
    assert release.section_of("0.1.0", CHANGELOG)[1] == "- First.\n"


@pytest.mark.parametrize("version", ["0.3.0", "0.2", "2.0"])
def test_a_version_without_notes_is_refused(release, version):
    with pytest.raises(SystemExit, match=rf"no section '## {version}, DATE'"):
        release.section_of(version, CHANGELOG)


def test_the_changelog_has_notes_on_the_version_of_the_manifest(release):
    _, notes = release.section_of(
        release.manifest()["version"], (ROOT / "CHANGELOG.md").read_text("utf-8")
    )
    assert "- " in notes


def test_sources_that_are_committed_dated_and_not_tagged_elsewhere_may_be_released(
    release, repository, capsys
):
    dated = "0.2.0, 2026-12-01"
    assert release.check_sources("v0.2.0", dated, dry_run=False) is False
    for heading in ("0.2.0, unreleased", "0.2.0", "0.2.0, December"):
        with pytest.raises(SystemExit, match="end it with the date"):
            release.check_sources("v0.2.0", heading, dry_run=False)
    release.git("tag", "v0.2.0")
    assert release.check_sources("v0.2.0", dated, dry_run=False) is True
    (repository / "other").touch()
    with pytest.raises(SystemExit, match="not committed"):
        release.check_sources("v0.2.0", dated, dry_run=False)
    commit(release, repository, "second")
    with pytest.raises(SystemExit, match=r"v0\.2\.0 is at another commit"):
        release.check_sources("v0.2.0", dated, dry_run=False)
    release.check_sources("v0.2.0", "0.2.0, unreleased", dry_run=True)
    assert capsys.readouterr().err.count("this is a dry run, otherwise") == 2


def test_pictures_have_the_size_of_the_platform(release, tmp_path):
    import cv2

    for name in release.PICTURES:
        release.write_picture(ROOT / "assets" / "guide" / f"{name}.jpg", tmp_path / "a.png")
        height, width, _ = cv2.imread(str(tmp_path / "a.png")).shape
        assert (width, height) == (1920, 1080)


def test_the_hashes_are_those_that_sha256sum_checks(release, tmp_path):
    (tmp_path / "a.zip").write_bytes(b"a")
    (tmp_path / "b.zip").write_bytes(b"b" * 100_000)
    release.write_hashes(tmp_path)
    stated = dict(
        reversed(line.split("  ")) for line in (tmp_path / "SHA256SUMS").read_text().splitlines()
    )
    assert stated == {
        name: hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
        for name in ("a.zip", "b.zip")
    }


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="the wheel is built of tracked files")
def test_a_repeated_build_of_the_wheel_gives_the_same_bytes(release, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    before = os.umask(0o022)
    try:
        for name, umask in (("first", 0o022), ("second", 0o077)):
            (tmp_path / name).mkdir()
            os.umask(umask)
            release.build_wheel(tmp_path / name)
    finally:
        os.umask(before)
    (first,) = (tmp_path / "first").iterdir()
    (second,) = (tmp_path / "second").iterdir()
    assert first.name == second.name
    assert first.read_bytes() == second.read_bytes()


def small_zip(release, folder, version):
    """An extension with the manifest of Scope, and a module that states the version."""
    text = (ROOT / "blender_manifest.toml").read_text("utf-8").partition("\n[build]")[0]
    text = re.sub(r'^version = ".*"$', f'version = "{version}"', text, flags=re.M)
    with zipfile.ZipFile(folder / f"scope-{version}.zip", "w") as file:
        file.writestr("blender_manifest.toml", text)
        file.writestr("__init__.py", f"VERSION = {version!r}\n")


def test_blender_installs_and_updates_from_the_static_folder_and_settings_stay(release, tmp_path):
    served = tmp_path / "served"
    served.mkdir()
    handler = partial(SimpleHTTPRequestHandler, directory=str(served))
    handler.log_message = lambda *_: None
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_address[1]}"
    blenders_tool = sys.modules["build_extension"].blender_extension
    local = tmp_path / "extensions" / "static"
    # Blender keeps what `extension_path_user` names beside the repositories' folders.
    settings = tmp_path / "extensions" / ".user" / "static" / "scope" / "settings.json"
    settings.parent.mkdir(parents=True)
    settings.write_text("mine")
    try:
        for version in ("0.1.0", "0.2.0"):
            for old in served.iterdir():
                old.unlink()
            small_zip(release, served, version)
            blenders_tool("server-generate", "--repo-dir", str(served))
            listing = json.loads((served / "index.json").read_text("utf-8"))
            listing = release.listing_of_zips(listing, address)
            (served / "index.json").write_text(json.dumps(listing), "utf-8")
            where = ["--remote-url", f"{address}/index.json", "--local-dir", str(local)]
            blenders_tool("sync", *where)
            blenders_tool("install", *where, "--blender-version", "4.5.0", "scope")
            installed = (local / "scope" / "__init__.py").read_text("utf-8")
            assert installed == f"VERSION = {version!r}\n"
            assert settings.read_text() == "mine"
    finally:
        server.shutdown()
        server.server_close()
