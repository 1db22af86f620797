# SPDX-License-Identifier: GPL-3.0-or-later
"""A small z-buffer rasterizer: from triangles in camera axes to images of colour, opacity and
depth.

A vertex (x, y, z) in camera axes (OpenCV: x right, y down, z forward, metres) appears at

    (u, v) = K · distort(x / z, y / z)          pixel centres at integers, as in OpenCV

with OpenCV's five distortion coefficients (k1, k2, p1, p2, k3). Within a triangle 1/z is linear in
(u, v), and an attribute a is interpolated with perspective: a = Σ λᵢ aᵢ/zᵢ / Σ λᵢ/zᵢ. Distortion is
applied to vertices, so that edges stay straight. Shading is Lambertian, with a light above and to
the left of the camera, plus a rim light at grazing angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ....solver.kernel import cached
from ...arrays import BoolArray, Float32Array, Float64Array, FloatArray, Uint8Array

NEAR = 0.05  # metres; the near plane, at which triangles are clipped
_TO_LIGHT = np.array([-0.40, -0.66, -0.63]) / np.linalg.norm([-0.40, -0.66, -0.63])
_AMBIENT = 0.42
_DIFFUSE = 0.58
_RIM = 0.30
# Where a vertex is: behind the near plane, or beyond the distortion model; 0: visible.
_BEHIND = 1
_OUTSIDE = 2


@dataclass
class Canvas:
    """The drawing: ``rgba`` (H, W, 4) uint8, sRGB and opacity, and ``depth`` (H, W) float32 metres,
    inf if empty.
    """

    rgba: Uint8Array
    depth: Float32Array

    @classmethod
    def blank(cls, width: int, height: int) -> Canvas:
        """Create an empty canvas; width and height in pixels."""
        return cls(
            np.zeros((height, width, 4), np.uint8), np.full((height, width), np.inf, np.float32)
        )

    @property
    def coverage(self) -> BoolArray:
        """(H, W) bool: True where something was drawn."""
        return np.isfinite(self.depth)


def rasterize(
    canvas: Canvas,
    vertices_cam: FloatArray,
    triangles: NDArray[np.integer[Any]],
    face_colors: FloatArray,
    intrinsics: Float64Array,
    dist: Float64Array | None = None,
    opacity: float = 1.0,
    shading: Float64Array | None = None,
) -> None:
    """Draw a mesh into the canvas, with depth test and back-face culling.

    :param canvas: modified in place.
    :param vertices_cam: (V, 3) metres, camera axes.
    :param triangles: (F, 3) vertex indices, counter-clockwise seen from outside.
    :param face_colors: (F, 3) sRGB, 0..1; or (3,), one colour for all.
    :param intrinsics: (3, 3) K in pixels of the canvas.
    :param dist: up to (5,) distortion coefficients; None for none.
    :param opacity: 0..1, written to the canvas's fourth channel.
    :param shading: (V, 2) as `shade` returns it, which is the default.
    """
    vertices = np.ascontiguousarray(vertices_cam, np.float64)
    corners = np.ascontiguousarray(triangles, np.int32)
    if shading is None:
        shading = shade(vertices, vertex_normals(vertices, corners))
    # A broadcast view would be another type, and compiled again.
    colors = np.empty((len(corners), 3), np.float32)
    colors[:] = face_colors
    lens = np.zeros(5)
    if dist is not None:
        coefficients = np.ravel(dist)[:5]
        lens[: len(coefficients)] = coefficients
    K = np.ascontiguousarray(intrinsics, np.float64)
    screen, where = _project(vertices, shading, K, lens, _largest_radius2(lens))
    alpha = np.uint8(round(255 * min(max(opacity, 0.0), 1.0)))
    _draw(
        canvas.rgba, canvas.depth, vertices, screen, where, shading, corners, colors, K, lens, alpha
    )


@cached
@njit(nogil=True)
def fill_silhouette(
    coverage: BoolArray, screen: Float64Array, triangles: NDArray[np.int32]
) -> None:
    """Set the pixels whose centres triangles cover that are seen from outside, as `rasterize` would
    draw them.

    :param coverage: (H, W), modified in place.
    :param screen: (V, 2) pixels; triangles with a vertex that is not finite are left out.
    :param triangles: (F, 3) vertex indices, counter-clockwise seen from outside.
    """
    height, width = coverage.shape
    for f in range(len(triangles)):
        i, j, k = triangles[f]
        a = screen[i]
        b = screen[j]
        c = screen[k]
        u0, u1, v0, v1, du_a, dv_a, du_b, dv_b = _extent(a, b, c, width, height)
        for v in range(v0, v1 + 1):
            for u in range(u0, u1 + 1):
                la = du_a * (u - b[0]) + dv_a * (v - b[1])
                lb = du_b * (u - c[0]) + dv_b * (v - c[1])
                if la >= -1e-9 and lb >= -1e-9 and 1.0 - la - lb >= -1e-9:
                    coverage[v, u] = True


@cached
@njit(nogil=True)
def _extent(
    a: Float64Array, b: Float64Array, c: Float64Array, width: int, height: int
) -> tuple[int, int, int, int, float, float, float, float]:
    """Return the first and the last u and v, within the picture, of a triangle with corners (u, v,
    ...), and by how much the shares of a and of b grow with u and v; no pixel where it is seen from
    inside.
    """
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    # A triangle that is counter-clockwise seen from outside is clockwise here, since v points down.
    if not (area < 0 and abs(area) < 1e18):
        return 0, -1, 0, -1, 0.0, 0.0, 0.0, 0.0
    u0 = int(np.ceil(min(max(min(a[0], b[0], c[0]), 0.0), width)))
    u1 = int(np.floor(min(max(max(a[0], b[0], c[0]), -1.0), width - 1.0)))
    v0 = int(np.ceil(min(max(min(a[1], b[1], c[1]), 0.0), height)))
    v1 = int(np.floor(min(max(max(a[1], b[1], c[1]), -1.0), height - 1.0)))
    du_a = -(c[1] - b[1]) / area
    dv_a = (c[0] - b[0]) / area
    du_b = -(a[1] - c[1]) / area
    dv_b = (a[0] - c[0]) / area
    return u0, u1, v0, v1, du_a, dv_a, du_b, dv_b


@cached
@njit(nogil=True)
def vertex_normals(vertices: Float64Array, triangles: NDArray[np.int32]) -> Float64Array:
    """Calculate unit normals (V, 3), area-weighted means of the triangles around each vertex (zero
    without triangles).

    :param vertices: (V, 3).
    :param triangles: (F, 3) vertex indices.
    """
    normals = np.zeros_like(vertices)
    for f in range(len(triangles)):
        a, b, c = triangles[f]
        e0 = vertices[b, 0] - vertices[a, 0]
        e1 = vertices[b, 1] - vertices[a, 1]
        e2 = vertices[b, 2] - vertices[a, 2]
        d0 = vertices[c, 0] - vertices[a, 0]
        d1 = vertices[c, 1] - vertices[a, 1]
        d2 = vertices[c, 2] - vertices[a, 2]
        n0 = e1 * d2 - e2 * d1
        n1 = e2 * d0 - e0 * d2
        n2 = e0 * d1 - e1 * d0
        for i in (a, b, c):
            normals[i, 0] += n0
            normals[i, 1] += n1
            normals[i, 2] += n2
    for i in range(len(normals)):
        length = np.sqrt(normals[i, 0] ** 2 + normals[i, 1] ** 2 + normals[i, 2] ** 2)
        if length > 0:
            for k in range(3):  # the row at once takes two seconds to compile
                normals[i, k] /= length
    return normals


@cached
@njit(nogil=True)
def shade(vertices: Float64Array, normals: Float64Array) -> Float64Array:
    """Calculate the shading (V, 2): factor on the surface's colour (ambient + Lambert), and white
    to add (rim).

    :param vertices: (V, 3) metres, camera axes.
    :param normals: (V, 3) unit vectors.
    """
    out = np.empty((len(vertices), 2))
    for i in range(len(vertices)):
        x, y, z = vertices[i]
        n0, n1, n2 = normals[i]
        lambert = max(0.0, n0 * _TO_LIGHT[0] + n1 * _TO_LIGHT[1] + n2 * _TO_LIGHT[2])
        facing = max(0.0, -(n0 * x + n1 * y + n2 * z) / max(1e-9, np.sqrt(x * x + y * y + z * z)))
        out[i, 0] = _AMBIENT + _DIFFUSE * lambert
        out[i, 1] = _RIM * (1.0 - facing) ** 3
    return out


def _largest_radius2(lens: Float64Array) -> float:
    """Calculate the squared normalized radius beyond which radial distortion is no longer
    monotonic.
    """
    k1, k2, _, _, k3 = lens
    roots = np.roots([7 * k3, 5 * k2, 3 * k1, 1.0])
    real = roots[(abs(roots.imag) < 1e-9) & (roots.real > 0)].real
    return float(real.min()) if len(real) else np.inf


@cached
@njit(nogil=True)
def _set_corner(
    corner: Float64Array,
    x_cam: float,
    y_cam: float,
    z_cam: float,
    gain: float,
    rim: float,
    K: Float64Array,
    lens: Float64Array,
) -> None:
    """Set a corner (u, v, 1/z, shading) to the projection of a point in camera axes."""
    x = x_cam / z_cam
    y = y_cam / z_cam
    r2 = x * x + y * y
    radial = 1 + r2 * (lens[0] + r2 * (lens[1] + r2 * lens[4]))
    u = x * radial + 2 * lens[2] * x * y + lens[3] * (r2 + 2 * x * x)
    v = y * radial + lens[2] * (r2 + 2 * y * y) + 2 * lens[3] * x * y
    corner[0] = K[0, 0] * u + K[0, 1] * v + K[0, 2]
    corner[1] = K[1, 1] * v + K[1, 2]
    corner[2] = 1.0 / z_cam
    corner[3] = gain
    corner[4] = rim


@cached
@njit(nogil=True)
def _project(
    vertices: Float64Array,
    shading: Float64Array,
    K: Float64Array,
    lens: Float64Array,
    largest: float,
) -> tuple[Float64Array, Uint8Array]:
    """Project the vertices: (V, 5) pixels, 1/z and shading, and (V,) whether they are in front,
    behind or outside.
    """
    screen = np.zeros((len(vertices), 5))
    where = np.zeros(len(vertices), np.uint8)
    for i in range(len(vertices)):
        x, y, z = vertices[i]
        if not z >= NEAR:
            where[i] = _BEHIND
        elif not (x * x + y * y) / (z * z) < largest:
            where[i] = _OUTSIDE
        else:
            _set_corner(screen[i], x, y, z, shading[i, 0], shading[i, 1], K, lens)
    return screen, where


@cached
@njit(nogil=True)
def _draw(
    rgba: Uint8Array,
    depth: Float32Array,
    vertices: Float64Array,
    screen: Float64Array,
    where: Uint8Array,
    shading: Float64Array,
    triangles: NDArray[np.int32],
    colors: Float32Array,
    K: Float64Array,
    lens: Float64Array,
    alpha: np.uint8,
) -> None:
    cut = np.empty((4, 5))
    for f in range(len(triangles)):
        a, b, c = triangles[f]
        behind = (where[a] == _BEHIND) + (where[b] == _BEHIND) + (where[c] == _BEHIND)
        if behind == 3 or where[a] == _OUTSIDE or where[b] == _OUTSIDE or where[c] == _OUTSIDE:
            continue
        if behind == 0:
            _fill(rgba, depth, screen[a], screen[b], screen[c], colors[f], alpha)
            continue
        n = _clip_at_near(cut, vertices, shading, triangles[f], K, lens)
        for k in range(1, n - 1):
            _fill(rgba, depth, cut[0], cut[k], cut[k + 1], colors[f], alpha)


@cached
@njit(nogil=True)
def _clip_at_near(
    cut: Float64Array,
    vertices: Float64Array,
    shading: Float64Array,
    triangle: NDArray[np.int32],
    K: Float64Array,
    lens: Float64Array,
) -> int:
    """Clip a triangle at the near plane to a fan of 3 or 4 corners (u, v, 1/z, shading); return
    their number.
    """
    n = 0
    for i in range(3):
        a = triangle[i]
        b = triangle[(i + 1) % 3]
        za = vertices[a, 2]
        zb = vertices[b, 2]
        if za >= NEAR:
            x, y, z = vertices[a]
            _set_corner(cut[n], x, y, z, shading[a, 0], shading[a, 1], K, lens)
            n += 1
        if (za >= NEAR) != (zb >= NEAR):
            s = (NEAR - za) / (zb - za)
            x = vertices[a, 0] + s * (vertices[b, 0] - vertices[a, 0])
            y = vertices[a, 1] + s * (vertices[b, 1] - vertices[a, 1])
            gain = shading[a, 0] + s * (shading[b, 0] - shading[a, 0])
            rim = shading[a, 1] + s * (shading[b, 1] - shading[a, 1])
            _set_corner(cut[n], x, y, NEAR, gain, rim, K, lens)
            n += 1
    return n


@cached
@njit(nogil=True)
def _fill(
    rgba: Uint8Array,
    depth: Float32Array,
    a: Float64Array,
    b: Float64Array,
    c: Float64Array,
    color: Float32Array,
    alpha: np.uint8,
) -> None:
    """Fill one triangle with corners (u, v, 1/z, shading): the pixels whose centres it covers and
    that pass the depth test.
    """
    height, width = depth.shape
    u0, u1, v0, v1, du_a, dv_a, du_b, dv_b = _extent(a, b, c, width, height)
    for v in range(v0, v1 + 1):
        la = du_a * (u0 - b[0]) + dv_a * (v - b[1])
        lb = du_b * (u0 - c[0]) + dv_b * (v - c[1])
        for u in range(u0, u1 + 1):
            lc = 1.0 - la - lb
            # The tolerance prevents gaps between neighbours by rounding.
            if la >= -1e-9 and lb >= -1e-9 and lc >= -1e-9:
                wa = la * a[2]
                wb = lb * b[2]
                wc = lc * c[2]
                z = 1.0 / (wa + wb + wc)
                if z < depth[v, u]:
                    depth[v, u] = z
                    gain = (wa * a[3] + wb * b[3] + wc * c[3]) * z * 255
                    rim = (wa * a[4] + wb * b[4] + wc * c[4]) * z * 255
                    for k in range(3):
                        rgba[v, u, k] = np.uint8(min(255.0, gain * color[k] + rim))
                    rgba[v, u, 3] = alpha
            la += du_a
            lb += du_b
