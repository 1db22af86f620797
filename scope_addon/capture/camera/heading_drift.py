# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's turning without its drift, by the edges of what people build.

A camera that travels along a wall sees it pass by, which looks like a turn, however many corners are followed. The
directions of the wall's edges do not depend on where the camera is: where three of them at right angles are seen
(`right_angles`), they tell how it is turned at any time. With the normals n_i of the edges' planes in axes that drift,
turned by the drift δ into the first frame's, and the three directions d,

    min over δ of Σ_i w_i ρ(min_d |n_i · δᵀ d|)

from what it was half a second before, by Gauss-Newton steps that narrow ρ. The drift is smooth, errors of single looks
are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....solver.rotations import exp, log
from ...kinematics.smoothing import gaussian_smooth
from .intrinsics import Camera
from .line_segments import Lines, Segments
from .manhattan import Edges, line_normal_equations

LOOKS_EVERY_S = 0.5
LOOK_SIDE_PX = 640  # the longer side of the picture in looks after the first one: half the time, as right
NARROWING = np.radians([4.0, 3.0, 2.0, 1.2, 1.0, 1.0])  # ρ's width in one step after the other
LEAST_SUPPORT = 1.5  # sides of the picture that the three directions must explain at first
LEAST_SHARE = 0.5  # of the edges' length, likewise: a third finds three directions by chance
KEPT_SUPPORT = 0.4  # of that, in a later look
SECOND_SUPPORT = 0.25  # sides along the second best of them: one alone leaves a turn about itself open
FEWEST_LOOKS = 3
DRIFT_CUTOFF_HZ = 1.0


@dataclass(frozen=True)
class Look:
    """The edges in one frame."""

    row: int
    segments: Segments


def remove_heading_drift(
    R_first_camera: np.ndarray, times: np.ndarray, looks: Sequence[Look], camera: Camera, width: int, height: int
) -> np.ndarray:
    """(T, 3, 3) the camera's axes in the first frame's, corrected where the looks agree on three directions.

    :param R_first_camera: (T, 3, 3) with drift;  times: (T,) seconds;  looks: in order, the first one at small drift.
    """
    if len(looks) < FEWEST_LOOKS:
        return R_first_camera
    first = looks[0]
    edges = Edges.of(first.segments, width, height)
    support, axes = edges.axes(float(camera.intrinsics[0, 0]))
    if support < max(LEAST_SUPPORT, LEAST_SHARE * float(edges.weight.sum())):
        return R_first_camera
    axes = axes @ R_first_camera[first.row].T
    drift, known = np.eye(3), []
    for look in looks:
        lines = look.segments.lines(camera).turned(R_first_camera[look.row])
        found, supports = _drift(lines, axes, drift)
        if look is first:  # the directions themselves, to a fraction of a degree
            axes = axes @ found
        elif supports.sum() > KEPT_SUPPORT * support and np.sort(supports)[-2] > SECOND_SUPPORT:
            drift = found
            known.append((look.row, log(drift)))
    if len(known) < FEWEST_LOOKS - 1:
        return R_first_camera
    rows = np.array([first.row, *(row for row, _ in known)])
    vectors = np.array([np.zeros(3), *(vector for _, vector in known)])
    drifts = np.stack([np.interp(times, times[rows], vectors[:, k]) for k in range(3)], axis=1)
    corrected = exp(gaussian_smooth(drifts, times, DRIFT_CUTOFF_HZ)) @ R_first_camera
    return corrected[0].T @ corrected


def _drift(lines: Lines, axes: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """δ (3, 3) from ``start``, and how much each of the directions ``axes`` (3, 3) explains, in sides."""
    E = start.T
    supports: np.ndarray = np.zeros(3)
    for sigma in NARROWING:
        H, g, supports = line_normal_equations(lines, axes @ E.T, sigma)
        E = exp(np.linalg.solve(H + 1e-3 * np.eye(3), g)) @ E
    return E.T, supports
