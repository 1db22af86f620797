# SPDX-License-Identifier: GPL-3.0-or-later
"""The body's shape as shape keys: Shape000 is the first coefficient, and its value is the
coefficient itself.

The rest mesh is ``v̄ + Σ_p β_p shapedirs_p`` for any slider setting, and the armature's bones rest
at J(β) of the fitted shape, so at the fitted values Blender's deformation is exactly SMPL's.
"""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ...errors import MotionFileError
from ...kinematics.axes import R_WORLD_MODEL
from ..animation_data.actions import Channels, shape_key_path

SLIDER_LIMIT = 10.0  # the limit of Blender's sliders
MODES = ("keyed", "per_frame", "baked")


def shape_key_name(coefficient: int) -> str:
    """Return the name of a coefficient's shape key: ``Shape000`` for coefficient 0."""
    return f"Shape{coefficient:03d}"


def add_shape_keys(mesh: bpy.types.Object, body: Body, betas: NDArray[np.floating[Any]]) -> None:
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
    basis = mesh.shape_key_add(name="Basis", from_mix=False)
    rest = np.empty(3 * len(body.v_template), np.float32)
    basis.data.foreach_get("co", rest)
    for p, beta in enumerate(betas):
        key = mesh.shape_key_add(name=shape_key_name(p), from_mix=False)
        offset = body.shapedirs[:, :, p] @ R_WORLD_MODEL.T
        key.data.foreach_set("co", (rest + offset.ravel()).astype(np.float32))
        # Must come first: Blender silently clamps values and keys to this range.
        key.slider_min = -SLIDER_LIMIT
        key.slider_max = SLIDER_LIMIT
        key.value = float(beta)


def key_shape(
    mesh: bpy.types.Object,
    action: bpy.types.Action,
    betas: NDArray[np.floating[Any]],
    frames: NDArray[np.float64],
    per_frame: bool = False,
) -> Channels:
    """Key the shape coefficients, and return the channels of the mesh's shape keys.

    :param betas: (P,) the fitted shape.
    :param frames: (T,) scene frames.
    :param per_frame: key every frame instead of the first one only.
    """
    channels = Channels(mesh.data.shape_keys, action)
    at = frames if per_frame else frames[:1]
    for p, beta in enumerate(betas):
        channels.write(
            shape_key_path(shape_key_name(p)), at, np.full(len(at), beta), "CONSTANT", group="Shape"
        )
    return channels


def mixed_vertices(mesh: bpy.types.Object, without: Container[str] = ()) -> NDArray[np.float32]:
    """Return the rest vertices (V, 3) at the current slider values: ``basis + Σ_p value_p (key_p −
    basis)``.

    :param without: names of keys that are left out.
    """
    blocks = mesh.data.shape_keys.key_blocks
    basis = np.empty(3 * len(mesh.data.vertices), np.float32)
    blocks[0].data.foreach_get("co", basis)
    mixed = basis.astype(float)
    key = np.empty_like(basis)
    for block in blocks[1:]:
        if not block.mute and block.name not in without:
            block.data.foreach_get("co", key)
            mixed += block.value * (key - basis)
    return mixed.astype(np.float32).reshape(-1, 3)
