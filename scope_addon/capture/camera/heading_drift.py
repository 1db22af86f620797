# SPDX-License-Identifier: GPL-3.0-or-later
"""Heading drift: removes the slowly growing error of the camera's rotation with the edges of
buildings.

A camera that travels along a wall sees it pass by, which looks like a rotation, however many
corners are followed. The directions of the wall's edges do not depend on the camera's position:
where three orthogonal ones are visible (`manhattan`), they give the camera's rotation at any time.
Let n_i be the normals of the edges' planes in the axes that drift, δ the drift that rotates these
axes into the first frame's, and d the three directions. Then

    min over δ of Σ_i w_i ρ(min_d |n_i · δᵀ d|)

is solved from the drift half a second before, by Gauss-Newton steps with a narrowing robust kernel
ρ. The drift is smooth, unlike the errors in single frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....solver.rotations import exp, log
from ...arrays import Float64Array
from ...kinematics.smoothing import gaussian_smooth, interpolated_places
from .intrinsics import Camera
from .line_segments import Lines, Segments
from .manhattan import Edges, line_normal_equations

EDGE_INTERVAL_S = 0.5  # between two frames in which edges are detected
# The longer side of the images whose edges are found after the first one: half the time, as
# accurate.
EDGE_SIDE_PX = 640
KERNEL_WIDTHS = np.radians([4.0, 3.0, 2.0, 1.2, 1.0, 1.0])  # of ρ, one per step
MIN_SUPPORT = 1.5  # sides of the picture that the three directions must explain in the first frame
# The least share of the edges' length that is explained: three directions explain a third by
# chance.
MIN_SUPPORT_SHARE = 0.5
KEPT_SUPPORT = 0.4  # of that, in a later frame
# The least support of the second best direction: one alone leaves the rotation about itself open.
MIN_SECOND_SUPPORT = 0.25
MIN_FRAMES = 3
DRIFT_CUTOFF_HZ = 1.0


@dataclass(frozen=True)
class FrameEdges:
    """The edges in one frame of a clip."""

    row: int
    segments: Segments

    def steadied(self, camera: Camera, zoom: float) -> FrameEdges:
        """Return the edges as a lens of the camera's focal length sees them, over which the
        frame's is ``zoom``.
        """
        ends_px = camera.at_zoom(self.segments.ends_px, 1.0 / zoom)
        return replace(self, segments=replace(self.segments, ends_px=ends_px))


def remove_heading_drift(
    R_first_camera: Float64Array,
    times: Float64Array,
    edge_frames: Sequence[FrameEdges],
    camera: Camera,
    image_size: tuple[int, int],
) -> Float64Array:
    """Correct the camera's rotation where the edges of enough frames agree on three directions.

    :param R_first_camera: (T, 3, 3) the camera's axes in the first frame's, with drift.
    :param times: (T,) seconds.
    :param edge_frames: in order; the drift at the first one is small.
    :param image_size: (width, height) in pixels.
    :return: (T, 3, 3); the input itself where there is nothing to correct.
    """
    if len(edge_frames) < MIN_FRAMES:
        return R_first_camera
    first = edge_frames[0]
    edges = Edges.of(first.segments, *image_size)
    support, axes = edges.axes(float(camera.intrinsics[0, 0]))
    if support < max(MIN_SUPPORT, MIN_SUPPORT_SHARE * float(edges.weight.sum())):
        return R_first_camera
    axes = axes @ R_first_camera[first.row].T
    drift = np.eye(3)
    known = []
    for frame in edge_frames:
        lines = frame.segments.lines(camera).rotated(R_first_camera[frame.row])
        found, supports = _drift(lines, axes, drift)
        if frame is first:  # refine the directions themselves, to a fraction of a degree
            axes = axes @ found
        elif supports.sum() > KEPT_SUPPORT * support and np.sort(supports)[-2] > MIN_SECOND_SUPPORT:
            drift = found
            known.append((frame.row, log(drift)))
    if len(known) < MIN_FRAMES - 1:
        return R_first_camera
    rows = np.array([first.row, *(row for row, _ in known)])
    vectors = np.array([np.zeros(3), *(vector for _, vector in known)])
    drifts = interpolated_places(vectors, times[rows], times)
    corrected: Float64Array = exp(gaussian_smooth(drifts, times, DRIFT_CUTOFF_HZ)) @ R_first_camera
    return corrected[0].T @ corrected


def _drift(
    lines: Lines, axes: Float64Array, start: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return δ (3, 3) from ``start``, and how much each of the directions ``axes`` (3, 3) explains,
    in sides.
    """
    E = start.T
    supports: Float64Array = np.zeros(3)
    for sigma in KERNEL_WIDTHS:
        H, g, supports = line_normal_equations(lines, axes @ E.T, sigma)
        E = exp(np.linalg.solve(H + 1e-3 * np.eye(3), g)) @ E
    return E.T, supports
