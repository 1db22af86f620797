# SPDX-License-Identifier: GPL-3.0-or-later
"""The axes of Blender's cameras against known facts."""

import numpy as np
from scope.scope_addon.scene.camera import blender_camera_matrix


def test_blender_camera_looks_along_its_minus_z_where_opencv_looks_along_plus_z():
    T = np.eye(4)
    T[:3, 3] = [1, 2, 3]
    B = blender_camera_matrix(T)
    assert np.allclose(B @ [0, 0, -1, 1], [1, 2, 4, 1])  # forward
    assert np.allclose(B @ [0, 1, 0, 1], [1, 1, 3, 1])  # the image's up is OpenCV's −y
