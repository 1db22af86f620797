# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the landmark network on renders of the body: ``python -m scope.tools.train_lifter.render_pairs MOTIONS``.

The body in augmented poses and random clothes in front of random backgrounds, drawn with the add-on's own rasterizer;
for each image the true keypoints and the network's output, from which the detector's errors follow.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.capture.overlay.rasterizer import Canvas, rasterize
from ...scope_addon.capture.perception.landmark_network import LandmarkNetwork
from ...scope_addon.capture.perception.region import region_from_points
from ...solver.body import Body
from ...solver.loaders.body_file import load_body
from .augment import PoseSampler, load_motions
from .dataset import cameras, pitches
from .split import training_frames

PICTURE_PX = 420
FILL = 0.72  # of the image, the person's longer side
NEAREST_M, FARTHEST_M = 2.2, 9.0
SAVE_EVERY = 500
SKIN, HAIR, SUIT, ACCENT = range(4)  # the body's materials
WAIST_M = 0.05  # faces of the suit below, in the model frame, are trousers
KEYS = ("points", "rays", "confidence", "world", "presence", "spread", "disagreement")


class Renderer:
    """Draws one body in random clothes."""

    def __init__(self, body: Body) -> None:
        self.body, self.triangles = body, body.triangles()
        assert body.face_material is not None
        assert body.material_colors is not None
        self.material = np.concatenate([body.face_material, body.face_material])
        self.low = body.v_template[self.triangles].mean(axis=1)[:, 1] < WAIST_M
        self.colors = np.sqrt(body.material_colors[:, :3])

    def clothes(self, rng: np.random.Generator) -> NDArray[np.float64]:
        """Draw colours (F, 3) of the triangles, sRGB."""
        colors = self.colors.copy()
        colors[SKIN] = np.array([0.9, 0.7, 0.6]) * rng.uniform(0.35, 1)
        colors[HAIR] = rng.uniform(0, 0.6) * np.array([1, 0.8, 0.6])
        colors[SUIT] = rng.uniform(0, 1, 3) ** 1.2
        colors[ACCENT] = rng.uniform(0, 1, 3)
        faces = colors[self.material]
        if rng.random() < 0.7:
            faces[self.low & ((self.material == SUIT) | (self.material == ACCENT))] = rng.uniform(0, 1, 3)
        return faces

    def picture(
        self, rng: np.random.Generator, vertices: NDArray[np.float64], intrinsics: NDArray[np.float64]
    ) -> NDArray[np.uint8]:
        """Draw the vertices (V, 3), camera frame, in front of a random background; (420, 420, 3) uint8."""
        size = PICTURE_PX
        faces = self.clothes(rng)
        cells = rng.uniform(0, 255, (rng.integers(2, 12), rng.integers(2, 12), 3)).astype(np.float32)
        blend = cv2.INTER_CUBIC if rng.random() < 0.7 else cv2.INTER_NEAREST
        image = cv2.resize(cells, (size, size), interpolation=blend) * rng.uniform(0.2, 1) + rng.uniform(0, 100)
        image = np.clip(image + rng.normal(0, rng.uniform(2, 14), (size, size, 1)), 0, 255)
        canvas = Canvas.blank(size, size)
        rasterize(canvas, vertices, self.triangles, faces, intrinsics)
        covered = canvas.coverage
        image[covered] = canvas.rgba[covered][:, :3] * rng.uniform(0.6, 1.15)
        blurred = cv2.GaussianBlur(np.clip(image, 0, 255).astype(np.uint8), (0, 0), rng.uniform(0.5, 1.6))
        return blurred.astype(np.uint8, copy=False)


def observe(
    rng: np.random.Generator, sampler: PoseSampler, renderer: Renderer, network: LandmarkNetwork
) -> dict[str, Any] | None:
    """Return true points and the network's output (``KEYS``) of one image, or None if the person is too close."""
    body, at = sampler.body, np.array(list(sampler.body.keypoint_set("blazepose").values()))
    Omega = sampler.pose(rng).astype(float)
    betas = np.clip(rng.standard_normal(body.P), -2.5, 2.5)
    R, t = body.forward_kinematics(Omega, np.zeros(3), betas)
    vertices, points = body.skin(R, t, betas), body.keypoints(R, t, betas)[at]
    middle = points[[23, 24]].mean(axis=0)
    R_camera_world = cameras(rng, 1, pitches(rng, 1))[0].astype(float)
    away = [0, 0, np.exp(rng.uniform(np.log(NEAREST_M), np.log(FARTHEST_M)))]
    vertices, points = ((p - middle) @ R_camera_world.T + away for p in (vertices, points))
    if vertices[:, 2].min() < 0.3:
        return None
    rays = points[:, :2] / points[:, 2:]
    low, high = rays.min(axis=0), rays.max(axis=0)
    focal = PICTURE_PX * FILL / (high - low).max()
    center = PICTURE_PX / 2 - focal * (low + high) / 2
    intrinsics = np.array([[focal, 0, center[0]], [0, focal, center[1]], [0, 0, 1]])
    image = renderer.picture(rng, vertices, intrinsics)
    pixels = rays * focal + center
    hips, shoulders = pixels[[23, 24]].mean(axis=0), pixels[[11, 12]].mean(axis=0)
    radius = np.linalg.norm(pixels - hips, axis=1).max() * 1.1
    up = (shoulders - hips) / max(np.linalg.norm(shoulders - hips), 1)
    (first,) = network.estimate(image, [region_from_points(hips, hips + up * radius)])
    (seen,) = network.estimate(image, [first.next_region])
    found = (points, (seen.keypoints_px - center) / focal, seen.keypoints_confidence, seen.world_landmarks,
             seen.presence, seen.spread, seen.disagreement)  # fmt: skip
    return dict(zip(KEYS, found, strict=True))


def save(path: Path, pairs: list[dict[str, Any]]) -> None:
    """Write the pairs, replacing what is there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        np.savez_compressed(temporary, **{key: np.array([pair[key] for pair in pairs], np.float32) for key in KEYS})


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Observe the landmark network's errors on renders of the body.")
    parser.add_argument("motions", type=Path, help="file written by scope.tools.mocap.fit_body")
    parser.add_argument("-o", "--output", type=Path, default=Path("build/lifter/pairs.npz"))
    parser.add_argument("-n", "--count", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=7)
    a = parser.parse_args()
    body, rng = load_body("scope"), np.random.default_rng(a.seed)
    sampler, renderer = PoseSampler(body, training_frames(load_motions(a.motions))), Renderer(body)
    network, pairs = LandmarkNetwork("pose_landmark_heavy", 1), []
    for k in range(a.count):
        pair = observe(rng, sampler, renderer, network)
        if pair is not None:
            pairs.append(pair)
        if (k + 1) % SAVE_EVERY == 0 or k + 1 == a.count:
            save(a.output, pairs)
            print(f"{k + 1} pictures", flush=True)


if __name__ == "__main__":
    main()
