# SPDX-License-Identifier: GPL-3.0-or-later
"""Points and the pixels of a camera to which they project."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# A camera: world_from_camera (4, 4), metres, and intrinsics (3, 3).
Camera = tuple[NDArray[np.float64], NDArray[np.float64]]
_STEEP = np.radians(45.0)  # A steep camera looks farther up or down from the horizon.


def pixel_of(camera: Camera, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Project a point (3,), world, to a pixel (2,)."""
    T, K = camera
    p = K @ (T[:3, :3].T @ (np.asarray(point, float) - T[:3, 3]))
    pixel: NDArray[np.float64] = p[:2] / p[2]
    return pixel


def nearest_on_ray(
    camera: Camera, pixel: NDArray[np.float64], point: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the point (3,) nearest to another one of those in front of the camera that project to
    a pixel (2,).
    """
    T, K = camera
    ray = T[:3, :3] @ np.linalg.solve(K, np.array([*pixel, 1.0]))
    ray /= np.linalg.norm(ray)
    nearest: NDArray[np.float64] = T[:3, 3] + max(float((point - T[:3, 3]) @ ray), 1e-3) * ray
    return nearest


def point_at_depth(
    camera: Camera, pixel: NDArray[np.float64], point: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the point (3,) that projects to a pixel (2,) and is as far away as another one, (3,).

    It is in the upright plane through the other point that faces the camera, so that somebody who
    crouches does so in place. A camera that looks steeply down or up moves it in a plane that is
    parallel to the image.
    """
    T, K = camera
    normal = T[:3, 2] * [1.0, 1.0, 0.0]
    if np.linalg.norm(normal) < np.cos(_STEEP):
        normal = T[:3, 2]
    ray = T[:3, :3] @ np.linalg.solve(K, np.array([*pixel, 1.0]))
    along = float(ray @ normal)
    # The ray meets the plane beside or behind the camera, or nowhere.
    if along < 1e-3 * float(np.linalg.norm(ray) * np.linalg.norm(normal)):
        return nearest_on_ray(camera, pixel, point)
    place: NDArray[np.float64] = T[:3, 3] + ray * (float((point - T[:3, 3]) @ normal) / along)
    return place
