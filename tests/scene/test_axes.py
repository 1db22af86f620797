# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's and glTF's axes against known facts."""

import numpy as np
import pytest
from scope.scope_addon.scene import axes


@pytest.mark.parametrize("R", [axes.R_CAMERA_BLENDCAM, axes.R_GLTF_WORLD])
def test_every_convention_is_a_rotation(R):
    assert np.allclose(R @ R.T, np.eye(3))
    assert np.isclose(np.linalg.det(R), 1)


def test_blender_camera_looks_along_its_minus_z_where_opencv_looks_along_plus_z():
    T = np.eye(4)
    T[:3, 3] = [1, 2, 3]
    B = axes.blender_camera_matrix(T)
    assert np.allclose(B @ [0, 0, -1, 1], [1, 2, 4, 1])  # forward
    assert np.allclose(B @ [0, 1, 0, 1], [1, 1, 3, 1])  # the image's up is OpenCV's −y
