# SPDX-License-Identifier: GPL-3.0-or-later
"""A zip's bill of materials: every package, every library inside its wheels, and every network and
body, and the compiled solver, with hashes.

The format is CycloneDX 1.6 in JSON. Wheels and their files are read; scripts/native_libraries.toml
says what a library is and under which licence. A wheel with a library that is not listed there is
refused, so that none enters unseen.
"""

from __future__ import annotations

import fnmatch
import hashlib
import re
import tomllib
import uuid
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from email.message import Message
from email.parser import Parser
from pathlib import Path, PurePosixPath
from typing import Any

from cyclonedx.model import HashAlgorithm, HashType, Property
from cyclonedx.model.bom import Bom, BomMetaData
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.model.license import LicenseExpression
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL

TABLE = tomllib.loads(Path(__file__).with_name("native_libraries.toml").read_text("utf-8"))
PROJECTS = TABLE["projects"]
# The assets that are not sources or documentation, and the licence of each folder.
ASSETS = {
    "assets/networks/*.onnx": "Apache-2.0",
    "assets/lifter/*.onnx": "GPL-3.0-or-later",
    "assets/prior/*.npz": "GPL-3.0-or-later",
    "assets/face/*.npz": "GPL-3.0-or-later",
    "assets/face/controls/*.json": "CC0-1.0",
    "assets/body/*.npz": "CC0-1.0",
    "assets/kernels/*": "GPL-3.0-or-later AND Apache-2.0",
    "assets/sample/*.mp4": "CC0-1.0",
}
# of the serial numbers, each made from the content
_NAMESPACE = uuid.UUID("5a3bb3f0-6b5e-4a5c-9d0e-0f3c5a9b1d27")
_EXTENSION_MODULE = re.compile(r"(\.(abi3|cpython-[\w-]+)\.so|\.pyd)$")
# What names the file of its debugging information, in distributions with RPM packages; and the
# version of a product in the resources of a file for Windows, in UTF-16.
_OF_PACKAGE = rb"\.so\.[\d.]+-(\d[\w.]*-[\w.]+)\.x86_64\.debug"
_OF_RESOURCE = "ProductVersion".encode("utf-16-le") + rb"\0{2,4}((?:\d\0)+(?:\.\0(?:\d\0)+)+)\0\0"
_SHORT = {"opencv-contrib-python-headless": "opencv"}  # in THIRD_PARTY.md
_LIBRARY = re.compile(r"^(?P<name>.+?)\.(so|dylib|dll)(?P<end>[.\d]*)$")


@dataclass(frozen=True)
class Library:
    """A library inside a wheel.

    :param project: its name in native_libraries.toml.
    :param version: of its release, as its files state it; empty if they do not.
    :param soname: the number in the file's name, which is another one: that of the interface.
    """

    project: str
    version: str
    soname: str
    licence: str
    file: str
    sha256: str


def library_name(file: str) -> tuple[str, str] | None:
    """Split a file's name into a library's name and version; None for what is no library.

    A Python package's own extension modules are none. Tools that repair wheels add digits of a hash
    to names.
    """
    match = _LIBRARY.match(PurePosixPath(file).name)
    if not match or _EXTENSION_MODULE.search(file):
        return None
    name = re.sub(r"-[0-9a-f]{8,32}(?=\.|$)", "", match["name"])
    # OpenCV's own version in the name of its FFmpeg for Windows
    name = re.sub(r"\d{4}_64$", "", name)
    number = re.search(r"[-.]r?(\d[\d.]*)$", name)
    stem = re.sub(r"([-.]r?\d[\d.]*)+$", "", name)
    if not name.startswith("lib") and match["end"] == "" and PurePosixPath(file).suffix == ".so":
        return None  # macOS: an extension module without a tag
    return stem, match["end"].strip(".") or (number[1] if number else "")


def libraries(package: str, files: Iterable[tuple[str, bytes]]) -> list[Library]:
    """Find the libraries of a package.

    :param files: names and contents of all that it contains.
    :raises SystemExit: a library is not in native_libraries.toml.
    """
    by_file = {
        name: project for project, entry in PROJECTS.items() for name in entry.get("files", ())
    }
    found = []
    stated = {}
    for file, content in files:
        digest = hashlib.sha256(content).hexdigest()
        found += [
            (project, version, "", file, digest)
            for project, version in _inside_opencv(package, file, content)
        ]
        parts = library_name(file)
        if parts is None:
            continue
        name, number = parts
        if name not in by_file:
            raise _unlisted(package, file)
        project = by_file[name]
        entry = PROJECTS[project]
        version = _stated_version(entry, content)
        if version and not entry.get("several"):
            stated[project] = version
        if entry.get("named"):
            version = version or number
            number = ""
        found.append((project, version, number, file, digest))
    projects = {project for project, *_ in found}
    made = []
    for project, own, number, file, digest in found:
        version = own or stated.get(project, "")  # of all files of a project, one may state it
        licence = _licence(project, version or number, projects)
        made.append(Library(project, version, number, licence, file, digest))
    return sorted(made, key=lambda library: (library.project.lower(), library.file))


def _stated_version(entry: dict[str, Any], content: bytes) -> str:
    """Return the version of the release that a library's file states; empty if it does not, or if
    what looks like one is not unique.

    :param entry: of its project in native_libraries.toml.
    """
    patterns = entry.get("version", [])
    searched = [patterns] if isinstance(patterns, str) else patterns
    for pattern in (*(text.encode() for text in searched), _OF_PACKAGE, _OF_RESOURCE):
        versions = {match.replace(b"\0", b"").decode() for match in re.findall(pattern, content)}
        if len(versions) == 1:
            return versions.pop()
    return ""


def _inside_opencv(package: str, file: str, content: bytes) -> Iterator[tuple[str, str]]:
    """Yield the projects, with versions, that OpenCV's description of its build says are part of
    its own file.
    """
    at = content.find(b"General configuration for OpenCV")
    if not PurePosixPath(file).name.startswith("cv2") or at < 0:
        return
    text = content[at : at + 20_000].decode("ascii", "replace")
    line = re.search("3rdparty dependencies: +(.*)", text)
    parts = set(line[1].split()) if line else set()
    known = {entry["part"] for entry in PROJECTS.values() if "part" in entry}
    if parts - known:
        raise _unlisted(package, f"{', '.join(sorted(parts - known))} in {file}")
    for project, entry in PROJECTS.items():
        match = re.search(entry["inside"], text) if "inside" in entry else None
        if entry.get("part") in parts or (match and "part" not in entry):
            yield project, match[1] if match else ""


def _unlisted(package: str, what: str) -> SystemExit:
    return SystemExit(
        f"build: {package} contains {what}, which is not in scripts/native_libraries.toml; add it "
        "there and to "
        "THIRD_PARTY.md, with its licence"
    )


def _licence(project: str, version: str, others: set[str]) -> str:
    """Return the licence of a version of a project, which may have been built with others."""
    for start, licence in TABLE["versions"].items():
        if f"{project} {version}".startswith(start):
            return str(licence)
    for other, licence in TABLE["built_with"].get(project, {}).items():
        if other in others:
            return str(licence)
    return str(PROJECTS[project]["licence"])


def conflicts(found: Iterable[Library]) -> list[Library]:
    """Return the libraries whose licences do not go together with the GPL's version 3 in one
    program.
    """
    return [library for library in found if library.licence in TABLE["conflicts"]["licences"]]


def shown_name(library: Library) -> str:
    """Return the name of a library's project, whether it is a file of its own or part of
    another.
    """
    return library.project.removesuffix(" in cv2")


def wheel_libraries(wheel: Path) -> tuple[Message, list[Library]]:
    """Read a wheel.

    :return: its metadata, and the libraries in it.
    :raises SystemExit: a library is not in native_libraries.toml.
    """
    with zipfile.ZipFile(wheel) as file:
        names = sorted(file.namelist())
        metadata = Parser().parsestr(
            file.read(next(n for n in names if n.endswith(".dist-info/METADATA"))).decode()
        )
        contents = ((name, file.read(name)) for name in names if not name.endswith("/"))
        return metadata, libraries(metadata["Name"], contents)


def wheel_component(wheel: Path) -> tuple[Component, list[Library]]:
    """Describe a wheel; return its component and the libraries in it."""
    metadata, inside = wheel_libraries(wheel)
    package = metadata["Name"]
    version = metadata["Version"]
    licence = metadata["License-Expression"] or TABLE["licences"][package]
    purl = PackageURL("pypi", name=package, version=version, qualifiers={"file_name": wheel.name})
    component = Component(
        name=package,
        version=version,
        type=ComponentType.LIBRARY,
        bom_ref=str(purl),
        purl=purl,
        licenses=[LicenseExpression(licence)],
        hashes=[_sha256(hashlib.sha256(wheel.read_bytes()).hexdigest())],
    )
    for library in inside:
        component.components.add(_library_component(package, library))
    return component, inside


def _library_component(package: str, library: Library) -> Component:
    name = shown_name(library)
    version = library.version or None
    properties = [Property(name="scope:file", value=library.file)]
    if library.soname:
        properties.append(Property(name="scope:soname", value=library.soname))
    return Component(
        name=name,
        version=version,
        type=ComponentType.LIBRARY,
        bom_ref=f"{package}/{library.file}#{library.project}",
        purl=PackageURL("generic", name=name.lower(), version=version) if version else None,
        licenses=[LicenseExpression(library.licence)],
        hashes=[_sha256(library.sha256)],
        properties=properties,
    )


def bill_of_materials(folder: Path, wheels: Iterable[Path], platform: str, made: datetime) -> str:
    """Describe an extension.

    :param folder: the staged extension.
    :param wheels: its wheels, under PyPI's names.
    :param platform: that it is for, as in ``linux-x64``.
    :param made: time that the document states.
    :return: CycloneDX 1.6, JSON. The same content gives the same text.
    :raises SystemExit: the wheels contain libraries that are not listed, or THIRD_PARTY.md states
        other ones.
    """
    version = tomllib.loads((folder / "blender_manifest.toml").read_text("utf-8"))["version"]
    third_party = (folder / "THIRD_PARTY.md").read_text("utf-8")
    root = Component(
        name="scope",
        version=version,
        type=ComponentType.APPLICATION,
        bom_ref="scope",
        licenses=[LicenseExpression("GPL-3.0-or-later")],
    )
    parts = []
    problems = []
    for wheel in sorted(wheels):
        component, inside = wheel_component(wheel)
        parts.append(component)
        problems += check_third_party(component.name, platform, inside, third_party)
    if problems:
        raise SystemExit(f"build: {'; '.join(problems)}")
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        name = path.relative_to(folder).as_posix()
        licence = next(
            (text for pattern, text in ASSETS.items() if fnmatch.fnmatch(name, pattern)), None
        )
        if licence:
            parts.append(_asset_component(name, path, licence))
    bom = Bom(components=parts, metadata=BomMetaData(component=root, timestamp=made))
    content = "".join(
        f"{part.name} {part.version} {next(iter(part.hashes)).content}\n" for part in parts
    )
    bom.serial_number = uuid.uuid5(_NAMESPACE, f"{version}\n{content}")
    bom.register_dependency(root, parts)
    return JsonV1Dot6(bom).output_as_string(indent=2) + "\n"


def check_third_party(
    package: str, platform: str, found: Iterable[Library], text: str
) -> list[str]:
    """Compare the libraries of a package with those that THIRD_PARTY.md states.

    :param platform: of a zip, as in ``linux-x64``.
    :param text: of THIRD_PARTY.md.
    :return: what differs.
    """
    short = _SHORT.get(package, package)
    letter = platform[0].upper()
    stated: dict[str, str] = {}
    for name, licence, places in re.findall(
        r"^\| ([^|]+) \| ([^|]+) \| ((?:\S+ [LMW]+(?:, )?)+) \|$", text, flags=re.M
    ):
        if any(
            place.split()[0] == short and letter in place.split()[1] for place in places.split(", ")
        ):
            stated[name] = licence
    real = {shown_name(library): library.licence for library in found}
    problems = [
        f"{package} contains {name}, which THIRD_PARTY.md lacks"
        for name in sorted(real.keys() - stated.keys())
    ]
    problems += [
        f"THIRD_PARTY.md has {name}, which {package} lacks"
        for name in sorted(stated.keys() - real.keys())
    ]
    for name in sorted(real.keys() & stated.keys()):
        if real[name] not in stated[name].split(" / "):
            problems.append(
                f"THIRD_PARTY.md states {stated[name]} for {name} of {package}, not {real[name]}"
            )
    return problems


def _asset_component(name: str, path: Path, licence: str) -> Component:
    kinds = {".onnx": ComponentType.MACHINE_LEARNING_MODEL, ".code": ComponentType.FILE}
    return Component(
        name=name,
        type=kinds.get(path.suffix, ComponentType.DATA),
        bom_ref=name,
        licenses=[LicenseExpression(licence)],
        hashes=[_sha256(hashlib.sha256(path.read_bytes()).hexdigest())],
    )


def _sha256(digest: str) -> HashType:
    return HashType(alg=HashAlgorithm.SHA_256, content=digest)
