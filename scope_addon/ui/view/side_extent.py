# SPDX-License-Identifier: GPL-3.0-or-later
"""How much the view from the side must show for nobody to be cut off.

It follows the pelvis of one person, so the others must stay within the view on either side of it,
in every frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..captured_person import body_of

if TYPE_CHECKING:
    from numpy.typing import NDArray  # which takes long to load

_HALF_HEIGHT_M = 1.3  # above and below the pelvis of a person
_HALF_WIDTH_M = 0.5  # to the left and right of it


def side_extent(
    followed: bpy.types.Object,
    people: Sequence[bpy.types.Object],
    R_world_view: NDArray[np.float64],
) -> tuple[float, float]:
    """Return the width and height, metres, that a view along -z must show around the pelvis of
    ``followed``.

    :param people: captured armatures; one whose keys are missing is left out.
    :param R_world_view: (3, 3), view axes to world.
    """
    from ...scene.animation_data.timing import scene_rate

    rate = scene_rate(bpy.context.scene)
    far = np.zeros(2)
    path = _pelvis_path(followed, rate)
    paths = [_pelvis_path(person, rate) for person in people if person != followed]
    if path is not None:
        for their in (other for other in paths if other is not None):
            place = np.stack(
                [np.interp(path[:, 0], their[:, 0], their[:, k]) for k in (1, 2, 3)], axis=1
            )
            far = np.maximum(far, np.abs((place - path[:, 1:]) @ R_world_view[:, :2]).max(axis=0))
    return 2.0 * (float(far[0]) + _HALF_WIDTH_M), 2.0 * (float(far[1]) + _HALF_HEIGHT_M)


def _pelvis_path(armature: bpy.types.Object, rate: float) -> NDArray[np.float64] | None:
    """Return the scene frame and the world position of the pelvis at every key, (T, 4); None
    without keys.
    """
    from ....solver.errors import ScopeError
    from ...scene.character.keys import read_clip
    from ...scene.character.root_object import clip_as_displayed, parent_transform, root_object

    try:
        clip, frames = read_clip(armature, body_of(armature), rate)
    except ScopeError:
        return None
    empty = root_object(armature)
    M = np.array(armature.matrix_world if empty is None else parent_transform(empty))
    return np.column_stack(
        [frames, clip_as_displayed(armature, clip, frames).root @ M[:3, :3].T + M[:3, 3]]
    )
