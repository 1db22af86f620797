# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving the scale of an FBX file's objects into the lengths below them, so that every object has
scale 1.

A rig in centimetres under an object of scale 0.01, as Blender imports Mixamo's characters, would
otherwise pass that scale to the root of its skeleton, where engines multiply the root motion by it.
With s the product of the scales of an object and those above it, and G its matrix in the world,

    translation' = (s / own scale) translation,   vertices' = s vertices,   G' = G / s (3x3 part),

and for the skin of a mesh m that a bone b moves, with G_b⁻¹ G_m in the file,

    (3x3 part)' = s_b / s_m (3x3 part),    translation' = s_b translation.

Bones are no objects here: they keep their own scale, which may be animated.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

# The parser's: id, props, props_type (a letter code for each), and elems, the child nodes
Node = Any

_OBJECTS = (b"Null", b"Mesh")
# Scales that differ by less are the same; single precision has seven digits.
_SAME = 1e-5
_TRANSLATION = [12, 13, 14]  # of a matrix's 16 elements
_LINEAR = [0, 1, 2, 4, 5, 6, 8, 9, 10]


@dataclass
class _Model:
    """A model of the file, and what belongs to it."""

    node: Node
    parent: int = 0
    geometries: list[int] = field(default_factory=list)
    curves: dict[bytes, list[int]] = field(default_factory=dict)  # nodes of animation, by channel
    own: float | None = 1.0  # the scale that is moved out of it; None: its scale stays


def fold_scales(root: Node) -> None:
    """Give every object with one positive, constant scale the scale 1, in place."""
    nodes = {node.props[0]: node for top in below(root, b"Objects") for node in top.elems}
    links = [link.props for top in below(root, b"Connections") for link in below(top, b"C")]
    models = _models(nodes, links)
    for number, model in models.items():
        model.own = _movable_scale(nodes, links, models, number)
    if all(model.own in (1.0, None) for model in models.values()):
        return
    total = {number: _total(models, number) for number in models}
    for number, model in models.items():
        above = total.get(model.parent, 1.0)
        _scale_channel(nodes, links, model, b"Lcl Translation", above)
        _scale_channel(nodes, links, model, b"Lcl Scaling", 1.0 / model.own if model.own else above)
        for geometry in model.geometries if model.own else ():
            for vertices in below(nodes[geometry], b"Vertices"):
                _multiply_array(vertices, total[number])
    _scale_matrices(nodes, links, models, total)


def _total(models: dict[int, _Model], number: int) -> float:
    """Return by what a model's matrix in the world is divided: all that is moved out of it and the
    ones above.
    """
    model = models.get(number)
    if model is None or model.own is None:
        return 1.0
    return model.own * _total(models, model.parent)


def below(node: Node, *names: bytes) -> Iterator[Node]:
    """Yield the child nodes with one of these names."""
    return (child for child in node.elems if child.id in names)


def properties(node: Node) -> list[Node]:
    """Return the entries of a node's table of properties."""
    return [entry for block in below(node, b"Properties70") for entry in below(block, b"P")]


def _models(nodes: dict[int, Node], links: list[list[Any]]) -> dict[int, _Model]:
    """Return all models with their parents, geometries and animation."""
    models = {number: _Model(node) for number, node in nodes.items() if node.id == b"Model"}
    users: dict[int, list[int]] = {}
    for link in links:
        if link[0] == b"OO":
            users.setdefault(link[2], []).append(link[1])
        elif link[2] in models:
            models[link[2]].curves.setdefault(link[3], []).append(link[1])
    for number, model in models.items():
        for child in users.get(number, ()):
            if child in models:
                models[child].parent = number
            elif child in nodes and nodes[child].id == b"Geometry":
                model.geometries += _with_shapes(nodes, users, child)
    return models


def _with_shapes(nodes: dict[int, Node], users: dict[int, list[int]], geometry: int) -> list[int]:
    """Return a geometry and the blend shapes that belong to it."""
    found = []
    waiting = [geometry]
    while waiting:
        number = waiting.pop()
        if nodes[number].id == b"Geometry":
            found.append(number)
        waiting += [
            child
            for child in users.get(number, ())
            if child in nodes and nodes[child].id in (b"Geometry", b"Deformer")
        ]
    return found


def _movable_scale(
    nodes: dict[int, Node], links: list[list[Any]], models: dict[int, _Model], number: int
) -> float | None:
    """Return the scale that can be moved out of a model; None if there are several, or others use
    its mesh.
    """
    model = models[number]
    if model.node.props[2] not in _OBJECTS:
        return 1.0
    scale = next(
        (entry.props[-3:] for entry in properties(model.node) if entry.props[0] == b"Lcl Scaling"),
        [1.0] * 3,
    )
    values = [*scale, *_channel_values(nodes, links, model, b"Lcl Scaling")]
    size = float(scale[0])
    is_one_size = size > 0 and all(abs(value - size) <= _SAME * size for value in values)
    is_shared = any(
        set(model.geometries) & set(other.geometries)
        for key, other in models.items()
        if key != number
    )
    if not is_one_size or is_shared:
        return None
    return size if abs(size - 1.0) > _SAME else 1.0


def _channel_values(
    nodes: dict[int, Node], links: list[list[Any]], model: _Model, channel: bytes
) -> Iterator[float]:
    """Yield the values of all keys of a channel."""
    for curve in _curves(nodes, links, model, channel):
        for keys in below(curve, b"KeyValueFloat"):
            yield from np.frombuffer(keys.props[0], keys.props_type.decode()).tolist()


def _curves(
    nodes: dict[int, Node], links: list[list[Any]], model: _Model, channel: bytes
) -> Iterator[Node]:
    """Yield the curves of a channel."""
    curve_nodes = model.curves.get(channel, [])
    for link in links:
        if link[2] in curve_nodes and nodes.get(link[1]) is not None:
            yield nodes[link[1]]


def _scale_channel(
    nodes: dict[int, Node], links: list[list[Any]], model: _Model, channel: bytes, factor: float
) -> None:
    """Multiply a channel of a model and its animation, in place."""
    if factor == 1.0:
        return
    for entry in properties(model.node):
        if entry.props[0] == channel:
            _multiply_numbers(entry, factor)
    for number in model.curves.get(channel, ()):
        for entry in properties(nodes[number]):
            _multiply_numbers(entry, factor)
    for curve in _curves(nodes, links, model, channel):
        for keys in below(curve, b"KeyValueFloat"):
            _multiply_array(keys, factor)


def _scale_matrices(
    nodes: dict[int, Node],
    links: list[list[Any]],
    models: dict[int, _Model],
    total: dict[int, float],
) -> None:
    """Correct the matrices of rest poses and skins, in place."""
    users: dict[int, list[int]] = {}
    owner: dict[int, int] = {}
    for link in links:
        if link[0] == b"OO":
            users.setdefault(link[2], []).append(link[1])
            owner[link[1]] = link[2]
    for pose in (node for node in nodes.values() if node.id == b"Pose"):
        for entry in below(pose, b"PoseNode"):
            number = next(below(entry, b"Node")).props[0]
            if number in models:
                for matrix in below(entry, b"Matrix"):
                    _multiply_array(matrix, 1.0 / total[number], _LINEAR)
    for number, cluster in nodes.items():
        bones = [child for child in users.get(number, ()) if child in models]
        if cluster.id != b"Deformer" or not bones:
            continue
        mesh = number
        while mesh in owner and mesh not in models:
            mesh = owner[mesh]
        of_bone = total[bones[0]]
        of_mesh = total.get(mesh, 1.0)
        for matrix in below(cluster, b"Transform"):
            _multiply_array(matrix, of_bone / of_mesh, _LINEAR)
            _multiply_array(matrix, of_bone, _TRANSLATION)
        for matrix in below(cluster, b"TransformLink"):
            _multiply_array(matrix, 1.0 / of_bone, _LINEAR)
        armature = bones[0]
        while armature in models and models[armature].node.props[2] not in _OBJECTS:
            armature = models[armature].parent
        for matrix in below(cluster, b"TransformAssociateModel"):
            _multiply_array(matrix, 1.0 / total.get(armature, 1.0), _LINEAR)


def _multiply_numbers(node: Node, factor: float) -> None:
    """Multiply a node's doubles, in place."""
    for index, kind in enumerate(node.props_type.decode()):
        if kind == "D":
            node.props[index] *= factor


def _multiply_array(node: Node, factor: float, only: list[int] | slice = slice(None)) -> None:
    """Multiply the selected elements of a node's array of floats or doubles, in place."""
    kind = node.props_type.decode()
    np.frombuffer(node.props[0], kind)[only] *= factor
