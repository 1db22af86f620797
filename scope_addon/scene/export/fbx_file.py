# SPDX-License-Identifier: GPL-3.0-or-later
"""Correcting an FBX file: lengths in centimetres, the format's own unit, time from zero, and the
take's name.

Unreal interprets lengths as centimetres whatever unit the file states. Blender either writes metres
or scales every object by 100, which becomes the scale of a skeleton's root. Therefore all lengths
in the file are multiplied and no object is scaled: vertices and shapes, translations and their
curves, the translations in bind matrices, and the lengths of cameras. The scale of the user's own
objects goes into the lengths below them.

Blender's exporter starts at the time of the scene's first frame, which is 1/20 s at frame 1 and 20
frames per second, and names the take after the scene. It numbers objects at random and writes the
time of day; here both are replaced, so that the same motion gives the same file.

The file is read and written with the parser and the encoder of Blender's FBX add-on, which need not
be enabled.

So every object has scale 1. A rig in centimetres under an object of scale 0.01, as Blender imports
Mixamo's characters, would otherwise pass that scale to the root of its skeleton, where engines
multiply the root motion by it. With s the product of the scales of an object and those above it,
and G its matrix in the world,

    translation' = (s / own scale) translation,   vertices' = s vertices,   G' = G / s (3x3 part),

and for the skin of a mesh m that a bone b moves, with G_b⁻¹ G_m in the file,

    (3x3 part)' = s_b / s_m (3x3 part),    translation' = s_b translation.

Bones are no objects here: they keep their own scale, which may be animated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import OutputError

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
_TRANSLATION = [12, 13, 14]  # of a matrix's 16 elements
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
# The parser's: id, props, props_type (a letter code for each), and elems, the child nodes
Node = Any

_OBJECTS = (b"Null", b"Mesh")
# Scales that differ by less are the same; single precision has seven digits.
_SAME = 1e-5
_LINEAR = [0, 1, 2, 4, 5, 6, 8, 9, 10]


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
    stacks = [node for node in _objects(root) if node.id == b"AnimationStack"]
    limits = [p for stack in stacks for p in properties(stack) if p.props[0] in _LIMITS]
    # The format's own ticks, as the exporter has rounded them; it omits a start at 0.
    ticks = next((limit.props[-1] for limit in limits if limit.props[0] == b"LocalStart"), 0)
    for node in _objects(root):
        for times in below(node, b"KeyTime") if node.id == b"AnimationCurve" else ():
            np.frombuffer(times.props[0], np.int64)[:] -= ticks
    for limit in limits:
        limit.props[-1] -= ticks
    for take in (child for takes in below(root, b"Takes") for child in below(takes, b"Take")):
        for span in below(take, b"LocalTime", b"ReferenceTime"):
            span.props[:] = [time - ticks for time in span.props]


def _name_take(root: Node, name: bytes) -> None:
    """Give the only take and its animation stack a name, in place."""
    for stack in (node for node in _objects(root) if node.id == b"AnimationStack"):
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
    for node in _objects(root):
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


def _multiply(node: Node, factor: float, only: list[int] | slice = slice(None)) -> None:
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
    links = [link for link in _links(root) if link[0] == b"OP"]
    nodes = {link[1] for link in links if link[3] == b"Lcl Translation"}
    return nodes | {link[1] for link in links if link[2] in nodes}


def _encoded(node: Node, element: Any) -> Any:
    """Convert a node and its children to the encoder's class ``element``."""
    out = element(node.id)
    for kind, value in zip(node.props_type.decode(), node.props, strict=True):
        getattr(out, _ADD[kind])(value)
    out.elems = [_encoded(child, element) for child in node.elems]
    return out


class _Connected:
    """The objects of a file by their numbers, and how they are connected."""

    def __init__(self, root: Node) -> None:
        self.nodes = {node.props[0]: node for node in _objects(root)}
        self.models = {number: node for number, node in self.nodes.items() if node.id == b"Model"}
        self.sources: dict[int, list[int]] = {}  # of each, what is connected to it
        self.owner: dict[int, int] = {}  # what it is connected to as an object
        self.parent: dict[int, int] = {}  # of models
        self.animation: dict[tuple[int, bytes], list[int]] = {}  # by model and channel
        for kind, source, target, *channel in _links(root):
            self.sources.setdefault(target, []).append(source)
            if kind != b"OO":
                self.animation.setdefault((target, channel[0]), []).append(source)
                continue
            self.owner[source] = target
            if source in self.models and target in self.models:
                self.parent[source] = target

    def geometries(self, model: int) -> list[int]:
        """Return the geometries of a model, and the blend shapes that belong to them."""
        found = []
        waiting = self._sources_of_kind(model, b"Geometry")
        while waiting:
            number = waiting.pop()
            if self.nodes[number].id == b"Geometry":
                found.append(number)
            waiting += self._sources_of_kind(number, b"Geometry", b"Deformer")
        return found

    def curves(self, model: int, channel: bytes) -> list[Node]:
        """Return the curves of a channel."""
        numbers = [
            source
            for node in self.animation.get((model, channel), ())
            for source in self.sources.get(node, ())
        ]
        return [self.nodes[number] for number in numbers if number in self.nodes]

    def _sources_of_kind(self, number: int, *kinds: bytes) -> list[int]:
        sources = self.sources.get(number, ())
        return [each for each in sources if each in self.nodes and self.nodes[each].id in kinds]


def fold_scales(root: Node) -> None:
    """Give every object with one positive, constant scale the scale 1, in place."""
    file = _Connected(root)
    geometries = {number: file.geometries(number) for number in file.models}
    own = {number: _movable_scale(file, geometries, number) for number in file.models}
    if all(scale in (1.0, None) for scale in own.values()):
        return
    total = {number: _total(own, file.parent, number) for number in file.models}
    for number, scale in own.items():
        above = total.get(file.parent.get(number, 0), 1.0)
        _scale_channel(file, number, b"Lcl Translation", above)
        _scale_channel(file, number, b"Lcl Scaling", 1.0 / scale if scale else above)
        for geometry in geometries[number] if scale else ():
            for vertices in below(file.nodes[geometry], b"Vertices"):
                _multiply(vertices, total[number])
    _scale_matrices(file, total)


def _total(own: dict[int, float | None], parent: dict[int, int], number: int) -> float:
    """Return by what a model's matrix in the world is divided: all that is moved out of it and the
    ones above.

    :param own: the scale that is moved out of each model; None: its scale stays.
    """
    scale = own.get(number)
    return 1.0 if scale is None else scale * _total(own, parent, parent.get(number, 0))


def below(node: Node, *names: bytes) -> Iterator[Node]:
    """Yield the child nodes with one of these names."""
    return (child for child in node.elems if child.id in names)


def _objects(root: Node) -> list[Node]:
    """Return the nodes of the file's objects: models, meshes, curves and others."""
    return [node for objects in below(root, b"Objects") for node in objects.elems]


def _links(root: Node) -> list[list[Any]]:
    """Return the connections between objects: their kind, the two numbers and, of kind OP, the
    property.
    """
    return [link.props for top in below(root, b"Connections") for link in below(top, b"C")]


def properties(node: Node) -> list[Node]:
    """Return the entries of a node's table of properties."""
    return [entry for block in below(node, b"Properties70") for entry in below(block, b"P")]


def _movable_scale(file: _Connected, geometries: dict[int, list[int]], number: int) -> float | None:
    """Return the scale that can be moved out of a model; None if there are several, or others use
    its mesh.
    """
    model = file.models[number]
    if model.props[2] not in _OBJECTS:
        return 1.0
    scale = next(
        (entry.props[-3:] for entry in properties(model) if entry.props[0] == b"Lcl Scaling"),
        [1.0] * 3,
    )
    values = list(scale)
    for curve in file.curves(number, b"Lcl Scaling"):
        for keys in below(curve, b"KeyValueFloat"):
            values += np.frombuffer(keys.props[0], keys.props_type.decode()).tolist()
    size = float(scale[0])
    is_one_size = size > 0 and all(abs(value - size) <= _SAME * size for value in values)
    is_shared = any(
        set(geometries[number]) & set(theirs)
        for other, theirs in geometries.items()
        if other != number
    )
    if not is_one_size or is_shared:
        return None
    return size if abs(size - 1.0) > _SAME else 1.0


def _scale_channel(file: _Connected, number: int, channel: bytes, factor: float) -> None:
    """Multiply a channel of a model and its animation, in place."""
    if factor == 1.0:
        return
    entries = [e for e in properties(file.models[number]) if e.props[0] == channel]
    for node in file.animation.get((number, channel), ()):
        entries += properties(file.nodes[node])
    for curve in file.curves(number, channel):
        entries += below(curve, b"KeyValueFloat")
    for entry in entries:
        _multiply(entry, factor)


def _scale_matrices(file: _Connected, total: dict[int, float]) -> None:
    """Correct the matrices of rest poses and skins, in place."""
    for pose in (node for node in file.nodes.values() if node.id == b"Pose"):
        for entry in below(pose, b"PoseNode"):
            number = next(below(entry, b"Node")).props[0]
            if number in file.models:
                for matrix in below(entry, b"Matrix"):
                    _multiply(matrix, 1.0 / total[number], _LINEAR)
    for number, cluster in file.nodes.items():
        bones = [child for child in file.sources.get(number, ()) if child in file.models]
        if cluster.id != b"Deformer" or not bones:
            continue
        mesh = number
        while mesh in file.owner and mesh not in file.models:
            mesh = file.owner[mesh]
        of_bone = total[bones[0]]
        of_mesh = total.get(mesh, 1.0)
        for matrix in below(cluster, b"Transform"):
            _multiply(matrix, of_bone / of_mesh, _LINEAR)
            _multiply(matrix, of_bone, _TRANSLATION)
        for matrix in below(cluster, b"TransformLink"):
            _multiply(matrix, 1.0 / of_bone, _LINEAR)
        armature = bones[0]
        while armature in file.models and file.models[armature].props[2] not in _OBJECTS:
            armature = file.parent.get(armature, 0)
        for matrix in below(cluster, b"TransformAssociateModel"):
            _multiply(matrix, 1.0 / total.get(armature, 1.0), _LINEAR)
