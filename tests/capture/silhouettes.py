# SPDX-License-Identifier: GPL-3.0-or-later
"""A standing person at six headings, and masks of what the camera sees, drawn by OpenCV alone."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scope.benchmarks.scenes.garments import Garment
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.observation import PersonMask
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.track import Track
from scope.solver import Body, State
from scope.solver.rotations import exp

from .exact_tracks import track_of_points

SIZE = (640, 480)
K = np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])
REGION = Region((320.0, 240.0), 480.0, 0.0)
FINER = 8  # OpenCV fills every pixel that a triangle touches, so masks are drawn finer


def standing(body: Body) -> list[State]:
    """A person standing with arms out to the sides and legs apart, at six headings."""
    found = []
    for heading in np.linspace(0, np.pi, 6, endpoint=False):
        rotations = np.tile(np.eye(3), (body.K + 1, 1, 1))
        for side, sign in (("left", 1.0), ("right", -1.0)):
            rotations[body.joint_names.index(f"{side}_shoulder")] = exp(
                np.array([0, 0, -0.7 * sign])
            )
            rotations[body.joint_names.index(f"{side}_hip")] = exp(np.array([0, 0, 0.15 * sign]))
        R_root = np.diag([1.0, -1.0, -1.0]) @ exp(np.array([0, heading, 0]))
        found.append(State(R_root, np.array([0.0, 0.0, 3.6]), rotations[1:], np.zeros(body.P)))
    return found


def posed(
    body: Body, state: State, betas: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Part poses with the pelvis at the state's position, whatever the shape."""
    rotations = np.concatenate([state.R_camera_root[None], state.Omega])
    return body.forward_kinematics(
        rotations, state.t_camera_root - body.rest_joints(betas)[0], betas
    )


def mask_of(
    body: Body, state: State, betas: NDArray[np.float64], garment: Garment | None = None
) -> NDArray[np.float32]:
    """The true silhouette in the region, by filled triangles of OpenCV's projection, with soft
    edges.
    """
    R, t = posed(body, state, betas)
    points = body.skin(R, t, betas)
    triangles = body.triangles()
    a, b, c = points[triangles].transpose(1, 0, 2)
    # the back lies behind the front
    triangles = triangles[np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0.0]
    if garment is not None:
        triangles = np.concatenate([triangles, garment.triangles + len(points)])
        points = np.concatenate([points, garment.placed(body, betas, R[0], t[0])])
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.zeros(5))[0][:, 0].astype(
        float
    )
    at = (REGION.crop_from_image(pixels) * 256 * FINER - 0.5) * 16
    image = np.zeros((256 * FINER, 256 * FINER), np.uint8)
    for triangle in np.rint(at).astype(np.int32)[triangles]:
        cv2.fillConvexPoly(image, np.ascontiguousarray(triangle), (255,), cv2.LINE_8, 4)
    small = cv2.resize(image, (256, 256), interpolation=cv2.INTER_AREA)
    soft: NDArray[np.float32] = cv2.GaussianBlur(small, (0, 0), 1.0).astype(
        np.float32
    ) / np.float32(255)
    return soft


def seen_in(body: Body, betas: NDArray[np.float64], garment: Garment | None) -> Track:
    """Exact keypoints and masks of a person who wears a garment."""
    at = body.keypoint_set("blazepose")
    states = standing(body)
    order = [at[name] for name in KEYPOINT_NAMES]
    points = np.array(
        [body.keypoints(*posed(body, state, betas), betas)[order] for state in states]
    )
    masks = [PersonMask(REGION, mask_of(body, state, betas, garment), SIZE) for state in states]
    return track_of_points(points, K, 6.0, masks=tuple(enumerate(masks)))


def surface_error(body: Body, a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Root mean square distance of the two shapes' vertices, pelvis on pelvis, metres."""
    apart = (body.rest_vertices(a) - body.rest_joints(a)[0]) - (
        body.rest_vertices(b) - body.rest_joints(b)[0]
    )
    return float(np.sqrt((apart**2).sum(axis=1).mean()))
