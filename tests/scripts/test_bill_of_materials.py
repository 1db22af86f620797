# SPDX-License-Identifier: GPL-3.0-or-later
"""The bill of materials: valid, the same when repeated, and true to what the packages contain."""

from __future__ import annotations

import hashlib
import json
import zipfile
from datetime import UTC, datetime
from importlib import metadata

import pytest

from .script_modules import ROOT, script

SHIPPED = ("numba", "llvmlite", "onnxruntime", "opencv-contrib-python-headless", "av")
MADE = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
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
    (staged / "blender_manifest.toml").write_text('version = "0.1.0"\n')
    (staged / "THIRD_PARTY.md").write_text("| Opus | BSD-3-Clause | made L |\n")
    return staged, [
        wheel(tmp_path, "made", "1.0", {"made.libs/libopus-0123abcd.so.0.11.1": b"opus"})
    ]


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
    assert made["purl"] == "pkg:pypi/made@1.0?file_name=made-1.0-py3-none-any.whl"
    assert made["licenses"] == [{"expression": "MIT"}]
    assert made["hashes"] == [
        {"alg": "SHA-256", "content": hashlib.sha256(wheels[0].read_bytes()).hexdigest()}
    ]
    (opus,) = made["components"]
    assert (opus["name"], opus["version"], opus["licenses"]) == (
        "Opus",
        "0.11.1",
        [{"expression": "BSD-3-Clause"}],
    )
    assert opus["hashes"] == [{"alg": "SHA-256", "content": hashlib.sha256(b"opus").hexdigest()}]
    assert network["type"] == "machine-learning-model"
    assert network["licenses"] == [{"expression": "Apache-2.0"}]
    assert network["hashes"] == [
        {"alg": "SHA-256", "content": hashlib.sha256(b"network").hexdigest()}
    ]
    (needed,) = [d["dependsOn"] for d in bill["dependencies"] if d["ref"] == "scope"]
    assert needed == sorted([made["bom-ref"], network["bom-ref"]])
