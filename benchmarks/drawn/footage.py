# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws what a camera sees of walkers, and writes the truth beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ...scope_addon.arrays import Float64Array, Uint8Array
from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.capture.fitting.rasterizer import Canvas, rasterize
from ...scope_addon.capture.media.video_writer import VideoWriter
from ...scope_addon.capture.overlay_video import blended, body_colors
from ...solver.rotations import exp, log
from .surroundings import Surroundings
from .walk import Walker

WIDTH = 768
HEIGHT = 432
FPS = Fraction(30)
FOCAL_PX = 665.0
TINT = 2  # of the first person's body
# Of a picture whose rows are read out one after another; each band has a moment of its own.
READOUT_BANDS = 12

Place = Callable[[float], Float64Array]  # of a time in seconds: (3,) in the world, metres


@dataclass(frozen=True)
class Camera:
    """How a camera moves, and when it begins to film. Times are those of the scene."""

    eye: Place
    target: Place
    fps: Fraction = FPS
    start_s: float = 0.0
    focal_px: Callable[[float], float] = lambda _: FOCAL_PX
    # A hand's shaking: standard deviations, degrees and metres. None if both are 0.
    shake_deg: float = 0.0
    shake_m: float = 0.0
    seed: int = 0
    # From the first row to the last one, whose middle is the frame's time; 0: a global shutter
    readout_s: float = 0.0

    def times(self, seconds: float) -> Float64Array:
        """Return the times of its frames."""
        count = round(seconds * self.fps)
        return self.start_s + np.arange(count) / float(self.fps)

    def path(self, times: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Return R_world_camera (T, 3, 3) and the centre (T, 3), metres."""
        rng = np.random.default_rng(self.seed + 7)
        turns = np.radians(self.shake_deg) * _shaking(len(times), 1.5, rng)
        moves = self.shake_m * _shaking(len(times), 1.2, rng)
        centers = np.array([self.eye(t) for t in times]) + moves
        rotations = [
            _looking(center, self.target(t)) @ exp(turn)
            for t, center, turn in zip(times, centers, turns, strict=True)
        ]
        return np.array(rotations), centers

    def speeds(
        self, R_world_camera: Float64Array, centers: Float64Array
    ) -> tuple[Float64Array, Float64Array]:
        """Return the camera's angular velocity (T, 3) in its own axes, radians per second, and its
        velocity (T, 3) in the world, metres per second, along its `path`.
        """
        before = np.maximum(np.arange(len(centers)) - 1, 0)
        after = np.minimum(np.arange(len(centers)) + 1, len(centers) - 1)
        seconds = np.maximum(after - before, 1)[:, None] / float(self.fps)
        R_before_after = np.swapaxes(R_world_camera[before], 1, 2) @ R_world_camera[after]
        return log(R_before_after) / seconds, (centers[after] - centers[before]) / seconds


def intrinsics_of(focal_px: float) -> Float64Array:
    """Return the intrinsics (3, 3) of a focal length."""
    return np.array([[focal_px, 0.0, WIDTH / 2], [0.0, focal_px, HEIGHT / 2], [0.0, 0.0, 1.0]])


def draw_clip(
    path: Path,
    surroundings: Surroundings,
    walkers: Sequence[Walker],
    camera: Camera,
    seconds: float,
    change: Callable[[float, Uint8Array], Uint8Array] = lambda _, image: image,
) -> None:
    """Write a clip, and its truth beside it, as `.npz`.

    :param change: what becomes of a picture, by the scene's time.
    """
    times = camera.times(seconds)
    R_world_camera, centers = camera.path(times)
    focal_px = np.array([camera.focal_px(t) for t in times])
    turns, velocities = camera.speeds(R_world_camera, centers)
    moving = (centers, R_world_camera, focal_px)
    is_background_static = all(np.ptp(values, axis=0).max() == 0 for values in moving)
    background = None
    bands = READOUT_BANDS if camera.readout_s else 1
    rows = HEIGHT // bands
    skins = [_skin(walker, TINT + number) for number, walker in enumerate(walkers)]
    joints = []
    stands = []
    path.parent.mkdir(parents=True, exist_ok=True)
    with (
        atomic_path(path) as temporary,
        VideoWriter(temporary, camera.fps, WIDTH, HEIGHT, path) as writer,
    ):
        for k, time_s in enumerate(times):
            poses = [walker.pose(time_s) for walker in walkers]
            joints.append([w.joints(pose) for w, pose in zip(walkers, poses, strict=True)])
            stands.append([pose.stands for pose in poses])
            picture = []
            for band in range(bands):
                later_s = camera.readout_s * ((band + 0.5) / bands - 0.5)
                R = R_world_camera[k] @ exp(later_s * turns[k])
                center = centers[k] + later_s * velocities[k]
                K = intrinsics_of(focal_px[k])
                K[1, 2] -= band * rows
                if background is None or not is_background_static:
                    background = surroundings.draw(R, center, K, WIDTH, rows)
                canvas = Canvas.blank(WIDTH, rows)
                if later_s:
                    poses = [walker.pose(time_s + later_s) for walker in walkers]
                for skin, walker, pose in zip(skins, walkers, poses, strict=True):
                    vertices = (walker.vertices(pose) - center) @ R
                    rasterize(canvas, vertices, *skin, K)
                picture.append(blended(background, canvas))
            writer.write(change(time_s, np.concatenate(picture)))
    truth: dict[str, Any] = {
        "joints": np.swapaxes(np.array(joints), 0, 1),  # (people, T, K+1, 3) in the world, metres
        "stands": np.swapaxes(np.array(stands), 0, 1),  # (people, T, 2)
        "R_world_camera": R_world_camera,
        "centers": centers,
        "focal_px": focal_px,
        "start_s": camera.start_s,
    }
    with atomic_path(truth_of(path)) as temporary, temporary.open("wb") as stream:
        np.savez(stream, **truth)


def truth_of(path: Path) -> Path:
    """Return the file with the truth of a clip."""
    return path.with_suffix(".npz")


def _skin(walker: Walker, tint: int) -> tuple[np.ndarray, Float64Array]:
    """Return the triangles (F, 3) of a body, and their colours."""
    faces = walker.body.faces
    colors = body_colors(walker.body, tint)
    if faces.shape[1] == 3:
        return faces, colors
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    return triangles, np.concatenate([colors, colors])


def _looking(eye: Float64Array, target: Float64Array) -> Float64Array:
    """Return R_world_camera (3, 3) of a level camera that looks at a point."""
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead], axis=1)


def _shaking(count: int, rate_hz: float, rng: np.random.Generator) -> Float64Array:
    """Return smooth noise (count, 3) of deviation 1, up to about a rate."""
    noise = rng.standard_normal((count + 200, 3))
    width = float(FPS) / rate_hz / 2
    kernel = np.exp(-0.5 * (np.arange(-60, 61) / width) ** 2)
    kernel /= np.sqrt(np.square(kernel).sum())
    smooth = [np.convolve(noise[:, i], kernel, "same")[100 : 100 + count] for i in range(3)]
    return np.stack(smooth, axis=1)
