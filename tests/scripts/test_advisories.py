# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of vulnerabilities is of the installed libraries, and what it says to be out of reach
is.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import mmap
import platform
import re
import sys
import tomllib
from pathlib import Path

import pytest
from scope.scope_addon.capture.media.still_images import is_picture
from scope.scope_addon.errors import VideoError

from .script_modules import ROOT, script

TABLE = tomllib.loads((ROOT / "scripts" / "advisories.toml").read_text("utf-8"))
# Where the files of Blender's module state the versions of libraries.
STATED_IN_BLENDER = {
    "FFmpeg": ("bpy/__init__.so", rb"FFmpeg version (\d[\d.]+)"),
    "LibTIFF": ("bpy/lib/libOpenImageIO.so.3.0", rb"LIBTIFF, Version (\d[\d.]+)"),
    "OpenEXR": ("bpy/lib/libOpenEXR.so.32", rb"\0(3\.\d+\.\d+)\0"),
}
IS_LINUX = (sys.platform, platform.machine()) == ("linux", "x86_64")


@pytest.mark.skipif(not IS_LINUX, reason="the table is of the wheels for Linux")
@pytest.mark.parametrize("package", ["opencv-contrib-python-headless", "av"])
def test_the_versions_are_those_of_the_installed_wheels(package: str) -> None:
    pytest.importorskip("cyclonedx")
    files = importlib.metadata.files(package) or []
    contents = [
        (str(file), Path(str(file.locate())).read_bytes()) for file in files if ".so" in file.name
    ]
    libraries = script("bill_of_materials").libraries(package, contents)
    found = {each.project: each.version for each in libraries}
    for library in TABLE["library"]:
        if library["package"] == package:
            assert found[library["project"]] == library["found"], library["project"]


@pytest.mark.skipif(not IS_LINUX, reason="the table is of the wheel for Linux")
@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="the table is of Blender 4.5")
def test_the_versions_are_those_inside_blender() -> None:
    for library in TABLE["library"]:
        if library["package"] != "bpy":
            continue
        name, pattern = STATED_IN_BLENDER[library["project"]]
        path = importlib.metadata.distribution("bpy").locate_file(name)
        with (
            Path(str(path)).open("rb") as file,
            mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
        ):
            found = {match[1].decode() for match in re.finditer(pattern, content)}
        assert library["found"] in found, library["project"]


@pytest.mark.parametrize(
    "head",
    [
        b"v/1\x01\x02\0\0\0channels\0chlist\0",  # OpenEXR
        b"\0\0\0\x0cjP  \r\n\x87\n\0\0\0\x14ftypjp2 ",  # JPEG 2000
        b"\xff\x4f\xff\x51\0\x2f",
    ],
)
def test_pictures_of_other_libraries_are_refused_by_their_content(
    tmp_path: Path, head: bytes
) -> None:
    path = tmp_path / "picture.png"
    path.write_bytes(head + bytes(500))
    with pytest.raises(VideoError, match="not supported"):
        is_picture(path)


def test_opencv_is_given_no_file_no_address_and_no_network() -> None:
    """It would decode them with its own FFmpeg, open addresses with its own OpenSSL, and read
    networks with its own Protobuf.
    """
    opens = re.compile(r"\bcv2\.(imread\w*|VideoCapture|dnn\.read\w*|FileStorage)")
    found = {
        (path.relative_to(ROOT).as_posix(), name)
        for path in (ROOT / "scope_addon").rglob("*.py")
        for name in opens.findall(path.read_text("utf-8"))
    }
    assert found == {("scope_addon/live/camera.py", "VideoCapture")}
