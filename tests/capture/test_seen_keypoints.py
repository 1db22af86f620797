# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the landmark network sees keypoints: on both sides alike, and nearer to it on people whom nobody asked."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.parts import Parts
from scope.scope_addon.capture.pipeline import CaptureOptions, capture
from scope.scope_addon.capture.seen_keypoints import as_seen, offset
from scope.scope_addon.capture.video_range import VideoRange
from scope.scope_addon.motion import Motion
from scope.solver.body import Body
from scope.solver.names import BLAZEPOSE


def test_left_and_right_are_mirror_images(body):
    seen = as_seen(body)
    at = body.keypoint_set("blazepose")
    for name in BLAZEPOSE:
        if name.startswith("left_"):
            left, right = (seen.keypoint_template[at[n]] for n in (name, name.replace("left", "right")))
            np.testing.assert_allclose(left, right * [-1, 1, 1], atol=2e-5, err_msg=name)


def test_only_what_networks_see_moves(body):
    seen, at = as_seen(body), body.keypoint_set("blazepose")
    moved = np.flatnonzero((seen.keypoint_template != body.keypoint_template).any(axis=1))
    np.testing.assert_array_equal(moved, sorted(at.values()))
    np.testing.assert_array_equal(seen.J_template, body.J_template)
    for name, index in at.items():
        shift = seen.keypoint_template[index] - body.keypoint_template[index]
        np.testing.assert_allclose(shift, offset(name), atol=1e-9)
    assert offset("left_hip")[1] < -0.01  # below the joint
    assert offset("left_ankle")[1] > 0.005  # above it


def left_over_px(body: Body, motion: Motion) -> float:
    """Median distance of confident keypoints from the body's, by OpenCV's rotation vectors and projection."""
    names = motion.keypoints2d_names.tolist()
    at = body.keypoint_set("blazepose")
    found = []
    for t in np.flatnonzero(motion.valid):
        R = np.array([cv2.Rodrigues(v)[0] for v in motion.poses[t].reshape(-1, 3).astype(float)])
        R[0] = motion.world_from_camera[t, :3, :3].T @ R[0]
        root = motion.joints_cam[t, 0] - body.rest_joints(motion.betas)[0]
        points = body.keypoints(*body.forward_kinematics(R, root, motion.betas), motion.betas)
        points = points[[at[name] for name in BLAZEPOSE]].astype(float)
        pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), motion.intrinsics.astype(float), None)[0][:, 0]
        seen = motion.keypoints2d[t, [names.index(name) for name in BLAZEPOSE]]
        found.append(np.linalg.norm(seen[:, :2] - pixels, axis=1)[seen[:, 2] > 0.5])
    return float(np.median(np.concatenate(found)))


@pytest.mark.parametrize("camera", ["cam1", "cam3"])
def test_a_body_covers_a_man_better_of_whom_the_offsets_know_nothing(shared, body, camera):
    video, wanted = shared / "data" / "pose2sim" / f"{camera}.mp4", VideoRange(end_s=0.6)
    left_over = []
    for which, parts in ((body, Parts(placement=False)), (as_seen(body), Parts())):
        (motion,) = capture(video, body, CaptureOptions(parts=parts, wanted=wanted)).motions
        left_over.append(left_over_px(which, motion))
    assert left_over[1] < 0.9 * left_over[0]
