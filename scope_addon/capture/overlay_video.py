# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the fitted bodies over the footage, to show at a glance whether a capture is right.

The mesh is posed in the world from the motion file and transformed into each frame's camera by the
inverse of ``world_from_camera``, so that the overlay checks the data that other programs read, not
the state of the solver.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from ...solver.body import Body
from ...solver.errors import ShapeError
from ...solver.kernel import cached
from ...solver.rotations import exp
from ..arrays import Float64Array, FloatArray, Uint8Array
from ..atomic_write import atomic_path, reason
from ..errors import OutputError
from ..motion import Motion
from .camera.intrinsics import scaled_intrinsics
from .fitting.rasterizer import Canvas, rasterize
from .media.frame import Frame
from .media.video import Video, no_frames_error, open_video
from .media.video_range import FootageRange
from .media.video_writer import VideoWriter
from .perception.landmark_network import KEYPOINT_COUNT

VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv")
STILL_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")
LONGEST_SIDE = 1920
_ROUNDED_S = 0.001  # by which containers change times; at high rates, less
_FACE_COLOR = (255, 255, 255)
OPACITY = 0.6  # of the bodies
_FAINT = 0.35  # opacity of a filled-in pose, relative to one that was seen
_TINTS = np.array(
    [[1.0, 0.55, 0.15], [0.2, 0.75, 1.0], [0.55, 0.9, 0.3], [0.95, 0.4, 0.75], [0.95, 0.85, 0.25]]
)

Progress = Callable[[int, int], None]


def write_overlay(
    path: str | Path,
    video_path: str | Path,
    motions: Sequence[Motion],
    body: Body,
    *,
    progress: Progress | None = None,
    wanted: FootageRange | None = None,
) -> None:
    """Write the footage with every person's body over it.

    The video has the footage's times and size (at most 1920 pixels along the longer side, both
    sides even). With the suffix of a picture (.png, .jpg, .webp), only the first frame in which a
    person was seen is written.

    :param wanted: the range of the footage that was captured.
    :param progress: called with (frames done, frames expected). An exception that it raises stops
        the work, and no file is left behind.
    :raises OutputError: the suffix is not supported, or the file cannot be written.
    :raises VideoError: the footage cannot be read.
    :raises ShapeError: a motion does not have the joints of the body.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in VIDEO_SUFFIXES + STILL_SUFFIXES:
        known = ", ".join(VIDEO_SUFFIXES + STILL_SUFFIXES)
        raise OutputError(f"cannot write the overlay {path}: its suffix must be one of {known}")
    with open_video(video_path, wanted) as video:
        painter = _Painter(motions, body, video, even=suffix in VIDEO_SUFFIXES)
        try:
            with atomic_path(path) as temporary:
                if suffix in STILL_SUFFIXES:
                    first = min(
                        (int(m.frames[m.valid][0]) for m in motions if m.valid.any()), default=0
                    )
                    _write_still(temporary, painter, video, first)
                else:
                    _write_video(temporary, painter, video, path, progress)
        except OSError as error:
            raise OutputError(f"cannot write {path}: {reason(error)}") from error


def painted_frames(
    video_path: str | Path,
    motions: Sequence[Motion],
    body: Body,
    indices: Collection[int],
    *,
    wanted: FootageRange | None = None,
) -> Iterator[tuple[int, Uint8Array]]:
    """Generate some frames of the overlay: source frame index and (H, W, 3) RGB, at most 1920
    pixels wide and high.

    :param indices: source frame indices; those that the footage does not have are left out.
    :raises VideoError: the footage cannot be read.
    :raises ShapeError: a motion does not have the joints of the body.
    """
    remaining = set(indices)
    with open_video(video_path, wanted) as video:
        painter = _Painter(motions, body, video, even=False)
        for frame in video:
            if frame.index in remaining:
                remaining.remove(frame.index)
                yield frame.index, painter.paint(frame)
            if not remaining:
                return


def draw_overlay(
    image_rgb: Uint8Array,
    vertices_cam: Sequence[FloatArray],
    faces: NDArray[np.integer[Any]],
    intrinsics: Float64Array,
    dist: Float64Array | None,
    colors: Sequence[ArrayLike],
    opacities: Sequence[float],
) -> Uint8Array:
    """Draw shaded bodies over one image, with occlusion between them.

    :param image_rgb: (H, W, 3) uint8.
    :param vertices_cam: of each person (V, 3) metres, camera axes (OpenCV's).
    :param faces: (F, 3) or (F, 4), counter-clockwise seen from outside.
    :param intrinsics: (3, 3) K in pixels of the image.
    :param dist: up to (5,) distortion coefficients; None for none.
    :param colors: of each person (3,) or (F, 3) sRGB in 0..1.
    :param opacities: of each person, 0..1.
    :return: a new image of the same size.
    """
    canvas = Canvas.blank(image_rgb.shape[1], image_rgb.shape[0])
    triangles = (
        faces if faces.shape[1] == 3 else np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    )
    for vertices, color, opacity in zip(vertices_cam, colors, opacities, strict=True):
        per_face = np.asarray(color, np.float32)
        if per_face.ndim == 2 and len(per_face) != len(triangles):
            per_face = np.concatenate([per_face, per_face])  # a quad's two halves
        rasterize(canvas, vertices, triangles, per_face, intrinsics, dist, opacity)
    return blended(image_rgb, canvas)


def blended(image_rgb: Uint8Array, canvas: Canvas) -> Uint8Array:
    """Return a copy of an (H, W, 3) uint8 image with the canvas over it."""
    out = np.ascontiguousarray(image_rgb).copy()
    _blend(out, canvas.rgba)
    return out


def tint(person: int) -> Float64Array:
    """Return the (3,) sRGB colour of the person with this index."""
    return _TINTS[person % len(_TINTS)]


def body_colors(body: Body, person: int) -> Float64Array:
    """Calculate the (F, 3) sRGB colours of the faces: the body's materials mixed with the person's
    tint.
    """
    if body.face_material is None or body.material_colors is None:
        return np.tile(tint(person), (len(body.faces), 1))
    linear = np.clip(body.material_colors[:, :3], 0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return (0.85 * tint(person) + 0.15 * srgb)[body.face_material]


def camera_vertices(motion: Motion, body: Body, row: int) -> Float64Array:
    """Pose the mesh of one row of a motion: (V, 3) metres, in the axes of that row's camera."""
    betas = motion.betas.astype(float)
    rotations = exp(motion.poses[row].reshape(-1, 3).astype(float))
    R_world, t_world = body.forward_kinematics(rotations, motion.trans[row].astype(float), betas)
    T = motion.world_from_camera[row]
    R_camera_world = T[:3, :3].T
    return body.skin(R_camera_world @ R_world, (t_world - T[:3, 3]) @ T[:3, :3], betas)


@cached
@njit(nogil=True)
def _blend(image: Uint8Array, rgba: Uint8Array) -> None:
    """Blend ``rgba`` over ``image`` in place; at outlines, opacity is scaled by the covered share
    of the neighbours.
    """
    height, width = image.shape[:2]
    for v in range(height):
        for u in range(width):
            if rgba[v, u, 3] == 0:
                continue
            covered = 0
            for i in range(max(0, v - 1), min(height, v + 2)):
                for j in range(max(0, u - 1), min(width, u + 2)):
                    if rgba[i, j, 3] > 0:
                        covered += 1
            inside = (
                1.0 if 0 in (u, v) or u == width - 1 or v == height - 1 else min(1.0, covered / 8)
            )
            a = rgba[v, u, 3] / 255 * inside
            for k in range(3):
                image[v, u, k] = np.uint8(image[v, u, k] * (1 - a) + rgba[v, u, k] * a + 0.5)


class _Painter:
    """Draws the overlay of the frames of one clip; scales the intrinsics with the image."""

    def __init__(self, people: Sequence[Motion], body: Body, video: Video, even: bool) -> None:
        for motion in people:
            if motion.joint_count != body.K + 1:
                raise ShapeError(
                    f"the motion has {motion.joint_count} joints, but body "
                    f"'{body.name}' has {body.K + 1}"
                )
        self._people = people
        self._body = body
        self._rows = [{int(f): row for row, f in enumerate(motion.frames)} for motion in people]
        self._colors = [body_colors(body, i) for i in range(len(people))]
        self._scale = min(1.0, LONGEST_SIDE / max(video.width, video.height))
        width, height = (max(2, round(side * self._scale)) for side in (video.width, video.height))
        self._resized = (width, height)
        # Encoders need even sides. Cropping the last row or column does not change the intrinsics.
        self.size = (width - width % 2, height - height % 2) if even else self._resized

    def paint(self, frame: Frame) -> Uint8Array:
        image = frame.image_rgb
        if image.shape[1::-1] != self._resized:
            image = cast(Uint8Array, cv2.resize(image, self._resized, interpolation=cv2.INTER_AREA))
        width, height = self.size
        image = np.ascontiguousarray(image[:height, :width])
        shown = [(i, rows[frame.index]) for i, rows in enumerate(self._rows) if frame.index in rows]
        if not shown:
            return image
        # All people of one clip have the same camera.
        motion = self._people[shown[0][0]]
        image = draw_overlay(
            image,
            [camera_vertices(self._people[i], self._body, row) for i, row in shown],
            self._body.faces,
            scaled_intrinsics(motion.intrinsics_of_frames[shown[0][1]], self._scale),
            motion.dist,
            [self._colors[i] for i, _ in shown],
            [OPACITY * (1.0 if self._people[i].valid[row] else _FAINT) for i, row in shown],
        )
        for i, row in shown:
            if self._people[i].valid[row]:
                self._draw_keypoints(image, self._people[i].keypoints2d[row], tint(i))
                self._draw_face(image, self._people[i].face, row)
        return image

    def _draw_keypoints(
        self, image: Uint8Array, keypoints: FloatArray, color: Float64Array
    ) -> None:
        """Draw the confident keypoints (n, 3) of one person into the image, in place."""
        radius = max(1, round(max(image.shape[:2]) / 500))
        for k, (u, v, confidence) in enumerate(keypoints):
            if confidence > 0.3 and np.isfinite((u, v)).all() and max(abs(u), abs(v)) < 1e5:
                center = u * self._scale, v * self._scale
                if k < KEYPOINT_COUNT:  # those of a hand are too close together for a dark rim
                    _draw_dot(image, center, radius + 1, (20, 20, 20))
                _draw_dot(image, center, radius, [int(c) for c in 255 * (0.5 + 0.5 * color)])

    def _draw_face(self, image: Uint8Array, face: dict[str, NDArray[Any]], row: int) -> None:
        """Draw the points of one person's face into the image, in place, if it was seen here."""
        if not face or face["expression_confidence"][row] <= 0:
            return
        points = face["face_points"][row]
        if not points.any():  # the face was seen by another camera
            return
        for u, v in points * self._scale:
            if max(abs(u), abs(v)) < 1e5:
                _draw_dot(image, (u, v), 1, _FACE_COLOR)


def _draw_dot(
    image: Uint8Array, center: tuple[float, float], radius: int, color: Sequence[int]
) -> None:
    u, v = center
    cv2.circle(image, (round(float(u)), round(float(v))), radius, color, -1, cv2.LINE_AA)


def _write_still(path: Path, painter: _Painter, video: Video, index: int) -> None:
    shown: Frame | None = None
    for frame in video:
        shown = frame
        if frame.index >= index:
            break
    if shown is None:
        raise no_frames_error(video)
    ok, data = cv2.imencode(path.suffix, cv2.cvtColor(painter.paint(shown), cv2.COLOR_RGB2BGR))
    if not ok:
        raise OutputError(f"cannot encode a {path.suffix} image; choose .png")
    path.write_bytes(data.tobytes())


def _shown_s(time_s: float, fps: Fraction, before_s: float) -> float:
    """Return a frame's time: that of the frame rate, where the container has only rounded it to
    milliseconds.

    :param before_s: time of the frame before.
    """
    nominal = float(round(time_s * fps) / fps)
    is_rounded = abs(time_s - nominal) <= min(_ROUNDED_S, 0.25 / float(fps)) and nominal > before_s
    return nominal if is_rounded else time_s


def _write_video(
    temporary: Path, painter: _Painter, video: Video, path: Path, progress: Progress | None
) -> None:
    start_s = None
    shown_s = -1.0
    with VideoWriter(temporary, video.fps, *painter.size, path) as writer:
        for done, frame in enumerate(video, 1):
            start_s = frame.timestamp_s if start_s is None else start_s
            shown_s = _shown_s(frame.timestamp_s - start_s, video.fps, shown_s)
            writer.write(painter.paint(frame), shown_s)
            if progress is not None:
                progress(done, max(video.expected_frames, done))
        if start_s is None:
            raise no_frames_error(video)
