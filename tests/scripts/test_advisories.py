# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of vulnerabilities is of the installed libraries, and what it says to be out of reach
is.
"""

from __future__ import annotations

import ast
import importlib.metadata
import importlib.util
import platform
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from scope.scope_addon.capture.media.still_images import is_picture
from scope.scope_addon.errors import VideoError

ROOT = Path(__file__).resolve().parents[2]
TABLE = tomllib.loads((ROOT / "scripts" / "advisories.toml").read_text("utf-8"))
PACKAGE = "opencv-contrib-python-headless"


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "scripts" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look for their module
    spec.loader.exec_module(module)
    return module


@pytest.mark.skipif(
    (sys.platform, platform.machine()) != ("linux", "x86_64"), reason="the table is of that wheel"
)
def test_the_versions_are_those_of_the_installed_wheel() -> None:
    pytest.importorskip("cyclonedx")
    files = importlib.metadata.files(PACKAGE) or []
    contents = [
        (str(file), Path(str(file.locate())).read_bytes()) for file in files if ".so" in file.name
    ]
    libraries = script("bill_of_materials").libraries(PACKAGE, contents)
    found = {each.project: each.version for each in libraries}
    for library in TABLE["library"]:
        assert found[library["project"]] == library["found"], library["project"]


def test_every_library_says_whether_and_why() -> None:
    for library in TABLE["library"]:
        assert library["advisories"]
        assert isinstance(library["reachable"], bool)
        assert len(library["because"]) > 20


def test_the_audit_prints_them_with_their_date(capsys: pytest.CaptureFixture[str]) -> None:
    script("audit_packages").print_advisories()
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith(f"as of {TABLE['as_of']}:")
    assert len(lines) == 1 + len(TABLE["library"])
    assert any("LibTIFF in cv2 4.6.0" in line and "reachable" in line for line in lines)


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


def test_opencv_is_given_no_file_and_no_address() -> None:
    """It would decode them with its own FFmpeg, and open addresses with its own OpenSSL."""
    opens = {"imread", "imreadmulti", "VideoCapture"}
    found = set()
    for path in (ROOT / "scope_addon").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "cv2":
                if node.attr in opens:
                    found.add((path.relative_to(ROOT).as_posix(), node.attr))
    assert found == {("scope_addon/live/sources/camera.py", "VideoCapture")}
