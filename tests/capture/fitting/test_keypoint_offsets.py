# SPDX-License-Identifier: GPL-3.0-or-later
"""Keypoint offsets: symmetric, recovered if known, and an improvement on people they were not
estimated from.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scope.benchmarks.ablation import WITHOUT_OFFSETS, replaced
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.fitting.frame_measurements import Measurer
from scope.scope_addon.capture.fitting.keypoint_offsets import with_keypoint_offsets
from scope.scope_addon.capture.fitting.prepared_track import prepare_track
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.motion import Motion
from scope.solver.body import Body
from scope.solver.names import BLAZEPOSE
from scope.solver.rotations import exp
from scope.tools.train_lifter.place_keypoints import normal_equations, offsets

from ..walking import someone_walking, track_without_depth


def test_left_and_right_are_mirror_images(body):
    seen = with_keypoint_offsets(body)
    at = body.keypoint_set("blazepose")
    for name in BLAZEPOSE:
        if name.startswith("left_"):
            left, right = (
                seen.keypoint_template[at[n]] for n in (name, name.replace("left", "right"))
            )
            np.testing.assert_allclose(left, right * [-1, 1, 1], atol=2e-5, err_msg=name)


def test_only_the_networks_keypoints_move(body):
    seen = with_keypoint_offsets(body)
    at = body.keypoint_set("blazepose")
    moved = np.flatnonzero((seen.keypoint_template != body.keypoint_template).any(axis=1))
    np.testing.assert_array_equal(moved, sorted(at.values()))
    np.testing.assert_array_equal(seen.J_template, body.J_template)
    shift = seen.keypoint_template - body.keypoint_template
    assert shift[at["left_hip"], 1] < -0.01  # below the joint
    assert shift[at["left_ankle"], 1] > 0.005  # above it


def left_over_px(body: Body, motion: Motion) -> float:
    """Median distance of confident keypoints from the body's, by OpenCV's rotation vectors and
    projection.
    """
    names = motion.keypoints2d_names.tolist()
    at = body.keypoint_set("blazepose")
    found = []
    for t in np.flatnonzero(motion.valid):
        R = np.array([cv2.Rodrigues(v)[0] for v in motion.poses[t].reshape(-1, 3).astype(float)])
        R[0] = motion.world_from_camera[t, :3, :3].T @ R[0]
        root = motion.joints_cam[t, 0] - body.rest_joints(motion.betas)[0]
        points = body.keypoints(*body.forward_kinematics(R, root, motion.betas), motion.betas)
        points = points[[at[name] for name in BLAZEPOSE]].astype(float)
        intrinsics = motion.intrinsics.astype(float)
        pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), intrinsics, np.zeros(5))[0][
            :, 0
        ]
        seen = motion.keypoints2d[t, [names.index(name) for name in BLAZEPOSE]]
        found.append(np.linalg.norm(seen[:, :2] - pixels, axis=1)[seen[:, 2] > 0.5])
    return float(np.median(np.concatenate(found)))


def test_keypoints_of_a_network_without_depth_get_no_offsets(body):
    """The offsets of other networks are unknown."""
    camera = choose_camera(1280, 720)
    pixels, world = someone_walking(3, 30.0, 0.4)
    track = track_without_depth(pixels, 30.0, {})
    for known, which in ((False, body), (True, with_keypoint_offsets(body))):
        prepared = prepare_track(body, replace(track, world_landmarks=world * known), camera)
        np.testing.assert_array_equal(prepared.body.keypoint_template, which.keypoint_template)


def test_a_hip_is_as_confident_as_the_knee_that_determines_its_rotation(body):
    """Keypoints at joints do not determine the rotation of these joints; keypoints further down the
    chain do.
    """
    measurer = Measurer(with_keypoint_offsets(body), choose_camera(1280, 720).intrinsics)
    hidden = np.array(
        [any(part in name for part in ("knee", "ankle", "heel", "foot")) for name in BLAZEPOSE]
    )
    confidence = np.ones((1, len(BLAZEPOSE)))
    confidence[:, hidden] = 0.0
    joints = dict(zip(body.joint_names, measurer.joint_confidence(confidence)[0], strict=True))
    assert joints["left_hip"] == joints["right_hip"] == joints["left_knee"] == 0.0
    assert joints["left_shoulder"] == joints["head"] == 1.0


class Recorded(SimpleNamespace):
    """The part of a motion from which keypoint offsets are estimated."""

    def __len__(self) -> int:
        return len(self.poses)


def test_known_offsets_are_recovered(body):
    """On a body that turns in front of the camera, with keypoints displaced symmetrically by some
    centimetres.
    """
    rng = np.random.default_rng(2)
    displaced = {name: rng.normal(0, 0.012, 3) for name in BLAZEPOSE if "right" not in name}
    displaced["nose"][0] = 0.0
    mirror = np.array([-1.0, 1.0, 1.0])
    shifts = [
        displaced[n] if n in displaced else displaced[n.replace("right", "left")] * mirror
        for n in BLAZEPOSE
    ]
    at = [body.keypoint_set("blazepose")[name] for name in BLAZEPOSE]
    template = body.keypoint_template.copy()
    template[at] += np.array(shifts)
    seen = replace(body, keypoint_template=template)
    T = 24
    K = np.array([[900.0, 0, 640], [0, 900, 360], [0, 0, 1]])
    poses = rng.normal(0, 0.2, (T, body.K + 1, 3))
    poses[:, 0] = np.linspace(0, 2 * np.pi, T)[:, None] * np.array([0.1, 1.0, 0.0])
    R_world_camera = exp(np.array([2.8, 0.1, 0.2]))
    trans = np.tile(R_world_camera @ np.array([0.0, 0.0, 4.0]), (T, 1))
    R, t = body.forward_kinematics(exp(poses), trans)
    R = R_world_camera.T @ R
    t = t @ R_world_camera
    points = seen.keypoints(R, t)[:, at]
    pixels = points @ K.T
    motion = Recorded(
        betas=np.zeros(body.P),
        poses=poses.reshape(T, -1),
        world_from_camera=np.tile(
            np.block([[R_world_camera, np.zeros((3, 1))], [np.zeros(3), 1.0]]), (T, 1, 1)
        ),
        joints_cam=t,
        keypoints2d=np.concatenate(
            [pixels[..., :2] / pixels[..., 2:], np.ones((T, len(at), 1))], axis=-1
        ),
        keypoints2d_names=np.array(BLAZEPOSE),
        intrinsics=K,
        valid=np.ones(T, bool),
    )
    # as of a hundred people
    found = offsets(*(100 * each for each in normal_equations(body, motion)))
    np.testing.assert_allclose(found, shifts, atol=2e-3)


@pytest.mark.slow
def test_offsets_lower_the_reprojection_error_of_a_man_they_were_not_estimated_from(
    shared, body, observe_frames
):
    video = shared / "data" / "pose2sim" / "cam3.mp4"
    wanted = VideoRange(end_s=0.6)
    left_over = []
    for which, replacements in ((body, [WITHOUT_OFFSETS]), (with_keypoint_offsets(body), [])):
        with replaced(replacements):
            (motion,) = capture(
                video,
                body,
                CaptureOptions(quality="balanced", wanted=wanted),
                observe_frames=observe_frames,
            ).motions
        left_over.append(left_over_px(which, motion))
    assert left_over[1] < 0.9 * left_over[0]
