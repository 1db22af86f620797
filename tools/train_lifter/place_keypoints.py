# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimate the landmark network's keypoint offsets: ``python -m
scope.tools.train_lifter.place_keypoints FOLDER``.

FOLDER holds the clips (../shared/data/clips). Prints, for each person and for all, the
least-squares offsets found in captures without keypoint offsets; the last column belongs in
`keypoint_offsets`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...benchmarks.ablation import WITHOUT_OFFSETS, replaced
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.capture.tracking.left_right import MIRROR_PARTNER
from ...scope_addon.motion import Motion
from ...solver import Body, load_body
from ...solver.rotations import exp

CLIPS = (
    "walk_side_static",
    "run_moving_camera",
    "squats_5fps",
    "gesture_square",
    "two_people_portrait",
)
MIN_FRAMES = 20  # of a person who is included
REGULARIZATION = 0.3
FARTHEST_M = 0.12  # larger errors are outliers
REFLECTION = np.diag([-1.0, 1.0, 1.0])


def normal_equations(body: Body, motion: Motion) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the normal equations (33, 3, 3), (33, 3) of one motion, left and right combined."""
    at = body.keypoint_set("blazepose")
    indices = [at[name] for name in KEYPOINT_NAMES]
    part = body.keypoint_part[indices]
    betas = motion.betas.astype(float)
    rotations = exp(motion.poses.reshape(len(motion), -1, 3).astype(float))
    rotations[:, 0] = np.swapaxes(motion.world_from_camera[:, :3, :3], 1, 2) @ rotations[:, 0]
    R, t = body.forward_kinematics(
        rotations, motion.joints_cam[:, 0] - body.rest_joints(betas)[0], betas
    )
    points = body.keypoints(R, t, betas, indices)
    order = [motion.keypoints2d_names.tolist().index(name) for name in KEYPOINT_NAMES]
    pixels = motion.keypoints2d[:, order, :2]
    confidence = motion.keypoints2d[:, order, 2]
    K = motion.intrinsics
    depth = points[..., 2:]
    left_over = (pixels - K[:2, 2]) / [K[0, 0], K[1, 1]] * depth - points[..., :2]
    weight = confidence * motion.valid[:, None] * (np.linalg.norm(left_over, axis=-1) < FARTHEST_M)
    weight = weight / motion.valid.sum()
    across = R[:, part, :2]
    A = np.einsum("tk,tkia,tkib->kab", weight, across, across)
    b = np.einsum("tk,tkia,tki->ka", weight, across, left_over)
    return A + REFLECTION @ A[MIRROR_PARTNER] @ REFLECTION, b + b[MIRROR_PARTNER] @ REFLECTION


def offsets(A: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve the normal equations for offsets (33, 3), metres."""
    return np.linalg.solve(A + REGULARIZATION * np.eye(3), b[..., None])[..., 0]


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Find where the landmark network sees keypoints.")
    parser.add_argument("clips", type=Path, help="folder of the clips")
    folder: Path = parser.parse_args().clips
    body = load_body("scope")
    everybody = []
    for clip in CLIPS:
        with replaced([WITHOUT_OFFSETS]):
            found = capture(folder / f"{clip}.mp4", body, CaptureOptions(people="all"))
        everybody += [
            normal_equations(body, m) for m in found.motions if m.valid.sum() >= MIN_FRAMES
        ]
    columns = [offsets(*each) for each in everybody]
    columns.append(offsets(*(np.sum(each, axis=0) for each in zip(*everybody, strict=True))))
    for k, name in enumerate(KEYPOINT_NAMES):
        if "right" not in name:
            rounded = [np.round(1000 * column[k]).astype(int).tolist() for column in columns]
            print(f"{name:16}", *(f"{x:4d}{y:4d}{z:4d} |" for x, y, z in rounded))


if __name__ == "__main__":
    main()
