# SPDX-License-Identifier: GPL-3.0-or-later
"""Turns an FBX file of metres into one of centimetres, the format's own unit.

Unreal takes lengths for centimetres whatever the file says, and Blender either writes metres or scales every object by
100, which becomes the scale of a skeleton's root. So all lengths in the file are multiplied, and no object is scaled:
vertices and shapes, translations and their curves, the translations in bind matrices, and what a camera measures.

Source: the layout of binary FBX 7.4: nodes of (end, properties, their size, name), their properties, nested nodes and
a null record; arrays that may be compressed by zlib; a footer, padded to 16 bytes.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_HEAD = b"Kaydara FBX Binary\x20\x20\x00\x1a\x00"
_NULL = bytes(13)
_FIXED = {b"Y": 2, b"C": 1, b"B": 1, b"I": 4, b"F": 4, b"D": 8, b"L": 8}
_ARRAYS = {b"f": "<f4", b"d": "<f8", b"l": "<i8", b"i": "<i4", b"b": "u1", b"c": "u1"}
_FOOTER_ID, _FOOTER_TAIL = 20, 140  # bytes before and after the footer's padding
_MATRICES = (b"Matrix", b"Transform", b"TransformLink", b"TransformAssociateModel")
_LENGTHS = (
    *(b"Lcl Translation", b"Size"),
    *(b"Position", b"InterestPosition", b"NearPlane", b"FarPlane", b"BackPlaneDistance", b"FocusDistance"),
)


@dataclass
class _Node:
    name: bytes
    types: list[bytes]
    values: list[bytes]  # as they are in the file
    children: list[_Node]
    ended: bool  # whether a null record follows the children, which also some childless nodes have

    def below(self, *names: bytes) -> Iterator[_Node]:
        """The children of these names, or all."""
        return (child for child in self.children if not names or child.name in names)

    def text(self, index: int) -> bytes:
        return self.values[index][4:] if index < len(self.values) and self.types[index] == b"S" else b""

    def number(self, index: int) -> int:
        return struct.unpack("<q", self.values[index])[0]

    def multiply(self, factor: float, only: slice = slice(None)) -> None:
        """Its doubles, and those elements of its arrays of them."""
        for index, kind in enumerate(self.types):
            if kind == b"D":
                self.values[index] = struct.pack("<d", factor * struct.unpack("<d", self.values[index])[0])
            elif kind in (b"d", b"f"):
                array = _array(kind, self.values[index]).copy()
                array[only] *= factor
                self.values[index] = _packed(array)


def metres_to_centimetres(path: Path) -> None:
    """Rewrite the file in centimetres; one that is in centimetres already stays as it is.

    :raises OSError: it is no binary FBX file of the version that Blender writes, or cannot be written.
    """
    data = path.read_bytes()
    (version,) = struct.unpack_from("<I", data, len(_HEAD)) if data.startswith(_HEAD) else (0,)
    if not 7000 <= version < 7500:
        raise OSError(f"{path} is no FBX file of version 7.4")
    nodes, end = _read_nodes(data, len(_HEAD) + 4, len(data))
    root = _Node(b"", [], [], nodes, True)
    unit = next(
        p for g in root.below(b"GlobalSettings") for p in _properties(g) if p.text(0) == b"UnitScaleFactor"
    )  # in centimetres
    factor = struct.unpack("<d", unit.values[-1])[0]
    if factor == 1.0:
        return
    for settings in root.below(b"GlobalSettings"):
        for p in _properties(settings):
            if p.text(0) in (b"UnitScaleFactor", b"OriginalUnitScaleFactor"):
                p.values[-1] = struct.pack("<d", 1.0)
    _multiply_lengths(root, factor)
    out = [_HEAD, data[len(_HEAD) : len(_HEAD) + 4]]
    position = len(_HEAD) + 4
    for node in root.children:
        blob = _written(node, position)
        out.append(blob)
        position += len(blob)
    footer = data[end + len(_NULL) :]
    before, after = footer[:_FOOTER_ID], footer[-_FOOTER_TAIL:]
    padding = 16 - (position + len(_NULL) + len(before)) % 16
    path.write_bytes(b"".join([*out, _NULL, before, bytes(padding), after]))


def _multiply_lengths(root: _Node, factor: float) -> None:
    moved = _curves_of_translations(root)
    translation = slice(12, 15)
    for node in (child for objects in root.below(b"Objects") for child in objects.children):
        if node.name == b"Geometry":
            for vertices in node.below(b"Vertices"):
                vertices.multiply(factor)
        elif node.name in (b"Model", b"NodeAttribute"):
            for p in _properties(node):
                if p.text(0) in _LENGTHS:
                    p.multiply(factor)
        elif node.name in (b"Pose", b"Deformer"):
            for holder in (node, *node.below(b"PoseNode")):
                for matrix in holder.below(*_MATRICES):
                    matrix.multiply(factor, translation)
        elif node.name == b"AnimationCurveNode" and node.number(0) in moved:
            for p in _properties(node):
                p.multiply(factor)
        elif node.name == b"AnimationCurve" and node.number(0) in moved:
            for values in node.below(b"KeyValueFloat"):
                values.multiply(factor)


def _curves_of_translations(root: _Node) -> set[int]:
    """Numbers of the curve nodes that move a model, and of their curves."""
    links = [c for connections in root.below(b"Connections") for c in connections.below(b"C") if c.text(0) == b"OP"]
    nodes = {c.number(1) for c in links if c.text(3) == b"Lcl Translation"}
    return nodes | {c.number(1) for c in links if c.number(2) in nodes}


def _properties(node: _Node) -> list[_Node]:
    return [p for block in node.below(b"Properties70") for p in block.below(b"P")]


def _read_nodes(data: bytes, position: int, end: int) -> tuple[list[_Node], int]:
    """The nodes up to a null record, or to the end; and where that is."""
    nodes = []
    while position < end and data[position : position + 13] != _NULL:
        stop, count, _, size = struct.unpack_from("<3IB", data, position)
        name = data[position + 13 : position + 13 + size]
        at = position + 13 + size
        types, values = [], []
        for _ in range(count):
            kind = data[at : at + 1]
            length = _length(kind, data, at + 1)
            types.append(kind)
            values.append(data[at + 1 : at + 1 + length])
            at += 1 + length
        children, _ = _read_nodes(data, at, stop) if at < stop else ([], at)
        nodes.append(_Node(name, types, values, children, at < stop))
        position = stop
    return nodes, position


def _length(kind: bytes, data: bytes, at: int) -> int:
    """Bytes that the value of a property takes."""
    if kind in _FIXED:
        return _FIXED[kind]
    if kind in (b"S", b"R"):
        return 4 + struct.unpack_from("<I", data, at)[0]
    if kind in _ARRAYS:
        count, compressed, size = struct.unpack_from("<3I", data, at)
        return 12 + (size if compressed else count * np.dtype(_ARRAYS[kind]).itemsize)
    raise OSError(f"an FBX file has a property of the unknown type {kind!r}")


def _array(kind: bytes, value: bytes) -> np.ndarray:
    compressed = struct.unpack_from("<3I", value)[1]
    return np.frombuffer(zlib.decompress(value[12:]) if compressed else value[12:], _ARRAYS[kind])


def _packed(array: np.ndarray) -> bytes:
    content = array.tobytes()
    compressed = zlib.compress(content, 1) if len(content) > 128 else content
    return struct.pack("<3I", array.size, compressed is not content, len(compressed)) + compressed


def _written(node: _Node, position: int) -> bytes:
    """A node's bytes, which begin at that position of the file."""
    properties = b"".join(kind + value for kind, value in zip(node.types, node.values, strict=True))
    head = 13 + len(node.name)
    at = position + head + len(properties)
    nested = []
    for child in node.children:
        blob = _written(child, at)
        nested.append(blob)
        at += len(blob)
    if node.ended:
        nested.append(_NULL)
        at += len(_NULL)
    start = struct.pack("<3IB", at, len(node.types), len(properties), len(node.name)) + node.name
    return b"".join([start, properties, *nested])
