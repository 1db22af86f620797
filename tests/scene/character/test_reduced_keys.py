# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys that are left out by a reduction are where interpolation has them, within the bound."""

import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.character.keys import select_position_keys, select_quaternion_keys
from scope.solver.rotations import matrix_from_quaternion, quaternion_from_matrix

from ...edit.walking import NAMES, angle, walk


@pytest.mark.parametrize("degrees", [0.2, 1.0, 4.0])
def test_reduced_keys_stay_within_the_bound(degrees):
    clip = walk(4.0)
    q = quaternion_from_matrix(clip.rotations[:, NAMES.index("left_hip")])
    q *= np.where((q[:, :1] < 0), -1, 1)
    keep = select_quaternion_keys(clip.times, q, np.radians(degrees))
    assert len(keep) < len(q)
    # Blender's interpolation, written again: every number linear, then normalized
    rebuilt = np.stack(
        [np.interp(clip.times, clip.times[keep], q[keep, k]) for k in range(4)], axis=1
    )
    rebuilt /= np.linalg.norm(rebuilt, axis=1, keepdims=True)
    off = angle(matrix_from_quaternion(rebuilt), matrix_from_quaternion(q))
    assert off.max() <= np.radians(degrees) * (1 + 1e-6)
    still = np.tile([1.0, 0, 0, 0], (50, 1))
    assert len(select_quaternion_keys(np.arange(50.0), still, 0.01)) == 2
    keep = select_position_keys(clip.times, clip.root, 0.005)
    rebuilt = np.stack(
        [np.interp(clip.times, clip.times[keep], clip.root[keep, k]) for k in range(3)], axis=1
    )
    assert np.linalg.norm(rebuilt - clip.root, axis=1).max() <= 0.005
    with pytest.raises(UsageError, match="above zero"):
        select_position_keys(clip.times, clip.root, 0.0)
