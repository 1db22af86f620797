# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of the background of a clip, or of a window of it, once its frames were followed.

Windows that were followed apart overlap: the frames before a window's first one are also the last
ones of the window before. Let R_k(t) be the camera's rotation at time t in the axes of window k's
first frame. In the common frames,

    G_k = G_{k−1} R_{k−1}(t) R_k(t)ᵀ

takes the axes of window k to those of the clip's first frame; the mean of the common frames is
used. In these frames the rotation goes over evenly from one window to the other, because what is
left of their difference would be a jump.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate

import numpy as np

from ....solver.rotations import exp, log
from ...arrays import BoolArray, Float64Array
from ...kinematics.smoothing import fill_rotation_gaps, interpolate_rotations
from .corner_tracks import SAMPLES_HZ, CornerTracks, corners_at_rest, joined_corners
from .heading_drift import FrameEdges, remove_heading_drift
from .intrinsics import Camera
from .line_segments import Lines, Segments
from .odometry import Odometry, sighting_tolerance, travel_of
from .zoom import Zoom, find_zoom

TRAVELLING_SHARE = 0.8  # mean share of inliers below which the camera travels: near corners pass by
STATIC_DEG = 0.35  # largest rotation during a clip of a camera on a tripod
REVEALING_S = 30.0  # from the first frame with edges on, edges that people hid in it are looked for


@dataclass(frozen=True)
class CameraMotion:
    """The camera's rotation during T frames, and its travel up to scale where it is seen."""

    R_first_camera: Float64Array  # (T, 3, 3) the camera's axes in those of the first frame
    known: BoolArray  # (T,) frames in which it was estimated; elsewhere it is interpolated
    travel: Odometry | None = None
    # (n, 3) unit vectors in the first frame's axes: corners of the background that stay where the
    # rotation alone would have them, as those near a camera that travels do not
    at_rest: Float64Array = field(default_factory=lambda: np.zeros((0, 3)))

    @classmethod
    def given(cls, world_from_camera: Float64Array) -> CameraMotion:
        """Return the motion of a camera whose poses (T, 4, 4) are known."""
        R_world_camera = world_from_camera[:, :3, :3]
        return cls(R_world_camera[0].T @ R_world_camera, np.ones(len(R_world_camera), bool))

    @property
    def is_static(self) -> bool:
        """Whether the camera is static, as far as can be determined."""
        if self.travel is not None:
            return False
        return not self.known.any() or self.largest_turn_deg < STATIC_DEG

    @property
    def largest_turn_deg(self) -> float:
        """The largest angle between any frame and the first one, in degrees."""
        return float(np.degrees(np.linalg.norm(log(self.R_first_camera), axis=-1).max()))


@dataclass(frozen=True)
class BackgroundRecord:
    """The background of T frames; its edges were found in a few of them, first in one in which
    somebody is seen.

    As long as the camera has not rotated, the other ones have only edges that people hid in all of
    those before.
    """

    times: Float64Array  # (T,) seconds
    R_first_camera: Float64Array  # (T, 3, 3) as followed; identity where not known
    known: BoolArray  # (T,)
    inlier_shares: list[float]  # of the corners, in the frames that were followed
    edge_frames: list[FrameEdges] = field(default_factory=list)
    bars: list[Float64Array] = field(default_factory=list)  # in the first of the edge frames
    corners: CornerTracks = field(default_factory=CornerTracks.none)

    def steadied(
        self, camera: Camera, image_size: tuple[int, int]
    ) -> tuple[BackgroundRecord, Zoom | None]:
        """Return the background as a lens sees it that keeps the focal length of the first frame,
        and how the lens zooms; the record itself where it does not.

        :param camera: the intrinsics that were assumed while the background was followed.
        :param image_size: (width, height) in pixels.
        """
        zoom = find_zoom(self.corners, self.times, camera, max(image_size))
        if zoom is None:
            return self, None
        factors = zoom.factors
        points = camera.at_zoom(self.corners.points_px, 1.0 / factors[self.corners.rows, None])
        steady = replace(
            self,
            R_first_camera=zoom.R_first_camera,
            known=np.ones(len(factors), bool),
            inlier_shares=[],  # The zoom has lowered them.
            edge_frames=[edge.steadied(camera, factors[edge.row]) for edge in self.edge_frames],
            corners=replace(self.corners, points_px=points.astype(np.float32)),
        )
        return steady, zoom

    def motion(
        self, followed_with: Camera, camera: Camera, image_size: tuple[int, int]
    ) -> CameraMotion:
        """Return the rotation in all frames; frames that were skipped are interpolated on an arc.

        :param followed_with: the intrinsics that were assumed while the background was followed.
        :param camera: the intrinsics as they are known now. A small rotation moves the image by f
            times its angle, so the angles shrink as the focal length grows; rotations about the
            optical axis do not change.
        :param image_size: (width, height) in pixels.
        """
        known = self.known
        R = self.R_first_camera.copy()
        times = self.times
        if known.sum() < 2:
            return CameraMotion(np.tile(np.eye(3), (len(R), 1, 1)), np.zeros(len(R), bool))
        ratio = followed_with.intrinsics[0, 0] / camera.intrinsics[0, 0]
        if ratio != 1.0:
            seen = R[known]
            steps = exp(log(np.swapaxes(seen[:-1], 1, 2) @ seen[1:]) * [ratio, ratio, 1.0])
            R[known] = np.array(list(accumulate(steps, np.matmul, initial=seen[0])))
        filled = fill_rotation_gaps(R[:, None], known, times)[:, 0]
        a, b = np.flatnonzero(known)[-2:]
        after = np.arange(b + 1, len(R))
        # Extrapolate at constant angular velocity.
        if len(after) and times[-1] - times[b] < 1.5 / SAMPLES_HZ:
            rate = log(R[a].T @ R[b]) / (times[b] - times[a])
            filled[after] = R[b] @ exp((times[after] - times[b])[:, None] * rate)
        R = filled[0].T @ filled
        if self.inlier_shares and np.mean(self.inlier_shares) < TRAVELLING_SHARE:
            R = remove_heading_drift(R, times, self.edge_frames, camera, image_size)
        odometry = travel_of(self.corners, R, times, camera, max(image_size))
        if odometry.travels:
            return CameraMotion(odometry.R_first_camera, known, odometry)
        tolerance = sighting_tolerance(camera, max(image_size))
        return CameraMotion(R, known, at_rest=corners_at_rest(self.corners, R, camera, tolerance))

    def lines(self, motion: CameraMotion, camera: Camera) -> Lines:
        """Return the lines of the background in the first frame's axes.

        Those of a static camera include what people hid at first and revealed by moving away.
        """
        if not self.edge_frames:
            return Lines.none()
        if motion.is_static:
            return Segments.of_all(
                [edge.segments for edge in self.edge_frames if self._is_new(edge)]
            ).lines(camera)
        first = self.edge_frames[0]
        return first.segments.lines(camera).rotated(motion.R_first_camera[first.row])

    def _is_new(self, edge: FrameEdges) -> bool:
        """Return whether none of a frame's edges were seen before.

        They may have been where the camera had rotated, and after a window that was followed apart.
        """
        first = self.edge_frames[0]
        if edge is first:
            return True
        is_early = self.times[edge.row] - self.times[first.row] <= REVEALING_S
        return bool(is_early) and not is_rotated(self.R_first_camera[edge.row])


def is_rotated(R: Float64Array) -> bool:
    """Return whether a rotation (3, 3) is larger than that of a camera on a tripod."""
    return bool(np.degrees(np.linalg.norm(log(R))) >= STATIC_DEG)


def best_rotation(products: Float64Array) -> Float64Array:
    """Return the rotations (..., 3, 3) that best take directions a to b, from the sums (..., 3, 3)
    of b aᵀ (Kabsch 1976).
    """
    U, _, Vt = np.linalg.svd(products)
    U[..., :, 2] *= np.sign(np.linalg.det(U @ Vt))[..., None]
    return U @ Vt


def joined_backgrounds(
    parts: Sequence[BackgroundRecord], firsts: Sequence[int]
) -> BackgroundRecord:
    """Join the backgrounds of a clip's windows, in order.

    :param parts: at least one.
    :param firsts: of each window, how many of its frames are also the last ones of the window
        before.
    """
    whole = parts[0]
    G = np.eye(3)
    rotations = [whole.R_first_camera]
    known = [whole.known]
    times = [whole.times]
    shares = list(whole.inlier_shares)
    edges = list(whole.edge_frames)
    bars = whole.bars
    corners = [whole.corners]
    numbers = whole.corners.count
    rows = len(whole.times)
    for before, part, first in zip(parts, parts[1:], firsts[1:], strict=False):
        G = G @ _link(before, part, first)
        rotations[-1] = _faded(
            rotations[-1], known[-1], G @ part.R_first_camera[:first], part.known[:first]
        )
        times.append(part.times[first:])
        known.append(part.known[first:])
        rotations.append(
            np.where(part.known[first:, None, None], G @ part.R_first_camera[first:], np.eye(3))
        )
        shares += part.inlier_shares
        if not edges:
            bars = part.bars
        counted = [edge for edge in part.edge_frames if edge.row >= first or not edges]
        edges += [replace(edge, row=edge.row + rows - first) for edge in counted]
        corners.append(part.corners.shifted(rows - first, numbers))
        numbers += part.corners.count
        rows += len(part.times) - first
    return BackgroundRecord(
        np.concatenate(times),
        np.concatenate(rotations),
        np.concatenate(known),
        shares,
        edges,
        bars,
        joined_corners(corners),
    )


def _faded(
    R: Float64Array, known: BoolArray, R_after: Float64Array, known_after: BoolArray
) -> Float64Array:
    """Return rotations (T, 3, 3) whose last n frames go over to those of the next window.

    :param known: (T,).
    :param R_after: (n, 3, 3) in the same axes.
    :param known_after: (n,).
    """
    n = len(R_after)
    if not n or n > len(R):
        return R
    out = R.copy()
    rows = np.flatnonzero(known[-n:] & known_after)
    before = R[len(R) - n + rows]
    share = (rows + 1) / (n + 1)
    out[len(R) - n + rows] = interpolate_rotations(before, R_after[rows], share)
    return out


def _link(before: BackgroundRecord, part: BackgroundRecord, first: int) -> Float64Array:
    """Return the rotation (3, 3) from the axes of one window to those of the window before.

    Where no frame is known in both, the camera is taken to have kept the last direction that is
    known.
    """
    start = len(before.times) - first
    both = np.flatnonzero(before.known[start:] & part.known[:first])
    if len(both):
        total = np.einsum(
            "kij,klj->il", before.R_first_camera[start + both], part.R_first_camera[both]
        )
    else:
        seen = np.flatnonzero(before.known)
        total = before.R_first_camera[seen[-1]] if len(seen) else np.eye(3)
    return best_rotation(total)
