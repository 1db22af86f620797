# SPDX-License-Identifier: GPL-3.0-or-later
"""Facial expressions as shape keys with ARKit's names, from 0 to 1, and their weights as
keyframes.
"""

from __future__ import annotations

import bpy
import numpy as np

from ....solver.body import Body
from ...arrays import Float32Array, Float64Array
from ...kinematics.axes import R_WORLD_MODEL
from ...kinematics.face import EXPRESSIONS, expressions_of, mouth_faces_of
from ...motion import Motion
from ..actions import Channels, fcurves, read_keys, shape_key_path
from ..timing import whole_frames_of
from .body_mesh import colour_faces, key_vertices

MOUTH_COLOR = (0.06, 0.01, 0.01)  # linear
MOVES = 1e-3  # change of a weight from which an expression counts as moving


def has_expression_keys(keys: bpy.types.Key) -> bool:
    """Return whether a mesh's shape keys contain those of the face."""
    return EXPRESSIONS[0] in keys.key_blocks


def add_expression_keys(mesh: bpy.types.Object, body: Body) -> bool:
    """Add one key per expression, each at 0, and ``Basis`` if there is none, and make the inside of
    the mouth dark.

    :return: False if the body has no expressions.
    """
    expressions = expressions_of(body)
    if not expressions:
        return False
    if mesh.data.shape_keys is None:
        mesh.shape_key_add(name="Basis", from_mix=False)
    rest = key_vertices(mesh.data.shape_keys.key_blocks[0])
    for expression in expressions:
        moved = rest.copy()
        moved[expression.vertices] += (expression.offsets @ R_WORLD_MODEL.T).astype(np.float32)
        _add_key(mesh, expression.name, moved, 0.0)
    colour_faces(mesh, mouth_faces_of(body), "mouth", MOUTH_COLOR)
    return True


def key_expressions(
    mesh: bpy.types.Object,
    channels: Channels,
    motion: Motion,
    frames: Float64Array,
    whole_frames: bool = False,
) -> None:
    """Key the weights of the motion's face; an expression that never changes gets one key, one that
    never shows none.

    :param channels: of the mesh's shape keys.
    :param frames: (T,) scene frames.
    :param whole_frames: key whole frames only, by linear interpolation.
    """
    weights = motion.face["expressions"].astype(float)
    at = whole_frames_of(frames) if whole_frames else frames
    for name, column in zip(motion.face["expression_names"].tolist(), weights.T, strict=True):
        if name not in mesh.data.shape_keys.key_blocks or column.max() < MOVES:
            continue
        values = np.interp(at, frames, column) if whole_frames else column
        path = shape_key_path(name)
        mesh.data.shape_keys.key_blocks[name].value = float(values[0])
        if np.ptp(column) >= MOVES:
            channels.write(path, at, values, group="Face")
        else:
            channels.write(path, at[:1], values[:1], "CONSTANT", group="Face")


def expression_offsets(mesh: bpy.types.Object) -> dict[str, Float32Array]:
    """Return how far each expression's key moves the vertices (V, 3), by name; none if there are no
    such keys.
    """
    blocks = mesh.data.shape_keys.key_blocks
    basis = key_vertices(blocks[0])
    return {name: key_vertices(blocks[name]) - basis for name in EXPRESSIONS if name in blocks}


def copy_expressions(
    mesh: bpy.types.Object, source: bpy.types.Key, offsets: dict[str, Float32Array]
) -> None:
    """Give a mesh without shape keys those of another one's expressions, with their keyframes.

    :param source: the other mesh's shape keys.
    :param offsets: (V, 3) each, as from `expression_offsets`.
    """
    rest = key_vertices(mesh.shape_key_add(name="Basis", from_mix=False))
    for name, offset in offsets.items():
        _add_key(mesh, name, rest + offset, source.key_blocks[name].value)
    animated = {curve.data_path: curve for curve in fcurves(source)}
    channels = Channels(mesh.data.shape_keys, bpy.data.actions.new(f"{mesh.name}_expressions"))
    for name in offsets:
        if (curve := animated.get(shape_key_path(name))) is not None:
            keys = read_keys(curve).astype(float)
            if len(keys):
                channels.write(curve.data_path, keys[:, 0], keys[:, 1])


def _add_key(mesh: bpy.types.Object, name: str, places: Float32Array, value: float) -> None:
    """Add a shape key that has the vertices at ``places`` (V, 3)."""
    key = mesh.shape_key_add(name=name, from_mix=False)
    key.data.foreach_set("co", places.ravel())
    key.value = value
