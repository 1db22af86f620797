# SPDX-License-Identifier: GPL-3.0-or-later
"""How a camera turns while it films, from the background.

Corners of the background, those outside the people's regions, are followed from frame to frame (Lucas-Kanade). Their
directions b in the present camera and a in an earlier key frame's satisfy b = R a for a camera that only turns, however
far away they are; R is the least-squares rotation of the directions that agree with it (two directions make a
hypothesis, the one with most support is refined). Rotations are chained over key frames alone, a new one only where
too few corners are left, so that errors add up over few links. A camera that also moves makes near corners disagree;
the far ones, of which there are many, decide, and what is wrong with that is taken out by the edges of buildings
(`compass`).

Sources: Fischler and Bolles 1981 (random sample consensus), Kabsch 1976 (rotation between two sets of directions).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import cv2
import numpy as np

from ....solver.rotations import exp, log
from ...kinematics.smoothing import fill_rotation_gaps
from ..perception.region import inside, surroundings
from .bars import find_bars
from .heading_drift import LOOK_SIDE_PX, LOOKS_EVERY_S, Look, remove_heading_drift
from .intrinsics import Camera
from .line_segments import Lines, Segments, find_segments

WORKING_SIDE_PX = 480  # the longer side of the picture that corners are followed in
MOST_CORNERS = 240
FEWEST_CORNERS = 24
KEY_SHARE = 0.5  # of a key frame's corners; with fewer left, the next key frame begins
AGREEING_PX = 1.2  # in the working picture
TRUSTED_SHARE = 0.35  # of corners that must agree; a crowd or water that fills the picture says nothing
SAMPLES_HZ = 12.0  # a hand trembles at up to 10 Hz, but by less than can be seen here
TRAVELLING_SHARE = 0.8  # of corners that agree with a turn, on average; fewer: near ones pass by, and look like turning
STATIC_DEG = 0.35  # turning less than this over the clip is a camera on a stand


@dataclass(frozen=True)
class CameraMotion:
    """The camera's turning over T frames."""

    R_first_camera: np.ndarray  # (T, 3, 3) the camera's axes in those of the first frame
    known: np.ndarray  # (T,) bool; elsewhere it is interpolated

    @property
    def is_static(self) -> bool:
        """Whether the camera stands still, as far as can be told."""
        return not self.known.any() or self.largest_turn_deg < STATIC_DEG

    @property
    def largest_turn_deg(self) -> float:
        """Between any frame and the first one."""
        return float(np.degrees(np.linalg.norm(log(self.R_first_camera), axis=-1).max()))


class BackgroundTracker:
    """Follows the background through a clip; frames come in order, each with the people's places.

    :param camera: the intrinsics of the full picture.
    """

    def __init__(self, camera: Camera, width: int, height: int) -> None:
        self._scale = WORKING_SIDE_PX / max(width, height)
        self._step = min(max(1, int(0.5 / self._scale)), width, height)
        self._size = (max(1, round(width * self._scale)), max(1, round(height * self._scale)))
        self._camera, self._full_size = camera, (width, height)
        self._tolerance = AGREEING_PX / (self._scale * camera.intrinsics[0, 0])  # radians
        self._random = np.random.default_rng(0)
        self._times: list[float] = []
        self._rotations: list[np.ndarray | None] = []
        self._last_used = -np.inf
        self._picture: np.ndarray | None = None
        self._points: np.ndarray = np.zeros((0, 2), np.float32)  # in the working picture
        self._key_rays = np.zeros((0, 3))
        self._key_count = 0
        self._R_first_key = np.eye(3)
        self._R_key_last = np.eye(3)
        self._agreeing: list[float] = []  # share of the corners, where they were followed
        self._looks: list[Look] = []  # the first one at the first frame in which somebody is seen
        self.bars: list[np.ndarray] = []  # in that frame

    def add(self, image_rgb: np.ndarray, time_s: float, people: Sequence[np.ndarray], is_cut: bool = False) -> None:
        """The next frame.

        :param people: (n, 2) points of each person in pixels: the background is what lies outside their boxes.
        :param is_cut: another scene begins, in which the camera counts as where it was last.
        """
        self._times.append(time_s)
        if people and not self._looks:
            self.bars = find_bars(image_rgb)
            self._looks.append(Look(len(self._times) - 1, find_segments(image_rgb, people, bars=self.bars)))
        if time_s - self._last_used < 0.98 / SAMPLES_HZ and not is_cut:
            self._rotations.append(None)
            return
        self._last_used = time_s
        picture = self._shrink(image_rgb)
        boxes = [self._box(surroundings(points)) for points in people] + [self._box(bar) for bar in self.bars]
        if self._picture is None:
            self._begin_key(picture, boxes)
            self._rotations.append(np.eye(3))
            return
        R_camera_key = None if is_cut else self._follow(picture, boxes)
        if R_camera_key is None:  # a cut, or nothing to see: begin anew where the camera was last
            self._R_first_key = self._R_first_key @ self._R_key_last
            self._begin_key(picture, boxes)
            self._rotations.append(None)
            return
        self._R_key_last = R_camera_key.T
        R_first_camera = self._R_first_key @ self._R_key_last
        self._rotations.append(R_first_camera)
        if self._looks and time_s - self._times[self._looks[-1].row] >= LOOKS_EVERY_S and _turns(R_first_camera):
            self._looks.append(Look(len(self._times) - 1, find_segments(image_rgb, people, LOOK_SIDE_PX, self.bars)))
        self._picture = picture
        if len(self._points) < max(KEY_SHARE * self._key_count, FEWEST_CORNERS):
            self._R_first_key = self._R_first_key @ self._R_key_last
            self._begin_key(picture, boxes)

    def motion(self, camera: Camera) -> CameraMotion:
        """Of all frames so far; frames between those that were looked at lie on the arc between them.

        :param camera: the intrinsics as they are known now. A short turn moves the picture by f times its angle, so the
            angles shrink as the focal length grows; turns about the line of sight stay.
        """
        known = np.array([R is not None for R in self._rotations], bool)
        R = np.array([np.eye(3) if R is None else R for R in self._rotations]).reshape(-1, 3, 3)
        if known.sum() < 2:
            return CameraMotion(np.tile(np.eye(3), (len(R), 1, 1)), np.zeros(len(R), bool))
        ratio = self._camera.intrinsics[0, 0] / camera.intrinsics[0, 0]
        if ratio != 1.0:
            seen = R[known]
            steps = exp(log(np.swapaxes(seen[:-1], 1, 2) @ seen[1:]) * [ratio, ratio, 1.0])
            R[known] = np.array(list(accumulate(steps, np.matmul, initial=seen[0])))
        times = np.array(self._times)
        filled = fill_rotation_gaps(R[:, None], known, times)[:, 0]
        a, b = np.flatnonzero(known)[-2:]
        late = np.arange(b + 1, len(R))
        if len(late) and times[-1] - times[b] < 1.5 / SAMPLES_HZ:  # the camera goes on turning as it did
            rate = log(R[a].T @ R[b]) / (times[b] - times[a])
            filled[late] = R[b] @ exp((times[late] - times[b])[:, None] * rate)
        R = filled[0].T @ filled
        if self._agreeing and np.mean(self._agreeing) < TRAVELLING_SHARE:
            R = remove_heading_drift(R, times, self._looks, camera, *self._full_size)
        return CameraMotion(R, known)

    @property
    def has_searched_edges(self) -> bool:
        """Whether somebody was seen, and with that, straight edges were looked for."""
        return bool(self._looks)

    @property
    def segments(self) -> Segments:
        """Straight edges of the background, in the first frame in which somebody is seen."""
        return self._looks[0].segments if self._looks else Segments.none()

    def lines(self, motion: CameraMotion, camera: Camera) -> Lines:
        """The same in the first frame's axes."""
        lines = self.segments.lines(camera)
        return lines if motion.is_static or not self._looks else lines.turned(motion.R_first_camera[self._looks[0].row])

    def _follow(self, picture: np.ndarray, boxes: list[np.ndarray]) -> np.ndarray | None:
        """Rotation (3, 3) from the key frame's axes to the present camera's; None where it cannot be told."""
        if len(self._points) < FEWEST_CORNERS:
            return None
        assert self._picture is not None
        moved, found = _flow(self._picture, picture, self._points)
        back, again = _flow(picture, self._picture, moved, near=self._points)
        good = found & again & (np.abs(back - self._points).max(1) < 0.7)
        good &= ((moved >= 0) & (moved < self._size)).all(1) & ~inside(moved, boxes)
        self._points, self._key_rays = moved[good], self._key_rays[good]
        if len(self._points) < FEWEST_CORNERS:
            return None
        rays = self._rays(self._points)
        R, agree = consensus_rotation(self._key_rays, rays, self._tolerance, self._random)
        self._agreeing.append(float(agree.mean()))
        if agree.mean() < TRUSTED_SHARE or agree.sum() < FEWEST_CORNERS // 2:
            return None
        return R

    def _shrink(self, image_rgb: np.ndarray) -> np.ndarray:
        """The working picture, grey. Every second pixel or so, then areas: averaging all of them would take longer."""
        columns, rows = image_rgb.shape[1] // self._step, image_rgb.shape[0] // self._step
        whole = image_rgb[: rows * self._step, : columns * self._step]
        coarse = cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_NEAREST)
        return cv2.cvtColor(cv2.resize(coarse, self._size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)

    def _begin_key(self, picture: np.ndarray, boxes: list[np.ndarray]) -> None:
        mask = np.full(picture.shape, 255, np.uint8)
        for x0, y0, x1, y1 in boxes:
            mask[max(0, int(y0)) : max(0, int(y1) + 1), max(0, int(x0)) : max(0, int(x1) + 1)] = 0
        corners = cv2.goodFeaturesToTrack(picture, MOST_CORNERS, 0.01, 7, mask=mask)
        self._points = np.asarray([] if corners is None else corners, np.float32).reshape(-1, 2)
        self._key_rays = self._rays(self._points)
        self._key_count, self._picture = len(self._points), picture
        self._R_key_last = np.eye(3)

    def _rays(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) unit directions, camera frame, of points in the working picture."""
        # A working pixel's centre in the full picture: OpenCV scales areas, not their centres.
        full = ((points + 0.5) / (self._scale * self._step) - 0.5) * self._step
        rays = self._camera.rays(full)
        return rays / np.linalg.norm(rays, axis=1, keepdims=True)

    def _box(self, box_px: np.ndarray) -> np.ndarray:
        """x0, y0, x1, y1 in the working picture, and some pixels more."""
        return box_px * self._scale + [-4.0, -4.0, 4.0, 4.0]


def _turns(R: np.ndarray) -> bool:
    """Whether a rotation (3, 3) is more than that of a camera on a stand."""
    return bool(np.degrees(np.linalg.norm(log(R))) >= STATIC_DEG)


def consensus_rotation(
    a: np.ndarray, b: np.ndarray, tolerance: float, random: np.random.Generator, hypotheses: int = 128
) -> tuple[np.ndarray, np.ndarray]:
    """The rotation R with b = R a that most directions agree with.

    :param a, b: (n, 3) unit vectors, n at least 2.
    :param tolerance: radians.
    :return: (3, 3), and (n,) whether each pair agrees.
    """
    pairs = random.integers(0, len(a), (hypotheses, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    R = _kabsch(a[pairs], b[pairs])
    # |R a − b|² = 2 − 2 bᵀ R a, for all hypotheses and directions in one product of matrices
    near = R.reshape(-1, 9) @ (b[:, :, None] * a[:, None]).reshape(-1, 9).T > 1.0 - 0.5 * tolerance**2
    best = R[int(near.sum(1).argmax())]
    agree = np.linalg.norm(a @ best.T - b, axis=1) < tolerance
    for _ in range(3):
        if agree.sum() < 2:
            break
        best = _kabsch(a[agree][None], b[agree][None])[0]
        agree = np.linalg.norm(a @ best.T - b, axis=1) < tolerance
    return best, agree


def _kabsch(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotations that best take (..., n, 3) directions a to b."""
    U, _, Vt = np.linalg.svd(np.swapaxes(b, -1, -2) @ a)
    sign = np.sign(np.linalg.det(U @ Vt))
    U[..., :, 2] *= sign[..., None]
    return U @ Vt


def _flow(
    before: np.ndarray, after: np.ndarray, points: np.ndarray, near: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Where corners (n, 2) have gone, and whether each was found; ``near``: where they are looked for, and not far."""
    start = points.astype(np.float32)
    guess, levels, flags = (start, 3, 0) if near is None else (near.astype(np.float32), 0, cv2.OPTFLOW_USE_INITIAL_FLOW)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(
        before, after, start, guess.copy(), winSize=(15, 15), maxLevel=levels, flags=flags
    )
    return np.array(moved, np.float32), np.array(found).ravel() == 1
