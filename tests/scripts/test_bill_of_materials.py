# SPDX-License-Identifier: GPL-3.0-or-later
"""The bill of materials: valid, the same when repeated, and true to what the packages contain."""

from __future__ import annotations

import ctypes
import hashlib
import json
import sys
import zipfile
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

import pytest

from .script_modules import ROOT, script

SHIPPED = ("numba", "llvmlite", "onnxruntime", "opencv-contrib-python-headless", "av")
MADE = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
OPUS = b"\0libopus 1.6.1\0"
BUILD_INFORMATION = (
    b"General configuration for OpenCV 9\n  3rdparty dependencies:       %s\n  PNG:  build (ver "
    b"1.6.43)\n"
)


@pytest.fixture(scope="module")
def bills():
    return script("bill_of_materials")


@pytest.fixture(scope="module")
def installed(bills):
    """The libraries in each shipped package, as pip has installed it from the wheel."""
    found = {}
    for package in SHIPPED:
        files = [
            f
            for f in metadata.files(package)
            if bills.library_name(str(f)) or str(f).startswith("cv2/cv2")
        ]
        found[package] = bills.libraries(
            package, ((str(f), f.locate().read_bytes()) for f in files)
        )
    return found


def wheel(folder, name, version, files):
    path = folder / f"{name}-{version}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(
            f"{name}-{version}.dist-info/METADATA",
            f"Name: {name}\nVersion: {version}\nLicense-Expression: MIT\n",
        )
        for inside, content in files.items():
            file.writestr(inside, content)
    return path


@pytest.fixture
def extension(tmp_path):
    """A staged extension with one network, and its wheel with one library."""
    staged = tmp_path / "staged"
    (staged / "assets" / "networks").mkdir(parents=True)
    (staged / "assets" / "networks" / "pose.onnx").write_bytes(b"network")
    (staged / "assets" / "kernels" / "part").mkdir(parents=True)
    (staged / "assets" / "kernels" / "part" / "kernel.code").write_bytes(b"code")
    (staged / "blender_manifest.toml").write_text('version = "0.1.0"\n')
    (staged / "THIRD_PARTY.md").write_text("| Opus | BSD-3-Clause | made L |\n")
    return staged, [wheel(tmp_path, "made", "1.0", {"made.libs/libopus-0123abcd.so.0.11.1": OPUS})]


@pytest.mark.parametrize(
    ("file", "name", "version"),
    [
        ("av.libs/libx264-d6533a8d.so.165", "libx264", "165"),
        ("opencv.libs/libopenblas-r0-f650aae0.3.3.so", "libopenblas", "0.3.3"),
        ("av.libs/libstdc++-6-2d5c346d47ad531ef9f5185db0e8cef3.dll", "libstdc++", "6"),
        ("cv2/.dylibs/libSvtAv1Enc.2.2.0.dylib", "libSvtAv1Enc", "2.2.0"),
        ("cv2/opencv_videoio_ffmpeg4110_64.dll", "opencv_videoio_ffmpeg", ""),
    ],
)
def test_a_librarys_name_is_read_from_its_file(bills, file, name, version):
    assert bills.library_name(file) == (name, version)


@pytest.mark.slow
def test_third_party_states_what_the_installed_packages_contain(bills, installed):
    """The wheels of other platforms are compared by the build."""
    text = (ROOT / "THIRD_PARTY.md").read_text("utf-8")
    for package, found in installed.items():
        assert bills.check_third_party(package, "linux-x64", found, text) == []
    assert len(installed["av"]) > 20
    without = text.replace("| x264 |", "| x2640 |")
    problems = bills.check_third_party("av", "linux-x64", installed["av"], without)
    assert problems == [
        "av contains x264, which THIRD_PARTY.md lacks",
        "THIRD_PARTY.md has x2640, which av lacks",
    ]
    wrong = text.replace("| x264 | GPL-2.0-or-later |", "| x264 | MIT |")
    (problem,) = bills.check_third_party("av", "linux-x64", installed["av"], wrong)
    assert problem == "THIRD_PARTY.md states MIT for x264 of av, not GPL-2.0-or-later"


@pytest.mark.slow
def test_licences_that_conflict_with_ours_are_named(bills, installed):
    found = {
        f"{library.project} {library.version}"
        for every in installed.values()
        for library in bills.conflicts(every)
    }
    assert found == {"OpenSSL 1.1.1w", "Intel IPP ICV 2021.12.0"}
    said = (
        (ROOT / "docs" / "publishing.md")
        .read_text("utf-8")
        .partition("### Licences that conflict")[2]
    )
    for name in ("OpenSSL 1.1.1w", "Intel IPP ICV", "Microsoft C++ runtime"):
        assert name in said


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the libraries are of Linux")
def test_versions_are_those_that_the_libraries_themselves_return(installed):
    """Of libraries that say it in a function or a variable; the number in a file's name is
    another.
    """
    where = metadata.distribution("av").locate_file("")
    files = {library.project: library for library in installed["av"]}
    functions = {
        "dav1d": "dav1d_version",
        "LAME": "get_lame_version",
        "ALSA": "snd_asoundlib_version",
        "Opus": "opus_get_version_string",
        "SVT-AV1": "svt_av1_get_version",
        "libvpx": "vpx_codec_version_str",
    }
    said = {}
    for project, name in functions.items():
        function = getattr(ctypes.CDLL(str(where / files[project].file)), name)
        function.restype = ctypes.c_char_p
        said[project] = function().decode().removeprefix("libopus ").removeprefix("v")
    for project, name in {"GMP": "__gmp_version", "x265": "x265_version_str"}.items():
        library = ctypes.CDLL(str(where / files[project].file))
        said[project] = ctypes.c_char_p.in_dll(library, name).value.decode()
    assert {project: files[project].version for project in said} == said
    assert all(files[project].soname != files[project].version for project in ("GMP", "x265"))


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the packages are of Linux")
def test_versions_of_a_distributions_packages_are_those_that_the_wheels_own_bill_states(installed):
    files = metadata.files("av")
    (own,) = [file for file in files if str(file).endswith("sboms/auditwheel.cdx.json")]
    stated = {part["name"]: part["version"] for part in json.loads(own.read_text())["components"]}
    for library in installed["av"]:
        name = Path(library.file).name.partition("-")[0]
        if name in stated:
            assert library.version == stated[name]
    assert {"libxcb", "libXau", "libdrm"} <= set(stated)


def test_a_number_in_a_files_name_is_no_version(bills):
    """Except for projects of which it is known; what looks like several versions is none."""
    libraries = {
        library.project: (library.version, library.soname)
        for library in bills.libraries(
            "made",
            [
                ("made.libs/libnettle-0a1b2c3d.so.8.11", b""),
                ("made.libs/libgmp-0a1b2c3d.so.10.5.0", b"\x006.3.0\x00"),
                ("made.libs/libasound-0a1b2c3d.so.2.0.0", b"\x001.2.14\x00, not \x001.0.0\x00"),
                ("made/.dylibs/libzstd.1.5.6.dylib", b""),
                (
                    "made.libs/libiconv-2-0a1b2c3d.dll",
                    "ProductVersion\x001.19\0\0".encode("utf-16-le"),
                ),
                ("made.libs/libX11.6.dylib", b"/Cellar/libx11/1.8.10/share"),
                (
                    "made.libs/libdrm-0a1b2c3d.so.2.4.0",
                    b"libdrm.so.2.4.0-2.4.115-2.el8.x86_64.debug",
                ),
            ],
        )
    }
    assert libraries == {
        "ALSA": ("", "2.0.0"),
        "GMP": ("6.3.0", "10.5.0"),
        "Nettle": ("", "8.11"),
        "Zstandard": ("1.5.6", ""),
        "libiconv": ("1.19", "2"),
        "X11": ("1.8.10", "6"),
        "libdrm": ("2.4.115-2.el8", "2.4.0"),
    }


def test_a_licence_of_old_versions_is_found_by_a_files_number_where_it_states_no_version(bills):
    (library,) = bills.libraries("made", [("made.libs/libcrypto-0a1b2c3d.so.1.1", b"")])
    assert (library.version, library.licence) == ("", "OpenSSL")
    assert bills.conflicts([library])


def test_every_listed_library_is_documented(bills):
    text = (ROOT / "THIRD_PARTY.md").read_text("utf-8")
    for project in bills.PROJECTS:
        assert f"| {project.removesuffix(' in cv2')} | " in text


def test_a_library_that_is_not_listed_is_refused(bills):
    with pytest.raises(SystemExit, match="made contains made.libs/libnew.so.1, which is not in"):
        bills.libraries("made", [("made.libs/libnew.so.1", b"")])
    with pytest.raises(SystemExit, match="contains libnew in cv2/cv2.abi3.so"):
        bills.libraries("made", [("cv2/cv2.abi3.so", BUILD_INFORMATION % b"libpng libnew")])
    (png,) = bills.libraries("made", [("cv2/cv2.abi3.so", BUILD_INFORMATION % b"libpng")])
    assert (png.version, png.licence) == ("1.6.43", "libpng-2.0")


@pytest.mark.slow
def test_a_bill_is_valid_and_has_all_parts(bills, extension):
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    staged, wheels = extension
    text = bills.bill_of_materials(staged, wheels, "linux-x64", MADE)
    validator = JsonStrictValidator(SchemaVersion.V1_6)
    assert validator.validate_str(text) is None
    assert validator.validate_str(text.replace('"SHA-256"', '"SHA-257"')) is not None
    bill = json.loads(text)
    assert bill["metadata"]["component"]["version"] == "0.1.0"
    assert bill["metadata"]["timestamp"] == "2026-01-02T03:04:05+00:00"
    parts = {part["name"]: part for part in bill["components"]}
    made = parts["made"]
    network = parts["assets/networks/pose.onnx"]
    code = parts["assets/kernels/part/kernel.code"]
    assert code["licenses"] == [{"expression": "GPL-3.0-or-later AND Apache-2.0"}]
    assert code["hashes"] == [{"alg": "SHA-256", "content": hashlib.sha256(b"code").hexdigest()}]
    assert made["purl"] == "pkg:pypi/made@1.0?file_name=made-1.0-py3-none-any.whl"
    assert made["licenses"] == [{"expression": "MIT"}]
    assert made["hashes"] == [
        {"alg": "SHA-256", "content": hashlib.sha256(wheels[0].read_bytes()).hexdigest()}
    ]
    (opus,) = made["components"]
    assert (opus["name"], opus["version"], opus["purl"]) == (
        "Opus",
        "1.6.1",
        "pkg:generic/opus@1.6.1",
    )
    assert opus["licenses"] == [{"expression": "BSD-3-Clause"}]
    assert {"name": "scope:soname", "value": "0.11.1"} in opus["properties"]
    assert opus["hashes"] == [{"alg": "SHA-256", "content": hashlib.sha256(OPUS).hexdigest()}]
    assert network["type"] == "machine-learning-model"
    assert network["licenses"] == [{"expression": "Apache-2.0"}]
    assert network["hashes"] == [
        {"alg": "SHA-256", "content": hashlib.sha256(b"network").hexdigest()}
    ]
    (needed,) = [d["dependsOn"] for d in bill["dependencies"] if d["ref"] == "scope"]
    assert needed == sorted([made["bom-ref"], network["bom-ref"], code["bom-ref"]])
