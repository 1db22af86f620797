# SPDX-License-Identifier: GPL-3.0-or-later
"""Check a glTF file before Blender's importer reads it, which trusts every number and every file
name in it.

Source: the glTF 2.0 specification, sections 3.6 (buffers, accessors), 3.8 (images) and 4 (binary
files).
"""

from __future__ import annotations

import base64
import binascii
import json
import re
import struct
from pathlib import Path
from typing import Any

from ...solver.errors import InputError
from ..untrusted.files import check_regular
from .bone_map import check_bone_count

_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
# Of compressed meshes; Blender reads Draco's.
_UNREADABLE_EXTENSIONS = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_LARGEST_JSON = 200_000_000
_LARGEST_FILE = 2 << 30
_MAX_ELEMENTS = 50_000_000  # Of an accessor without data: its elements are all zero.
_DAMAGED = (
    KeyError,
    IndexError,
    TypeError,
    ValueError,
    AttributeError,
    OverflowError,
    RecursionError,
    struct.error,
)


def check_gltf(path: Path) -> None:
    """Check that all data a .gltf or .glb speaks of is there, in the file itself or in files beside
    it.

    :raises InputError: it is not.
    :raises OSError: the file cannot be read.
    """
    try:
        gltf, binary_bytes = _read(path)
        for extension in gltf.get("extensionsRequired", ()):
            if extension in _UNREADABLE_EXTENSIONS:
                raise InputError(
                    f"{path} is compressed with {extension}, which Blender cannot read; export it "
                    "without this compression, or unpack it with gltf-transform"
                )
        buffers = [_buffer_bytes(path, buffer, binary_bytes) for buffer in gltf.get("buffers", ())]
        for image in gltf.get("images", ()):
            if "uri" in image:
                _uri_bytes(path, image["uri"])
        joints = {node for skin in gltf.get("skins", ()) for node in skin["joints"]}
        check_bone_count(str(path), len(joints))
        views = gltf.get("bufferViews", [])
        for view in views:
            _require(
                _natural(view.get("byteOffset", 0)) + _natural(view["byteLength"])
                <= buffers[view["buffer"]]
            )
        for accessor in gltf.get("accessors", ()):
            _check_accessor(accessor, views)
    except _DAMAGED as error:
        raise InputError(
            f"{path}: this glTF file is damaged; export it again or choose another"
        ) from error


def humanoid_table(path: Path) -> dict[str, str]:
    """Return the bone's name of each of VRM's parts, such as ``leftUpperLeg``; empty without the
    table of VRM 0 or 1.

    :raises InputError: the table is damaged.
    :raises OSError: the file cannot be read.
    """
    try:
        gltf, _ = _read(path)
        extensions = gltf.get("extensions", {})
        nodes = gltf.get("nodes", [])
        if "VRMC_vrm" in extensions:
            entries = extensions["VRMC_vrm"]["humanoid"]["humanBones"]
            node_of = {part: entry["node"] for part, entry in entries.items()}
        elif "VRM" in extensions:
            entries = extensions["VRM"]["humanoid"]["humanBones"]
            node_of = {entry["bone"]: entry["node"] for entry in entries}
        else:
            return {}
        named = {part: nodes[_natural(node)].get("name") for part, node in node_of.items()}
        return {str(part): name for part, name in named.items() if isinstance(name, str)}
    except _DAMAGED as error:
        raise InputError(
            f"{path}: the humanoid table of this avatar is damaged; export it again or choose "
            "another"
        ) from error


def _read(path: Path) -> tuple[dict[str, Any], int]:
    """Return the JSON, and the size of the binary chunk in bytes."""
    check_regular(path, InputError, "rig", _LARGEST_FILE)
    with path.open("rb") as file:
        if path.suffix.lower() == ".gltf":
            text = file.read(_LARGEST_JSON)
            binary_bytes = 0
        else:
            length = struct.unpack("<4xII", file.read(12))[1]
            json_bytes, kind = struct.unpack("<I4s", file.read(8))
            _require(
                kind == b"JSON" and json_bytes <= _LARGEST_JSON and length <= path.stat().st_size
            )
            text = file.read(json_bytes)
            chunk = file.read(8)
            binary_bytes = struct.unpack("<I4x", chunk)[0] if len(chunk) == 8 else 0
            _require(file.tell() + binary_bytes <= path.stat().st_size)
    return json.loads(text), binary_bytes


def _buffer_bytes(path: Path, buffer: dict[str, Any], binary_bytes: int) -> int:
    there = _uri_bytes(path, buffer["uri"]) if "uri" in buffer else binary_bytes
    length = _natural(buffer["byteLength"])
    _require(length <= there)
    return length


def _uri_bytes(path: Path, uri: str) -> int:
    """Return the size of what a URI names: data within it, or a file in the folder of ``path`` or
    below.

    :raises InputError: it names anything else.
    """
    if uri.startswith("data:"):
        head, _, data = uri.partition(",")
        if not head.endswith(";base64"):
            return len(_decoded(data))
        try:
            return len(base64.b64decode(data, validate=True))
        except binascii.Error as error:
            raise ValueError(str(error)) from error
    folder = path.resolve().parent
    target = (folder / _decoded(uri)).resolve()
    if not target.is_relative_to(folder) or ":" in uri.partition("/")[0]:
        raise InputError(
            f"{path} refers to {uri[:80]!r}, outside its own folder; export the rig as one .glb"
        )
    if not target.exists():
        raise InputError(f"{path} needs {uri[:80]!r}, which is missing; put that file beside it")
    check_regular(target, InputError, "rig", _LARGEST_FILE)
    _require(target.is_file())
    return target.stat().st_size


def _decoded(uri: str) -> str:
    """Replace a URI's %XX by the bytes of UTF-8 that they stand for."""
    text = re.sub(
        rb"%([0-9A-Fa-f]{2})", lambda match: bytes.fromhex(match[1].decode()), uri.encode()
    )
    return text.decode()


def _check_accessor(accessor: dict[str, Any], views: list[dict[str, Any]]) -> None:
    count = _natural(accessor["count"])
    item_bytes = _COMPONENT_BYTES[accessor["componentType"]] * _COMPONENTS[accessor["type"]]
    if "bufferView" in accessor:
        _check_within(
            views[accessor["bufferView"]], accessor.get("byteOffset", 0), count, item_bytes
        )
    else:
        _require(count <= _MAX_ELEMENTS)
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        index = sparse["indices"]
        values = sparse["values"]
        changed = _natural(sparse["count"])
        index_bytes = _COMPONENT_BYTES[index["componentType"]]
        _check_within(views[index["bufferView"]], index.get("byteOffset", 0), changed, index_bytes)
        _check_within(views[values["bufferView"]], values.get("byteOffset", 0), changed, item_bytes)


def _check_within(view: dict[str, Any], offset: int, count: int, item_bytes: int) -> None:
    """Check that elements lie within a buffer view."""
    stride = _natural(view.get("byteStride", item_bytes)) or item_bytes
    last = _natural(offset) + (count - 1) * stride + item_bytes if count else 0
    _require(last <= _natural(view["byteLength"]))


def _natural(number: Any) -> int:
    _require(isinstance(number, int) and not isinstance(number, bool) and number >= 0)
    return int(number)


def _require(condition: bool) -> None:
    """Raise ValueError if the file contradicts itself."""
    if not condition:
        raise ValueError("the file contradicts itself")
