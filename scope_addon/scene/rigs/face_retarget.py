# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting captured expressions to the shape keys of the user's own meshes, as new actions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...errors import UsageError
from ...expression_names import EXPRESSIONS
from ...retarget.expression_map import ExpressionMap, guess_expression_map
from ..animation_data.actions import Channels, check_not_in_nla, fcurves, read_keys, shape_key_path
from ..animation_data.transaction import all_or_nothing
from ..character.expression_keys import MOVES, has_expression_keys
from .rig_action import leave_tweak_mode, mark_written, override_nla, retire


@dataclass(frozen=True)
class CapturedExpressions:
    """The expressions of a captured person: weights (T, 52) in the order of `EXPRESSIONS`, at scene
    frames (T,).
    """

    frames: NDArray[np.float64]
    weights: NDArray[np.float64]


def captured_expressions(armature: bpy.types.Object) -> CapturedExpressions | None:
    """Return the expressions that the captured armature's body shows; None if its face was not
    captured.

    :raises UsageError: their keys are in the NLA.
    """
    for mesh in armature.children:
        keys = mesh.data.shape_keys if mesh.type == "MESH" else None
        if keys is None or not has_expression_keys(keys):
            continue
        if not fcurves(keys):
            check_not_in_nla(keys)
        curves = {curve.data_path: read_keys(curve).astype(float) for curve in fcurves(keys)}
        found = [curves.get(shape_key_path(name)) for name in EXPRESSIONS]
        longest = max(
            (keyed[:, 0] for keyed in found if keyed is not None and len(keyed)),
            key=len,
            default=np.ones(1),
        )
        columns = [
            np.interp(longest, *keyed.T)
            if keyed is not None and len(keyed)
            else np.full(len(longest), block.value)
            for keyed, block in (
                (k, keys.key_blocks[name]) for k, name in zip(found, EXPRESSIONS, strict=True)
            )
        ]
        return CapturedExpressions(longest, np.stack(columns, axis=1))
    return None


def faces_of(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Return the meshes with shape keys, one of those that share their data."""
    found = {
        obj.data: obj for obj in objects if obj.type == "MESH" and obj.data.shape_keys is not None
    }
    return list(found.values())


def key_names(faces: Iterable[bpy.types.Object]) -> list[str]:
    """Return the names of all shape keys of meshes but the basis, each once."""
    blocks = (block for face in faces for block in face.data.shape_keys.key_blocks[1:])
    return list(dict.fromkeys(block.name for block in blocks))


def retarget_expressions(
    captured: CapturedExpressions,
    faces: Sequence[bpy.types.Object],
    expression_map: ExpressionMap | None = None,
    name: str = "Face",
) -> list[bpy.types.Action]:
    """Key the shape keys of meshes in new actions so that they show the captured expressions.

    A mesh's former action is kept in the file, unless it is an earlier retargeting of the same
    capture that was not edited. A key that never moves gets a value without keyframes; sliders
    whose range ends below 1 are widened to it.

    :param expression_map: None to guess one for each mesh by the names of its keys.
    :param name: of the captured armature; the actions have it after that of the mesh.
    :return: the actions, of the meshes that have mapped keys.
    :raises UsageError: when no mesh has any mapped key.
    :raises InputError: when the map cannot be used.
    """
    if expression_map is not None:
        expression_map.check()
    plans = []
    for face in faces:
        names = key_names([face])
        wanted = (expression_map or guess_expression_map(names)).values(captured.weights)
        plans.append((face, {key: values for key, values in wanted.items() if key in names}))
    if not any(values for _, values in plans):
        meshes = ", ".join(f"'{face.name}'" for face in faces) or "the rig's meshes"
        raise UsageError(
            f"no shape key of {meshes} is mapped to an expression; name them as ARKit, VRM or "
            "Oculus do, or give a map"
        )
    written = []
    for face in faces:
        leave_tweak_mode(face.data.shape_keys)  # first: a failure would assign the strip's action
    with all_or_nothing(bpy.context.scene, *faces, keys=[face.data.shape_keys for face in faces]):
        for face, values in plans:
            if values:
                written.append((face, *_write(face.data.shape_keys, captured.frames, values, name)))
        for face, action, former in written:
            retire(former, name)
            action.name = f"{face.name}_{name}"  # which an earlier retargeting had until now
    return [action for _, action, _ in written]


def _write(
    keys: bpy.types.Key,
    frames: NDArray[np.float64],
    values: dict[str, NDArray[np.float64]],
    source: str,
) -> tuple[bpy.types.Action, bpy.types.Action | None]:
    """Write the keys of one mesh; return the new action and the former one."""
    former = keys.animation_data.action if keys.animation_data else None
    channels = Channels(keys, bpy.data.actions.new("Face"))
    for key, column in values.items():
        block = keys.key_blocks[key]
        block.slider_max = max(block.slider_max, 1.0)
        block.mute = False
        block.value = float(column[0])
        if np.ptp(column) >= MOVES:
            channels.write(shape_key_path(key), frames, column, group="Face")
    override_nla(keys.animation_data)
    mark_written(channels.action, source)
    return channels.action, former
