# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the landmark network sees keypoints: ``python -m scope.tools.train_lifter.place_keypoints FOLDER``.

FOLDER holds the clips (../shared/data/clips). Prints, for every person and for all of them, what the least squares of
`seen_keypoints` find in captures whose keypoints lie at our body's own; the last column belongs into that module.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from ...scope_addon.capture.fitting.ablation import Parts
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.motion import Motion
from ...solver import Body, load_body
from ...solver.rotations import exp
from .detector_noise import MIRROR_PARTNER

CLIPS = ("walk_side_static", "run_moving_camera", "squats_5fps", "gesture_square", "two_people_portrait")
LEAST_FRAMES = 20  # of a person who counts
REGULARIZATION = 0.3
FARTHEST_M = 0.12  # a keypoint that is further off is a mistake
REFLECTION = np.diag([-1.0, 1.0, 1.0])


def normal_equations(body: Body, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """(33, 3, 3) and (33, 3) of the least squares over one motion, left and right together."""
    at = body.keypoint_set("blazepose")
    indices = [at[name] for name in KEYPOINT_NAMES]
    part, betas = body.keypoint_part[indices], motion.betas.astype(float)
    rotations = exp(motion.poses.reshape(len(motion), -1, 3).astype(float))
    rotations[:, 0] = np.swapaxes(motion.world_from_camera[:, :3, :3], 1, 2) @ rotations[:, 0]
    R, t = body.forward_kinematics(rotations, motion.joints_cam[:, 0] - body.rest_joints(betas)[0], betas)
    points = body.keypoints(R, t, betas, indices)
    order = [motion.keypoints2d_names.tolist().index(name) for name in KEYPOINT_NAMES]
    pixels, confidence = motion.keypoints2d[:, order, :2], motion.keypoints2d[:, order, 2]
    K, depth = motion.intrinsics, points[..., 2:]
    left_over = (pixels - K[:2, 2]) / [K[0, 0], K[1, 1]] * depth - points[..., :2]
    weight = confidence * motion.valid[:, None] * (np.linalg.norm(left_over, axis=-1) < FARTHEST_M)
    weight = weight / motion.valid.sum()
    across = R[:, part, :2]
    A = np.einsum("tk,tkia,tkib->kab", weight, across, across)
    b = np.einsum("tk,tkia,tki->ka", weight, across, left_over)
    return A + REFLECTION @ A[MIRROR_PARTNER] @ REFLECTION, b + b[MIRROR_PARTNER] @ REFLECTION


def offsets(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(33, 3) metres, the solution of the normal equations."""
    return np.linalg.solve(A + REGULARIZATION * np.eye(3), b[..., None])[..., 0]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Find where the landmark network sees keypoints.")
    parser.add_argument("clips", type=Path, help="folder of the clips")
    folder: Path = parser.parse_args().clips
    body, parts = load_body("scope"), Parts(seen_keypoints=False)
    everybody = []
    for clip in CLIPS:
        found = capture(folder / f"{clip}.mp4", body, CaptureOptions(people="all", parts=parts))
        everybody += [normal_equations(body, m) for m in found.motions if m.valid.sum() >= LEAST_FRAMES]
    columns = [offsets(*each) for each in everybody]
    columns.append(offsets(*(np.sum(each, axis=0) for each in zip(*everybody, strict=True))))
    for k, name in enumerate(KEYPOINT_NAMES):
        if "right" not in name:
            rounded = [np.round(1000 * column[k]).astype(int).tolist() for column in columns]
            print(f"{name:16}", *(f"{x:4d}{y:4d}{z:4d} |" for x, y, z in rounded))


if __name__ == "__main__":
    main()
