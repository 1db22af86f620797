# SPDX-License-Identifier: GPL-3.0-or-later
"""The rig file that a motion is retargeted to, checked before Blender's importers read it. Free of
bpy, so that the command line can check it first.

The importer of FBX unpacks whatever the arrays of a file hold, and the importer of glTF trusts
every number and every file name in it.

A binary FBX file is a tree of nodes: end offset, number and size of properties, name, properties,
children. A property is a letter for its type and a value; those of arrays have a number of
elements, whether they are compressed with zlib, and the size in the file. Source: the description
of the format by the Blender developers (Binary FBX file structure, 2013). Of glTF: the 2.0
specification, sections 3.6 (buffers, accessors), 3.8 (images) and 4 (binary files).
"""

from __future__ import annotations

import base64
import binascii
import json
import re
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...solver.errors import InputError
from ..errors import UsageError
from ..untrusted.files import check_regular
from .bone_map import BoneMap, check_bone_count, load_bone_map
from .expression_map import ExpressionMap, load_expression_map

_LARGEST_BYTES = 4 << 30
ROOTS = ("bone", "object", "in-place")  # Where a rig stores the root motion.
RIG_SUFFIXES = (".blend", ".fbx", ".glb", ".gltf", ".vrm")
_SIGNATURES = {
    ".blend": (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b"),  # plain, Zstandard, gzip
    ".fbx": (b"Kaydara FBX Binary",),
    ".glb": (b"glTF",),
    ".vrm": (b"glTF",),  # an avatar in a .glb
}
_HEADER_BYTES = 27
_BONES = (b"LimbNode", b"Limb")  # kinds of the nodes named Model
_SCALAR_BYTES = {"C": 1, "B": 1, "Y": 2, "I": 4, "F": 4, "D": 8, "L": 8}
_ELEMENT_BYTES = {"b": 1, "c": 1, "i": 4, "f": 4, "d": 8, "l": 8}
_LARGEST_UNPACKED = 1 << 30  # bytes of all arrays together
_MAX_NODES = 5_000_000
_DEEPEST = 64
_STEP = 1 << 20
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


@dataclass(frozen=True)
class RigSource:
    """A file with a rig, the name of the armature if there are several, and the maps unless they
    are to be guessed.
    """

    path: Path
    armature: str = ""
    bone_map: BoneMap | None = None
    expression_map: ExpressionMap | None = None
    # Bone of each of VRM's parts, if the file says so.
    humanoid: Mapping[str, str] = field(default_factory=dict)
    # What its file refers to, such as textures; known once Blender has read it.
    files: Sequence[Path] = ()


def rig_source(
    path: Path, armature: str = "", bone_map: Path | None = None, expression_map: Path | None = None
) -> RigSource:
    """Check the user's rig file as far as possible without Blender.

    :param armature: name of the armature in the file; may be empty if there is only one.
    :param bone_map: file with a bone map; None to guess one.
    :param expression_map: file with an expression map; None to guess one.
    :raises UsageError: when the suffix is not that of a supported format.
    :raises InputError: when a file cannot be read, or its content does not match its suffix.
    """
    suffix = path.suffix.lower()
    if suffix not in RIG_SUFFIXES:
        raise UsageError(
            f"cannot read a rig from '{path.name}': its suffix must be one of "
            f"{', '.join(RIG_SUFFIXES)}"
        )
    check_regular(path, InputError, "rig", _LARGEST_BYTES)
    try:
        _check_content(path, suffix)
    except OSError as error:
        raise InputError(
            f"{path}: the rig cannot be read ({error.strerror}); choose another file"
        ) from error
    return RigSource(
        path,
        armature,
        load_bone_map(bone_map) if bone_map is not None else None,
        load_expression_map(expression_map) if expression_map is not None else None,
        humanoid_table(path) if suffix in (".vrm", ".glb", ".gltf") else {},
    )


def _check_content(path: Path, suffix: str) -> None:
    """Check that a file is what its suffix says, and complete as far as its structure shows."""
    with path.open("rb") as file:
        header = file.read(32)
    if suffix == ".fbx" and header.lstrip().startswith(b";"):
        raise InputError(f"{path}: Blender does not read FBX as text; save it as binary FBX")
    if suffix in _SIGNATURES and not header.startswith(_SIGNATURES[suffix]):
        raise InputError(
            f"{path}: this is not a {suffix} file; choose the file that holds your rig"
        )
    if suffix == ".fbx":
        check_fbx(path)
    elif suffix != ".blend":
        check_gltf(path)


def check_fbx(path: Path) -> None:
    """Check that nodes lie within the file, that arrays unpack to what they say, a gigabyte in all
    at most, and that there are not too many bones.

    :raises InputError: they do not.
    :raises OSError: the file cannot be read.
    """
    try:
        checker = _Checker(memoryview(path.read_bytes()))
        checker.check()
    except (ValueError, IndexError, struct.error, zlib.error) as error:
        raise InputError(
            f"{path}: this FBX file is damaged ({error}); export it again or choose another"
        ) from error
    check_bone_count(str(path), checker.bones)


class _Checker:
    def __init__(self, data: memoryview) -> None:
        self._data = data
        self._unpacked = self._nodes = 0
        self.bones = 0
        (version,) = struct.unpack_from("<I", data, 23)
        self._node = struct.Struct("<QQQB" if version >= 7500 else "<IIIB")

    def check(self) -> None:
        """Check everything.

        :raises ValueError: the file is damaged or too large; also struct.error, IndexError and
            zlib.error.
        """
        self._check_nodes(_HEADER_BYTES, len(self._data), 0)

    def _check_nodes(self, at: int, end: int, depth: int) -> None:
        """Check sibling nodes, the last of which is a record of zeros."""
        if depth > _DEEPEST:
            raise ValueError("its nodes are nested too deeply")
        while at < end:
            self._nodes += 1
            if self._nodes > _MAX_NODES:
                raise ValueError("it has too many nodes")
            node_end, count, size, name = self._node.unpack_from(self._data, at)
            if node_end == 0:
                return
            start = at + self._node.size + name
            if not start + size <= node_end <= end:
                raise ValueError("a node does not lie within its parent")
            self._check_properties(start, start + size, count)
            if bytes(self._data[start - name : start]) == b"Model":
                self.bones += bytes(self._data[start : start + size]).endswith(_BONES)
            self._check_nodes(start + size, node_end, depth + 1)
            at = node_end

    def _check_properties(self, at: int, end: int, count: int) -> None:
        for _ in range(count):
            kind = chr(self._data[at])
            at += 1
            if kind in _SCALAR_BYTES:
                at += _SCALAR_BYTES[kind]
            elif kind in _ELEMENT_BYTES:
                length, encoding, size = struct.unpack_from("<III", self._data, at)
                at += 12 + size
                if at > end:
                    raise ValueError("an array does not lie within its node")
                self._check_array(
                    at - size, at, length * _ELEMENT_BYTES[kind], compressed=encoding == 1
                )
            elif kind in "SR":
                at += 4 + struct.unpack_from("<I", self._data, at)[0]
            else:
                raise ValueError(f"it has a property of type {kind!r}")
            if at > end:
                raise ValueError("a property does not lie within its node")

    def _check_array(self, start: int, end: int, wanted: int, *, compressed: bool) -> None:
        self._unpacked += wanted
        if self._unpacked > _LARGEST_UNPACKED:
            raise ValueError("its arrays are too large")
        if not compressed:
            size = end - start
        else:
            unpack = zlib.decompressobj()
            size = 0
            rest = bytes(self._data[start:end])
            while rest and not unpack.eof and size <= wanted:
                size += len(unpack.decompress(rest, _STEP))
                rest = unpack.unconsumed_tail
        if size != wanted:
            raise ValueError("an array does not have the size that it declares")


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


def files_beside_gltf(path: Path) -> list[Path]:
    """Return the files that a .gltf or .glb refers to, which `check_gltf` has checked.

    :raises OSError: the file cannot be read.
    """
    gltf, _ = _read(path)
    named = [each.get("uri") for kind in ("buffers", "images") for each in gltf.get(kind, ())]
    uris = [uri for uri in named if uri is not None and not uri.startswith("data:")]
    return [path.resolve().parent / _decoded(uri) for uri in uris]


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
