# SPDX-License-Identifier: GPL-3.0-or-later
"""Correcting an FBX file: lengths in centimetres, the format's own unit, time from zero, and the
take's name.

Unreal interprets lengths as centimetres whatever unit the file states. Blender either writes metres
or scales every object by 100, which becomes the scale of a skeleton's root. Therefore all lengths
in the file are multiplied and no object is scaled: vertices and shapes, translations and their
curves, the translations in bind matrices, and the lengths of cameras. The scale of the user's own
objects goes into the lengths below them, see `fbx_scale.py`.

Blender's exporter starts at the time of the scene's first frame, which is 1/20 s at frame 1 and 20
frames per second, and names the take after the scene. It numbers objects at random and writes the
time of day; here both are replaced, so that the same motion gives the same file.

The file is read and written with the parser and the encoder of Blender's FBX add-on, which need not
be enabled.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import OutputError
from .fbx_scale import Node, below, fold_scales, properties

# The encoder's methods by the letter code of a property's type.
_ADD = {
    "Z": "add_int8",
    "Y": "add_int16",
    "I": "add_int32",
    "L": "add_int64",
    "B": "add_bool",
    "C": "add_char",
    "F": "add_float32",
    "D": "add_float64",
    "R": "add_bytes",
    "S": "add_string",
    "i": "add_int32_array",
    "l": "add_int64_array",
    "f": "add_float32_array",
    "d": "add_float64_array",
    "b": "add_bool_array",
    "c": "add_byte_array",
}
_MATRICES = (b"Matrix", b"Transform", b"TransformLink", b"TransformAssociateModel")
_TRANSLATION = slice(12, 15)  # of a matrix's 16 elements
_SEPARATOR = b"\0\x01"  # between an object's name and its class
# The moment that Blender's exporter writes as the file's CreationTime.
_CREATED = {
    b"Year": 1970,
    b"Month": 1,
    b"Day": 1,
    b"Hour": 10,
    b"Minute": 0,
    b"Second": 0,
    b"Millisecond": 0,
}
_FIRST_ID = 1_000_000
_LIMITS = (b"LocalStart", b"LocalStop", b"ReferenceStart", b"ReferenceStop")
_LENGTHS = (
    *(b"Lcl Translation", b"Size"),
    *(
        b"Position",
        b"InterestPosition",
        b"NearPlane",
        b"FarPlane",
        b"BackPlaneDistance",
        b"FocusDistance",
    ),
)


def correct_fbx(path: Path, take: str) -> None:
    """Rewrite the file in centimetres, with its take starting at 0 s and named ``take``.

    :raises OSError: when the file is not a binary FBX file, or cannot be written.
    :raises OutputError: when Blender's add-on lacks the parser or the encoder.
    """
    try:
        from io_scene_fbx import encode_bin, parse_fbx  # importable after bpy
    except ImportError as error:
        raise OutputError(
            "this Blender's FBX add-on cannot write centimetres; export .glb instead"
        ) from error
    root, version = parse_fbx.parse(str(path))
    settings = {p.props[0]: p for node in below(root, b"GlobalSettings") for p in properties(node)}
    factor = settings[b"UnitScaleFactor"].props[-1]  # in centimetres
    if factor != 1.0:
        for name in (b"UnitScaleFactor", b"OriginalUnitScaleFactor"):
            settings[name].props[-1] = 1.0
        _multiply_lengths(root, factor)
    fold_scales(root)
    _start_at_zero(root)
    _name_take(root, take.encode())
    _number_objects(root)
    _set_creation_time(root)
    encode_bin.write(str(path), _encoded(root, encode_bin.FBXElem), version)


def _start_at_zero(root: Node) -> None:
    """Subtract the start of the take from the times of all keys and from the take's limits, in
    place.
    """
    stacks = [
        node for objects in below(root, b"Objects") for node in below(objects, b"AnimationStack")
    ]
    limits = [p for stack in stacks for p in properties(stack) if p.props[0] in _LIMITS]
    # The format's own ticks, as the exporter has rounded them; it omits a start at 0.
    ticks = next((limit.props[-1] for limit in limits if limit.props[0] == b"LocalStart"), 0)
    for node in (child for objects in below(root, b"Objects") for child in objects.elems):
        for times in below(node, b"KeyTime") if node.id == b"AnimationCurve" else ():
            np.frombuffer(times.props[0], np.int64)[:] -= ticks
    for limit in limits:
        limit.props[-1] -= ticks
    for take in (child for takes in below(root, b"Takes") for child in below(takes, b"Take")):
        for span in below(take, b"LocalTime", b"ReferenceTime"):
            span.props[:] = [time - ticks for time in span.props]


def _name_take(root: Node, name: bytes) -> None:
    """Give the only take and its animation stack a name, in place."""
    for stack in (
        node for objects in below(root, b"Objects") for node in below(objects, b"AnimationStack")
    ):
        stack.props[1] = name + stack.props[1][stack.props[1].index(_SEPARATOR) :]
    for takes in below(root, b"Takes"):
        for current in below(takes, b"Current"):
            current.props[0] = name if current.props[0] else b""
        for take in below(takes, b"Take"):
            take.props[0] = name


def _number_objects(root: Node) -> None:
    """Replace the numbers of the document and the objects by their order in the file, in place."""
    listed = [
        node
        for top in below(root, b"Documents", b"Objects")
        for node in top.elems
        if node.props_type[:1] == b"L"
    ]
    number = {node.props[0]: _FIRST_ID + place for place, node in enumerate(listed)}
    holders: list[tuple[Node, tuple[int, ...]]] = [(node, (0,)) for node in listed]
    poses = (node for node in listed if node.id == b"Pose")
    holders += [
        (n, (0,))
        for pose in poses
        for each in below(pose, b"PoseNode")
        for n in below(each, b"Node")
    ]
    holders += [(link, (1, 2)) for top in below(root, b"Connections") for link in below(top, b"C")]
    for node, places in holders:
        for place in places:
            node.props[place] = number.get(node.props[place], node.props[place])  # 0 is the scene


def _set_creation_time(root: Node) -> None:
    """Set the time of creation to a fixed one, in place."""
    for header in below(root, b"FBXHeaderExtension"):
        for part in (part for stamp in below(header, b"CreationTimeStamp") for part in stamp.elems):
            part.props[0] = _CREATED.get(part.id, part.props[0])


def _multiply_lengths(root: Node, factor: float) -> None:
    """Multiply all lengths in the file, in place."""
    translations = _translation_curves(root)
    for node in (child for objects in below(root, b"Objects") for child in objects.elems):
        for holder in _length_holders(node, translations):
            _multiply(holder, factor)
        if node.id in (b"Pose", b"Deformer"):
            for holder in (node, *below(node, b"PoseNode")):
                for matrix in below(holder, *_MATRICES):
                    _multiply(matrix, factor, _TRANSLATION)


def _length_holders(node: Node, translations: set[int]) -> Iterable[Node]:
    """Return the nodes below an object node all of whose numbers are lengths."""
    if node.id == b"Geometry":
        return below(node, b"Vertices")
    if node.id in (b"Model", b"NodeAttribute"):
        return (p for p in properties(node) if p.props[0] in _LENGTHS)
    if node.id == b"AnimationCurveNode" and node.props[0] in translations:
        return properties(node)
    if node.id == b"AnimationCurve" and node.props[0] in translations:
        return below(node, b"KeyValueFloat")
    return ()


def _multiply(node: Node, factor: float, only: slice = slice(None)) -> None:
    """Multiply a node's doubles, and the selected elements of its arrays of floats and doubles, in
    place.
    """
    for index, kind in enumerate(node.props_type.decode()):
        if kind == "D":
            node.props[index] *= factor
        elif kind in "fd":
            np.frombuffer(node.props[index], kind)[only] *= factor


def _translation_curves(root: Node) -> set[int]:
    """Return the ids of the curve nodes that animate a model's translation, and of their curves."""
    links = [
        c.props
        for node in below(root, b"Connections")
        for c in below(node, b"C")
        if c.props[0] == b"OP"
    ]
    nodes = {link[1] for link in links if link[3] == b"Lcl Translation"}
    return nodes | {link[1] for link in links if link[2] in nodes}


def _encoded(node: Node, element: Any) -> Any:
    """Convert a node and its children to the encoder's class ``element``."""
    out = element(node.id)
    for kind, value in zip(node.props_type.decode(), node.props, strict=True):
        getattr(out, _ADD[kind])(value)
    out.elems = [_encoded(child, element) for child in node.elems]
    return out
