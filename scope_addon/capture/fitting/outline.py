# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape of a person from masks: rim points of a posed body, and the contour points that belong
to them.

The keypoints say how long limbs are, and little about breadth. The rim are points of the skin whose
normal is at right angles to the view, and beside which the body's silhouette ends. From each, the
mask is searched along the projected normal for the nearest place where its probability crosses one
half; there the contour's own normal is taken from the mask's gradient. A crossing counts if it lies
within the image, near enough, and if both normals agree. Hands and feet are left out: they are
small, and what they hold or stand on is not.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ....solver import Body, ClipFit, Fit, fit_clip
from ....solver.residuals.outline import FLOATS, INTS, pack
from ...arrays import BoolArray, Float64Array, FloatArray, IndexArray, unit_vectors
from ...kinematics.body_surface import one_per_cell
from ...kinematics.contact_points import with_keypoints
from ..camera.intrinsics import Camera
from ..perception.observation import PersonMask
from ..perception.region import Region
from .frame_measurements import Measurer
from .prepared_track import PreparedTrack
from .rasterizer import fill_silhouette, vertex_normals
from .weights import ROBUST, cold_stages, warm_stages

SPACING_M = 0.03  # between candidates, at rest
RIM_COS = 0.15  # of the angle between a rim point's normal and the view
BESIDE_PX = 3.0  # of the mask: how far beside the rim the silhouette must have ended
NEAR_M = 0.2  # from the camera's plane; what is nearer is not compared
REACH = 20  # pixels of the mask searched to either side
AGREEMENT_COS = 0.8  # of the angle between the two normals
MAX_BLENDING_M = 0.02  # skin that blending moves further is not rigid
BORDER_PX = 3.0  # of the image, within which contours are its edge
_WIDTHS_M = {"head": 0.03, "neck": 0.03, "spine": 0.04, "pelvis": 0.04, "collar": 0.04, "hip": 0.03}
_WIDTH_M = 0.02  # of limbs: how far clothes and hair reach beyond the body
_LEFT_OUT = ("wrist", "hand", "ankle", "foot", "thumb", "index", "middle", "ring", "pinky")
OUTSIDE_WEIGHT = 1.0
INSIDE_WEIGHT = 0.5
OUTSIDE_SIGMA_M = 0.05
SIZE = 256  # of the mask
_NO_MAP = np.zeros(0, np.float32)  # the places are all in the first map
_NOTHING = np.zeros((0, INTS), np.int64), np.zeros((0, FLOATS))
# Fewer masks, such as that of a still image, can mislead, and more add little.
MIN_MASKS = 4
MAX_MASKS = 32
ROUNDS = 3
THREADS = 2
# A rim point's inverse variance: 0.0032 in normalized coordinates, 13 mm at 4 m. Clothes displace
# the rim alike in all frames, so a larger weight distorts the shape: with 3e5 and two thirds of the
# shape's prior, one of ten people in a studio had a coefficient of 8 standard deviations, and two
# leaned by 10 degrees (benchmarks/notebook/shape.md).
OUTLINE_WEIGHT = 1e5


class OutlineMeasurer:
    """Converts masks to rows of the residual "outline" of one body.

    ``body`` is the given one with the candidates as its last keypoints.
    """

    def __init__(self, body: Body, camera: Camera) -> None:
        self._source = body
        self._camera = camera
        self._shaped = np.full(body.P, np.nan), body
        part = body.strongest_joints
        names = [body.joint_names[i] for i in part]
        usable = np.array([not any(key in name for key in _LEFT_OUT) for name in names])
        usable &= np.bincount(body.faces.ravel(), minlength=len(part)) > 0
        candidates = np.flatnonzero(usable)
        self.vertices = candidates[one_per_cell(body.v_template[candidates], SPACING_M)]
        self.part = part[self.vertices]
        joints = [body.joint_names[i] for i in self.part]
        widths_m = _WIDTHS_M.items()
        self._width = np.array(
            [next((w for key, w in widths_m if key in joint), _WIDTH_M) for joint in joints]
        )
        self._triangles = np.ascontiguousarray(body.triangles(), np.int32)
        self._around = self._triangles[np.isin(self._triangles, self.vertices).any(axis=1)]
        self.first = len(body.keypoint_names)
        added = (f"outline/{v}" for v in self.vertices)
        places = body.v_template[self.vertices]
        shapedirs = body.shapedirs[self.vertices]
        self.body = with_keypoints(body, added, self.part, places, shapedirs)

    def measure(self, fit: Fit, mask: PersonMask) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the residual's rows for the pose and shape of a fit: int64 (n, 1) and float64 (n,
        11).
        """
        body = self._with_shape(fit.state.beta)
        camera = self._camera if mask.zoom == 1.0 else self._camera.zoomed(mask.zoom)
        v = self.vertices
        R = fit.R_camera_part
        t = fit.t_camera_part
        skin = np.ascontiguousarray(body.skin(R, t))
        normals = vertex_normals(skin, self._around)[v]
        points = skin[v]
        local = body.v_template[v] - body.J_template[self.part]
        delta = np.einsum("nji,nj->ni", R[self.part], points - t[self.part]) - local
        facing = (normals * points).sum(axis=1) / np.linalg.norm(points, axis=1)
        near = (
            (np.abs(facing) < RIM_COS)
            & (points[:, 2] > NEAR_M)
            & (np.linalg.norm(delta, axis=1) < MAX_BLENDING_M)
        )
        rows = np.flatnonzero(near)
        at = _crop(camera, mask.region, points[rows])
        ahead = _crop(camera, mask.region, points[rows] + 0.01 * normals[rows]) - at
        normal = unit_vectors(ahead)
        beside = np.rint(at + BESIDE_PX * normal).astype(int)
        inside = ((beside >= 0) & (beside < SIZE)).all(axis=1)
        covered = self._coverage(camera, skin, mask.region)
        free = inside & ~covered[tuple(np.where(inside[:, None], beside, 0).T[::-1])]
        rows = rows[free]
        at = at[free]
        normal = normal[free]
        if not len(rows):
            return _NOTHING
        found, contour, outward = _crossings(mask.probability, at, normal)
        rows = rows[found]
        m_px = mask.region.image_from_crop((contour + 0.5) / SIZE)
        visible = ((m_px > BORDER_PX) & (m_px < np.subtract(mask.image_size, 1 + BORDER_PX))).all(
            axis=1
        )
        rows = rows[visible]
        contour = contour[visible]
        outward = outward[visible]
        m_px = m_px[visible]
        if not len(rows):
            return _NOTHING
        m = camera.rays(m_px)[:, :2]
        n = camera.rays(mask.region.image_from_crop((contour + outward + 0.5) / SIZE))[:, :2] - m
        n = unit_vectors(n)
        depth = points[rows, 2]
        sigmas = (OUTSIDE_SIGMA_M / depth) ** 2, (self._width[rows] / depth) ** 2
        weights = np.full(len(rows), OUTSIDE_WEIGHT), np.full(len(rows), INSIDE_WEIGHT)
        return pack(self.first + rows, delta[rows], m, n, weights, sigmas)

    def _with_shape(self, betas: Float64Array) -> Body:
        """Return the body whose template has this shape, which the frames of a round share."""
        known, shaped = self._shaped
        if not np.array_equal(known, betas):
            body = self._source
            shaped = replace(
                body, v_template=body.rest_vertices(betas), J_template=body.rest_joints(betas)
            )
            self._shaped = betas.copy(), shaped
        return shaped

    def _coverage(self, camera: Camera, skin: Float64Array, region: Region) -> BoolArray:
        """Return (256, 256) bool: where in the mask's region the body is."""
        at = np.full((len(skin), 2), np.nan)
        front = skin[:, 2] > NEAR_M
        at[front] = _crop(camera, region, skin[front])
        covered = np.zeros((SIZE, SIZE), np.bool_)
        fill_silhouette(covered, at, self._triangles)
        return covered


def _crop(camera: Camera, region: Region, points_cam: Float64Array) -> Float64Array:
    """Project points (n, 3) to pixels (n, 2) of the mask."""
    if not len(points_cam):
        return np.zeros((0, 2))
    pixels = cv2.projectPoints(
        points_cam, np.zeros(3), np.zeros(3), camera.intrinsics, camera.dist
    )[0][:, 0]
    return region.crop_from_image(pixels.astype(np.float64)) * SIZE - 0.5


def _crossings(
    probability: FloatArray, at: Float64Array, normal: Float64Array
) -> tuple[IndexArray, Float64Array, Float64Array]:
    """Find the nearest crossing of one half along each normal, outwards: rows (n,), places (n, 2),
    normals (n, 2).
    """
    picture = np.ascontiguousarray(probability, np.float32)
    steps = np.arange(-REACH, REACH + 1.0)
    path = (at[:, None] + steps[:, None] * normal[:, None]).astype(np.float32)
    values = cv2.remap(picture, path, _NO_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    falls = (values[:, :-1] >= 0.5) & (values[:, 1:] < 0.5)
    share = (values[:, :-1] - 0.5) / np.maximum(values[:, :-1] - values[:, 1:], 1e-6)
    where = np.where(falls, steps[:-1] + share, np.inf)
    best = np.abs(where).argmin(axis=1)
    rows = np.flatnonzero(falls.any(axis=1))
    place = at[rows] + where[rows, best[rows]][:, None] * normal[rows]
    if not len(rows):
        return rows, place, place
    smooth = cv2.GaussianBlur(picture, (0, 0), 1.5)
    slope = [cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((1, 0), (0, 1))]
    spots = place.astype(np.float32)[:, None]
    down = [-cv2.remap(image, spots, _NO_MAP, cv2.INTER_LINEAR)[:, 0] for image in slope]
    outward = unit_vectors(np.stack(down, axis=1).astype(float))
    agree = (outward * normal[rows]).sum(axis=1) > AGREEMENT_COS
    return rows[agree], place[agree], outward[agree]


def usable_masks(prepared: PreparedTrack) -> list[tuple[int, PersonMask]]:
    """Return masks of the track, evenly spread over it, each with its row; none where there are too
    few.
    """
    seen = [(row, mask) for row, mask in prepared.track.masks if prepared.track.seen[row]]
    if len(seen) < MIN_MASKS:
        return []
    return [seen[k] for k in spread(np.arange(len(seen)), MAX_MASKS)]


def spread(indices: IndexArray, count: int) -> IndexArray:
    """Return at most ``count`` of indices (n,), evenly spread."""
    rows = np.unique(np.linspace(0, len(indices) - 1, min(count, len(indices))).round().astype(int))
    return indices[rows]


def fit_shape_to_outline(
    prepared: PreparedTrack, masks: list[tuple[int, PersonMask]], root_cam: FloatArray | None
) -> ClipFit:
    """Estimate one shape from the frames of some masks, as `usable_masks` returns them.

    A larger weight of few masks among many other frames moves the poses of their frames rather than
    the shape, so the frames of the masks decide alone. A first fit without the outline places the
    body; then rim and contour are matched and everything is fitted again, a few times.

    :param masks: each with its row.
    :param root_cam: (T, 3) known positions of the pelvis, camera frame, metres.
    """
    outline = OutlineMeasurer(prepared.body, prepared.camera)
    measurer = Measurer(outline.body, prepared.measurer.intrinsics)
    extended = replace(prepared, body=outline.body, measurer=measurer)
    measured = [
        extended.measure(row, None if root_cam is None else root_cam[row]) for row, _ in masks
    ]
    base = prepared.weights
    shape = base.shape * len(masks)
    weights = replace(base, shape=shape, tables={**base.tables, "outline": OUTLINE_WEIGHT})
    cold, warm = (replace(ROBUST, stages=stages(weights)) for stages in (cold_stages, warm_stages))
    found = fit_clip(outline.body, measured, priors=prepared.priors, options=cold)
    with ThreadPoolExecutor(THREADS, "scope-outline") as pool:
        for _ in range(ROUNDS):
            tables = pool.map(outline.measure, found.frames, [mask for _, mask in masks])
            matched = [
                replace(frame, tables={"outline": rows})
                for frame, rows in zip(measured, tables, strict=True)
            ]
            states = [fit.state for fit in found.frames]
            found = fit_clip(
                outline.body, matched, init=states, priors=prepared.priors, options=warm
            )
    return found
