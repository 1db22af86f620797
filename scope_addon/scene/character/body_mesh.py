# SPDX-License-Identifier: GPL-3.0-or-later
"""The body's mesh: quads, UVs, materials, and skin weights that deform it with the armature,
and its shape as shape keys: Shape000 is the first coefficient, and its value is the coefficient
itself.

The rest mesh is ``v̄ + Σ_p β_p shapedirs_p`` for any slider setting, and the armature's bones rest
at J(β) of the fitted shape, so at the fitted values Blender's deformation is exactly SMPL's.

Facial expressions are shape keys with ARKit's names, from 0 to 1, and their weights keyframes.
"""

from __future__ import annotations

from collections.abc import Container

import bpy
import numpy as np
from bpy.types import Action, Collection, Key, Object

from ....solver.body import Body
from ...arrays import Float32Array, Float64Array, FloatArray, IndexArray
from ...errors import MotionFileError
from ...kinematics.axes import R_WORLD_MODEL
from ...kinematics.face import EXPRESSIONS, expressions_of, mouth_faces_of
from ...motion import Motion
from ..actions import Channels, fcurves, read_keys, shape_key_path
from ..timing import whole_frames_of

SLIDER_LIMIT = 10.0  # the limit of Blender's sliders
MODES = ("keyed", "baked")
MOUTH_COLOR = (0.06, 0.01, 0.01)  # linear
MOVES = 1e-3  # change of a weight from which an expression counts as moving


def build_mesh(name: str, body: Body, vertices: Float64Array, collection: Collection) -> Object:
    """Create a mesh object of the body with UVs and materials, at the world's origin.

    :param vertices: (V, 3) metres, world frame, at rest.
    """
    mesh = bpy.data.meshes.new(name)
    corners = body.faces.shape[1]
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(body.faces.size)
    mesh.loops.foreach_set("vertex_index", body.faces.astype(np.int32).ravel())
    mesh.polygons.add(len(body.faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, body.faces.size, corners, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ones(len(body.faces), bool))
    for material_name, color in _materials(body):
        mesh.materials.append(_material(material_name, color))
    if body.face_material is not None:
        mesh.polygons.foreach_set("material_index", body.face_material.astype(np.int32))
    if body.uv is not None and body.uv_faces is not None:
        layer = mesh.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", body.uv[body.uv_faces].astype(np.float32).ravel())
    mesh.update(calc_edges=True)
    obj = bpy.data.objects.new(name, mesh)
    collection.objects.link(obj)
    return obj


def colour_faces(
    mesh: Object, faces: IndexArray, name: str, color: tuple[float, float, float]
) -> None:
    """Give some faces (n,) of a mesh a matte material of their own, of a linear RGB colour."""
    material = _material(name, np.array([*color, 1.0]))
    mesh.data.materials.append(material)
    index = np.empty(len(mesh.data.polygons), np.int32)
    mesh.data.polygons.foreach_get("material_index", index)
    index[faces] = len(mesh.data.materials) - 1
    mesh.data.polygons.foreach_set("material_index", index)


def rest_vertices_world(
    body: Body, lift: Float64Array, betas: FloatArray | None = None
) -> Float64Array:
    """Return the vertices of the rest mesh in the world frame.

    :param lift: (3,) metres, as in ``RestPose``.
    :param betas: (P,) shape coefficients; None for the mean shape.
    :return: (V, 3) metres, z up.
    """
    return body.rest_vertices(betas) @ R_WORLD_MODEL.T + lift


def skin_to_armature(mesh: Object, armature: Object, body: Body) -> None:
    """Add vertex groups with the body's skin weights and a linear Armature modifier, and set the
    armature as parent.
    """
    joints = body.skin_joints
    weights = body.skin_weights
    for k, joint_name in enumerate(body.joint_names):
        group = mesh.vertex_groups.new(name=joint_name)
        weight = np.where(joints == k, weights, 0.0).sum(axis=1)
        whole = np.flatnonzero(weight == 1.0)
        group.add(whole.tolist(), 1.0, "REPLACE")
        shared = np.flatnonzero((weight > 0.0) & (weight != 1.0))
        for vertex, share in zip(shared.tolist(), weight[shared].tolist(), strict=True):
            group.add((vertex,), share, "REPLACE")
    modifier = mesh.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    modifier.use_deform_preserve_volume = False
    mesh.parent = armature


def _materials(body: Body) -> list[tuple[str, Float64Array]]:
    plain = np.array([0.6, 0.6, 0.6, 1.0])
    names = body.material_names or ("body",)
    colors = (
        body.material_colors
        if body.material_colors is not None
        else np.tile(plain, (len(names), 1))
    )
    return list(zip(names, colors, strict=True))


def _material(name: str, color: Float64Array) -> bpy.types.Material:
    """Create a matte Principled material of a linear RGBA colour (4,), for viewport and render."""
    material = bpy.data.materials.new(name)
    rgba = tuple(float(c) for c in color)
    material.diffuse_color = rgba
    material.roughness = 0.6
    if material.node_tree is None:  # before 5.0, new materials have no nodes
        material.use_nodes = True
    for node in material.node_tree.nodes:
        if node.type == "BSDF_PRINCIPLED":
            node.inputs["Base Color"].default_value = rgba
            node.inputs["Roughness"].default_value = 0.6
    return material


def shape_key_name(coefficient: int) -> str:
    """Return the name of a coefficient's shape key: ``Shape000`` for coefficient 0."""
    return f"Shape{coefficient:03d}"


def add_shape_keys(mesh: Object, body: Body, betas: FloatArray) -> None:
    """Add ``Basis`` (the current mesh: β = 0) and one key per coefficient, each at its fitted
    value.

    :param betas: (P,) the fitted shape.
    :raises MotionFileError: when a coefficient is beyond the limit of Blender's shape keys.
    """
    farthest = float(betas[np.abs(betas).argmax()])
    if abs(farthest) > SLIDER_LIMIT:
        raise MotionFileError(
            f"the shape coefficient {farthest:.3g} exceeds Blender's limit of ±{SLIDER_LIMIT:g} "
            "for shape keys; "
            "bake the shape into the mesh instead"
        )
    rest = key_vertices(mesh.shape_key_add(name="Basis", from_mix=False))
    for p, beta in enumerate(betas):
        key = mesh.shape_key_add(name=shape_key_name(p), from_mix=False)
        offset = body.shapedirs[:, :, p] @ R_WORLD_MODEL.T
        key.data.foreach_set("co", (rest + offset).astype(np.float32).ravel())
        # Must come first: Blender silently clamps values and keys to this range.
        key.slider_min = -SLIDER_LIMIT
        key.slider_max = SLIDER_LIMIT
        key.value = float(beta)


def key_shape(mesh: Object, action: Action, betas: FloatArray, frame: float) -> Channels:
    """Key the shape coefficients at a scene frame, and return the channels of the mesh's shape
    keys.

    :param betas: (P,) the fitted shape.
    """
    channels = Channels(mesh.data.shape_keys, action)
    for p, beta in enumerate(betas):
        path = shape_key_path(shape_key_name(p))
        channels.write(path, np.array([frame]), np.array([beta]), "CONSTANT", group="Shape")
    return channels


def mixed_vertices(mesh: Object, without: Container[str] = ()) -> Float32Array:
    """Return the rest vertices (V, 3) at the current slider values: ``basis + Σ_p value_p (key_p −
    basis)``.

    :param without: names of keys that are left out.
    """
    blocks = mesh.data.shape_keys.key_blocks
    basis = key_vertices(blocks[0])
    mixed = basis.astype(float)
    for block in blocks[1:]:
        if not block.mute and block.name not in without:
            mixed += block.value * (key_vertices(block) - basis)
    return mixed.astype(np.float32)


def key_vertices(key: bpy.types.ShapeKey) -> Float32Array:
    """Return where a shape key has the vertices (V, 3)."""
    vertices = np.empty((len(key.data), 3), np.float32)
    key.data.foreach_get("co", vertices.ravel())
    return vertices


def has_expression_keys(keys: Key) -> bool:
    """Return whether a mesh's shape keys contain those of the face."""
    return EXPRESSIONS[0] in keys.key_blocks


def add_expression_keys(mesh: Object, body: Body) -> bool:
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
    mesh: Object,
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


def expression_offsets(mesh: Object) -> dict[str, Float32Array]:
    """Return how far each expression's key moves the vertices (V, 3), by name; none if there are no
    such keys.
    """
    blocks = mesh.data.shape_keys.key_blocks
    basis = key_vertices(blocks[0])
    return {name: key_vertices(blocks[name]) - basis for name in EXPRESSIONS if name in blocks}


def copy_expressions(mesh: Object, source: Key, offsets: dict[str, Float32Array]) -> None:
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


def _add_key(mesh: Object, name: str, places: Float32Array, value: float) -> None:
    """Add a shape key that has the vertices at ``places`` (V, 3)."""
    key = mesh.shape_key_add(name=name, from_mix=False)
    key.data.foreach_set("co", places.ravel())
    key.value = value
