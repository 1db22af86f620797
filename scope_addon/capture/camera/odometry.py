# SPDX-License-Identifier: GPL-3.0-or-later
"""Visual odometry: how a camera travels and rotates, up to scale, from corners of the background.

Two frames tell a camera that travels from one that only rotates or zooms: rotation and zoom move
the picture alike at any depth (`Turn`); travel moves near corners more than far ones, which only an
essential matrix explains. Where one explains clearly more corners than any turn does, the two
frames give a map: places of corners, from two lines of sight each. From there on, every frame
is placed by the corners whose places are known (`_place`), new corners are placed by frames that
see them from far enough apart, and the last frames are adjusted with all their corners
(`bundle_adjustment`). Where too few corners of the map are left, another map begins, at another
scale. Frames that both maps place tell how the second one lies in the first; without them, the path
has another part.

Sources: Nistér 2004 (essential matrix from five points), Triggs et al. 2000 (bundle adjustment).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ....solver.rotations import exp, log, nearest_rotation
from ...arrays import Float64Array, IndexArray, unit_vectors
from ...kinematics.smoothing import (
    interpolate_rotations,
    interpolated_places,
    interpolated_rotations,
)
from .bundle_adjustment import (
    Bundle,
    adjust,
    projected,
    refine_pose,
)
from .corner_tracks import CornerTracks
from .intrinsics import Camera
from .turn import Turn, homogeneous

WORKING_SIDE_PX = (
    480.0  # of the images in which the corners were followed: errors are in its pixels
)
INLIER_PX = 1.5
MIN_COMMON = 30  # corners that two frames must share
MIN_COMMON_SHARE = 0.45  # of those of the first one: a small part of a picture tells little
MIN_ESSENTIAL_SHARE = 0.55  # of them that an essential matrix explains
# Of the corners that an essential matrix explains, the share that a camera may explain which only
# rotates and zooms.
MAX_TURN_SHARE = 0.65
MIN_PARALLAX = 0.012  # radians that corners move by more than in a rotation, in the median
MIN_TRIANGULATION = 0.012  # radians between two lines of sight of a corner
FARTHEST = 200.0  # of a corner, in units of the first baseline
MIN_MAP = 14  # corners with known places that a frame must see
MIN_MAP_SHARE = 0.5  # of them that must agree
ADJUSTED = 30  # frames that are adjusted together, with the first of them fixed
FIXED = 8
ADJUSTED_EVERY = 6
# Frames between the two that begin a map.
PAIRS = np.array([2, 4, 7, 10, 13, 16, 20, 25, 31, 40, 50])
NEXT_START = 4  # frames from one that begins no map to the next one that is tried
COMMON = (4, 30)  # least and most frames that both of two maps place
MAX_COMMON_OFF = 0.15  # between their paths there, relative to the first one's


@dataclass(frozen=True)
class Odometry:
    """The camera in T frames.

    p_first = R_first_camera p_camera + s_k center, with the scale s_k of the part k of the path.
    """

    R_first_camera: Float64Array  # (T, 3, 3)
    center: Float64Array  # (T, 3) in units of its part, 0 where no travel is seen
    part: IndexArray  # (T,) from 0; −1 where the camera does not travel, as far as is seen
    # Of each part, places (C, 3) of corners in the first frame's axes, in units of the part.
    maps: list[Float64Array]

    @property
    def travels(self) -> bool:
        """Whether the camera travels in any frame."""
        return bool((self.part >= 0).any())


@dataclass
class Sightings:
    """The corners that each of S frames sees, as lines of sight."""

    rows: IndexArray  # (S,) numbers of the frames
    numbers: list[IndexArray]  # of the corners, ascending
    rays: list[Float64Array]  # (n, 2) x / z and y / z
    tolerance: float  # radians

    @classmethod
    def of(cls, corners: CornerTracks, camera: Camera, longer_side_px: float) -> Sightings:
        """Return the corners of a clip whose images have this longer side."""
        rows, first = np.unique(corners.rows, return_index=True)
        rays = camera.rays(corners.points_px.astype(float))[:, :2]
        return cls(
            rows,
            np.split(corners.numbers, first[1:]),
            np.split(rays, first[1:]),
            sighting_tolerance(camera, longer_side_px),
        )

    def common(self, a: int, b: int) -> tuple[IndexArray, IndexArray, IndexArray]:
        """Return the numbers of the corners that two frames share, and where each has them."""
        numbers, in_a, in_b = np.intersect1d(
            self.numbers[a], self.numbers[b], assume_unique=True, return_indices=True
        )
        return numbers, in_a, in_b


def sighting_tolerance(camera: Camera, longer_side_px: float) -> float:
    """Return the largest error of a corner's line of sight, radians, in images with this longer
    side.
    """
    return float(INLIER_PX * longer_side_px / WORKING_SIDE_PX / camera.intrinsics[0, 0])


def travel_of(
    corners: CornerTracks,
    R_first_camera: Float64Array,
    times: Float64Array,
    camera: Camera,
    longer_side_px: float,
) -> Odometry:
    """Return how the camera travels.

    :param R_first_camera: (T, 3, 3) as estimated for a camera that only rotates; it is kept where
        no travel is seen.
    :param times: (T,) seconds.
    :param longer_side_px: of the image.
    """
    sightings = Sightings.of(corners, camera, longer_side_px)
    tracker = _Tracker(sightings, R_first_camera[sightings.rows], corners.count)
    return _joined(tracker.parts(), sightings.rows, R_first_camera, times)


@dataclass
class _Part:
    """Consecutive frames of one map: p_camera = R p_map + t."""

    first: int  # number of the sighting
    R: Float64Array  # (n, 3, 3)
    t: Float64Array  # (n, 3)
    places: Float64Array  # (C, 3) of corners, in the axes of the map

    @property
    def end(self) -> int:
        """One more than the number of the last sighting."""
        return self.first + len(self.R)

    @property
    def centers(self) -> Float64Array:
        """The camera's places (n, 3)."""
        return -np.einsum("nji,nj->ni", self.R, self.t)

    def since(self, first: int) -> _Part:
        """Return the part without the sightings before a number."""
        left_out = max(0, first - self.first)
        return _Part(self.first + left_out, self.R[left_out:], self.t[left_out:], self.places)


class _Tracker:
    """Places the frames of a clip, one after another."""

    def __init__(self, sightings: Sightings, R_first_camera: Float64Array, corners: int) -> None:
        self._seen = sightings
        self._R_guess = np.swapaxes(R_first_camera, 1, 2)  # world to camera
        self._places = np.full((corners, 3), np.nan)
        self._is_outlier = np.zeros(corners, bool)
        self._first_ray = np.full((corners, 3), np.nan)  # in map axes
        self._first_center = np.full((corners, 3), np.nan)

    def parts(self) -> list[_Part]:
        """Return the parts of the path, in order."""
        parts: list[_Part] = []
        start = 0
        count = len(self._seen.rows)
        while start < count - 1:
            pair = self._first_pair(start)
            if pair is None:
                start += NEXT_START
                continue
            part = self._part(*pair)
            before = parts[-1] if parts else None
            earliest = 0 if before is None else max(before.first, before.end - COMMON[1])
            self._extend_backwards(part, earliest)
            part.places = self._places[~np.isnan(self._places[:, 0])]
            start = part.end - 1
            continued = None if before is None else _continued(before, part)
            if before is None:
                parts.append(part)
            elif continued is None:
                parts.append(part.since(before.end - 1))
            else:
                parts[-1] = continued
        return parts

    def _first_pair(self, a: int) -> tuple[int, int, Float64Array, Float64Array] | None:
        """Return the next two frames that see enough parallax, from frame ``a`` on, and rotation
        and translation from the one to the other.
        """
        for b in (a + PAIRS).tolist():
            if b >= len(self._seen.rows):
                return None
            _, in_a, in_b = self._seen.common(a, b)
            if len(in_a) < max(MIN_COMMON, MIN_COMMON_SHARE * len(self._seen.rays[a])):
                return None
            found = self._essential(self._seen.rays[a][in_a], self._seen.rays[b][in_b], a, b)
            if found is not None:
                return a, b, *found
        return None

    def _essential(
        self, rays_a: Float64Array, rays_b: Float64Array, a: int, b: int
    ) -> tuple[Float64Array, Float64Array] | None:
        """Return R (3, 3) and t (3,) of p_b = R p_a + t, |t| = 1; None where a homography explains
        nearly as much.
        """
        tolerance = self._seen.tolerance
        turned = homogeneous(rays_a) @ (self._R_guess[b] @ self._R_guess[a].T).T
        moved = np.linalg.norm(turned[:, :2] / turned[:, 2:] - rays_b, axis=1)
        spread = np.median(np.abs(moved - np.median(moved)))
        if max(np.median(moved), 3.0 * spread) < MIN_PARALLAX:
            return None
        cv2.setRNGSeed(0)
        E, mask = cv2.findEssentialMat(
            rays_a, rays_b, np.eye(3), cv2.RANSAC, 0.999, 0.7 * tolerance
        )
        if E is None or E.shape != (3, 3):
            return None
        explained = mask.ravel() > 0
        if explained.mean() < MIN_ESSENTIAL_SHARE:
            return None
        H, _ = cv2.findHomography(rays_a, rays_b, cv2.RANSAC, tolerance)
        if H is None:
            return None
        turn = Turn.nearest(np.asarray(H, float)).refined(rays_a, rays_b, tolerance)
        by_turn = turn.explains(rays_a, rays_b, tolerance)
        if by_turn[explained].mean() > MAX_TURN_SHARE:
            return None
        count, R, t, _ = cv2.recoverPose(E, rays_a[explained], rays_b[explained], np.eye(3))
        if count < 0.6 * explained.sum():
            return None
        return np.asarray(R, float), np.asarray(t, float).ravel()

    def _part(self, a: int, b: int, R: Float64Array, t: Float64Array) -> _Part:
        """Return the part of the path that begins with two frames."""
        self._places[:] = np.nan
        self._is_outlier[:] = False
        self._first_ray[:] = np.nan
        self._see(a, np.eye(3), np.zeros(3))
        self._triangulate(b, R, t)
        # The frames between the two lie between their poses; each is then placed by the map.
        share = np.arange(1, b - a)[:, None] / (b - a)
        part = _Part(
            a,
            np.concatenate([np.eye(3)[None], exp(share * log(R)), R[None]]),
            np.concatenate([np.zeros((1, 3)), share * t, t[None]]),
            self._places[:0],
        )
        for row in range(1, b - a):
            placed = self._place(a + row, part.R[row], part.t[row])
            if placed is not None:
                part.R[row], part.t[row] = placed
        self._adjust(part, fixed=1)
        for k in range(b + 1, len(self._seen.rows)):
            guess_R = self._R_guess[k] @ self._R_guess[k - 1].T @ part.R[-1]
            center = -part.R[-1].T @ part.t[-1]
            center = center + 0.8 * (center + part.R[-2].T @ part.t[-2])
            placed = self._place(k, guess_R, -guess_R @ center)
            if placed is None:
                break
            part.R = np.concatenate([part.R, placed[0][None]])
            part.t = np.concatenate([part.t, placed[1][None]])
            self._triangulate(k, *placed)
            self._see(k, *placed)
            if (k - b) % ADJUSTED_EVERY == 0:
                self._adjust(part)
        self._adjust(part)
        return part

    def _extend_backwards(self, part: _Part, end: int) -> None:
        """Place frames before the part, down to ``end``, by its map: the first pair with enough
        parallax may come late.
        """
        while part.first > end:
            k = part.first - 1
            guess_R = self._R_guess[k] @ self._R_guess[k + 1].T @ part.R[0]
            center = -part.R[0].T @ part.t[0]
            placed = self._place(k, guess_R, -guess_R @ center)
            if placed is None:
                break
            part.R = np.concatenate([placed[0][None], part.R])
            part.t = np.concatenate([placed[1][None], part.t])
            part.first = k

    def _see(self, k: int, R: Float64Array, t: Float64Array) -> None:
        """Remember the line of sight of the corners that the frame ``k`` sees first."""
        numbers = self._seen.numbers[k]
        new = np.isnan(self._first_ray[numbers, 0])
        rays = homogeneous(self._seen.rays[k][new]) @ R
        self._first_ray[numbers[new]] = unit_vectors(rays)
        self._first_center[numbers[new]] = -R.T @ t

    def _triangulate(self, k: int, R: Float64Array, t: Float64Array) -> None:
        """Place the corners that the frame ``k`` sees from far enough beside where they were first
        seen from: at the point nearest to both lines of sight.
        """
        numbers = self._seen.numbers[k]
        open_ = np.isnan(self._places[numbers, 0]) & ~np.isnan(self._first_ray[numbers, 0])
        open_ &= ~self._is_outlier[numbers]
        numbers = numbers[open_]
        a = self._first_ray[numbers]
        b = unit_vectors(homogeneous(self._seen.rays[k][open_]) @ R)
        center = -R.T @ t
        baseline = center - self._first_center[numbers]
        cosine = (a * b).sum(axis=1)
        sine2 = np.maximum(1.0 - cosine**2, 1e-12)
        along_a = ((a * baseline).sum(axis=1) - cosine * (b * baseline).sum(axis=1)) / sine2
        along_b = (cosine * (a * baseline).sum(axis=1) - (b * baseline).sum(axis=1)) / sine2
        from_a = self._first_center[numbers] + along_a[:, None] * a
        from_b = center + along_b[:, None] * b
        gap = np.linalg.norm(from_a - from_b, axis=1)
        good = (np.sqrt(sine2) > MIN_TRIANGULATION) & (along_a > 0) & (along_b > 0)
        good &= (along_b < FARTHEST) & (gap < 2.0 * self._seen.tolerance * along_b)
        self._places[numbers[good]] = 0.5 * (from_a + from_b)[good]

    def _place(
        self, k: int, R: Float64Array, t: Float64Array
    ) -> tuple[Float64Array, Float64Array] | None:
        """Return rotation and translation of the frame ``k`` by the map, from a guess; None where
        too few of its corners agree.
        """
        numbers = self._seen.numbers[k]
        known = ~np.isnan(self._places[numbers, 0])
        if known.sum() < MIN_MAP:
            return None
        places = self._places[numbers[known]]
        rays = self._seen.rays[k][known]
        R, t = refine_pose(places, rays, R, t, self._seen.tolerance)
        points = places @ R.T + t
        error = np.linalg.norm(projected(points) - rays, axis=1)
        agree = (points[:, 2] > 0) & (error < 2.0 * self._seen.tolerance)
        if agree.sum() < MIN_MAP or agree.mean() < MIN_MAP_SHARE:
            return None
        return R, t

    def _adjust(self, part: _Part, fixed: int = FIXED) -> None:
        """Adjust the last frames and their corners together, and drop corners that do not agree."""
        count = len(part.R)
        begin = max(0, count - ADJUSTED)
        frames = range(part.first + begin, part.first + count)
        numbers = np.concatenate([self._seen.numbers[k] for k in frames])
        rays = np.concatenate([self._seen.rays[k] for k in frames])
        frame = np.repeat(np.arange(len(frames)), [len(self._seen.numbers[k]) for k in frames])
        known = ~np.isnan(self._places[numbers, 0])
        corners, corner = np.unique(numbers[known], return_inverse=True)
        if len(corners) < MIN_MAP:
            return
        bundle = Bundle(
            part.R[begin:], part.t[begin:], self._places[corners], frame[known], corner, rays[known]
        )
        bundle = adjust(bundle, fixed if begin else 1, self._seen.tolerance)
        part.R[begin:] = bundle.R
        part.t[begin:] = bundle.t
        self._places[corners] = bundle.places
        error = np.linalg.norm(bundle.residuals(), axis=1)
        wrong = np.bincount(corner, error > 2.0 * self._seen.tolerance, len(corners))
        is_wrong = wrong > 0.5 * np.bincount(corner, minlength=len(corners))
        self._places[corners[is_wrong]] = np.nan
        self._is_outlier[corners[is_wrong]] = True


def _continued(before: _Part, after: _Part) -> _Part | None:
    """Return two successive parts as one in the axes and units of the first; None where they do not
    place the same frames, or place them differently.

    The second map lies in the first by p = s G p' + b. In the frames that both have placed, G is
    the mean of R^T R', and s the ratio of the paths' extents there. In these frames, the path goes
    over evenly from one to the other.
    """
    common = before.end - after.first
    if common < COMMON[0]:
        return None
    kept = before.R[-common:]
    G = nearest_rotation(np.einsum("nji,njk->ik", kept, after.R[:common]))
    center = before.centers[-common:]
    center_after = after.centers @ G.T
    way = center - center.mean(axis=0)
    way_after = center_after[:common] - center_after[:common].mean(axis=0)
    length = np.linalg.norm(way)
    scale = length / max(float(np.linalg.norm(way_after)), 1e-12)
    if np.linalg.norm(way - scale * way_after) > MAX_COMMON_OFF * length:
        return None
    moved = center.mean(axis=0) - scale * center_after[:common].mean(axis=0)
    R = after.R @ G.T
    centers = scale * center_after + moved
    share = np.arange(1, common + 1) / (common + 1)
    R[:common] = interpolate_rotations(kept, R[:common], share)
    centers[:common] = center + share[:, None] * (centers[:common] - center)
    return _Part(
        before.first,
        np.concatenate([before.R[:-common], R]),
        np.concatenate([before.t[:-common], -np.einsum("nij,nj->ni", R, centers)]),
        np.concatenate([before.places, scale * after.places @ G.T + moved]),
    )


def _joined(
    parts: list[_Part], rows: IndexArray, R_first_camera: Float64Array, times: Float64Array
) -> Odometry:
    """Return the path of all frames: parts one after another, and between them the rotation as it
    was estimated. Frames between two that were placed are interpolated.
    """
    frames = len(times)
    R = R_first_camera.copy()
    center = np.zeros((frames, 3))
    part_of = np.full(frames, -1)
    maps = []
    for number, part in enumerate(parts):
        seen = rows[part.first : part.first + len(part.R)]
        inside = np.arange(seen[0], seen[-1] + 1)
        R_map_camera = np.swapaxes(part.R, 1, 2)
        # The map's axes are those of the part's first frame.
        R_first_map = R[seen[0]] @ R_map_camera[0].T
        c_map = -np.einsum("nij,nj->ni", R_map_camera, part.t)
        c_first = (c_map - c_map[0]) @ R_first_map.T
        maps.append((part.places - c_map[0]) @ R_first_map.T)
        R_before = R[seen[-1]].copy()
        R[inside] = interpolated_rotations(R_first_map @ R_map_camera, times[seen], times[inside])
        center[inside] = interpolated_places(c_first, times[seen], times[inside])
        part_of[inside] = number
        after = slice(seen[-1] + 1, frames)
        # What follows keeps its rotation relative to this part's last frame.
        R[after] = R[seen[-1]] @ R_before.T @ R[after]
    return Odometry(R, center, part_of, maps)
