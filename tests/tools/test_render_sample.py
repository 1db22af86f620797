# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample clip: a motion a person could make, a truth that agrees with itself, a video that
agrees with both.
"""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.solver.body import Body
from scope.solver.body_file import ASSETS
from scope.tools.render_sample.choreography import choreograph, standing_feet
from scope.tools.render_sample.leg import solve_leg
from scope.tools.render_sample.truth import sample_shot, write_truth

FPS = 30


@pytest.fixture(scope="module")
def posed(body) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rotations, trans and joints in the world of every frame, at the shape of the clip."""
    rotations, trans = choreograph(body, np.zeros(body.P), FPS)
    return rotations, trans, body.forward_kinematics(rotations, trans)[1]


def test_a_leg_reaches_its_ankle_with_the_knee_ahead():
    rng = np.random.default_rng(4)
    thigh = np.array([0.0, -0.4, 0.02])
    shank = np.array([0.01, -0.42, -0.02])
    for _ in range(50):
        root = cv2.Rodrigues(rng.normal(size=3))[0]
        hip = rng.normal(size=3)
        ankle = hip + root @ np.array(
            [rng.uniform(-0.2, 0.2), rng.uniform(-0.75, -0.3), rng.uniform(-0.2, 0.3)]
        )
        R_hip, R_knee = solve_leg(root, hip, ankle, thigh, shank)
        np.testing.assert_allclose(hip + root @ R_hip @ (thigh + R_knee @ shank), ankle, atol=1e-9)
        bend = cv2.Rodrigues(R_knee)[0].ravel()
        assert bend[0] > 0  # knees bend one way only
        np.testing.assert_allclose(bend[1:], 0, atol=1e-9)
    with pytest.raises(ValueError, match="reach"):
        solve_leg(np.eye(3), np.zeros(3), np.array([0, -0.9, 0.0]), thigh, shank)


def test_standing_feet_stand_still_on_the_floor(body, posed):
    rotations, trans, joints = posed
    standing = standing_feet(np.arange(len(trans)) / FPS)
    assert 0.6 < standing.mean() < 1.0
    for side, (ankle, toe) in enumerate(((7, 10), (8, 11))):
        runs = np.split(
            np.arange(len(trans)), np.nonzero(np.diff(standing[:, side].astype(int)))[0] + 1
        )
        for run in (r for r in runs if standing[r[0], side]):
            for joint in (ankle, toe):
                assert np.ptp(joints[run, joint], axis=0).max() < 1e-9
    for f in range(0, len(trans), 10):
        R, t = body.forward_kinematics(rotations[f], trans[f])
        assert abs(body.skin(R, t)[:, 2].min()) < 0.012


def test_the_motion_is_smooth_and_within_what_joints_can_do(posed):
    rotations, _, joints = posed
    speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1) * FPS
    assert speed.max() < 7.0  # m/s, a hand
    assert speed[:, 0].max() < 1.6  # m/s, the pelvis
    trace = np.trace(rotations[:, 1:], axis1=-2, axis2=-1)
    angles = np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1)))
    assert angles.max() < 130
    assert angles[:, 3 - 1].max() < 45  # spine1


def test_what_is_written_agrees_with_itself(tmp_path, body, posed):
    rotations, trans, joints = posed
    write_truth(tmp_path / "truth.npz", body, sample_shot(rotations, trans))
    check_truth(dict(np.load(tmp_path / "truth.npz")), body, 1e-5)
    world = dict(np.load(tmp_path / "truth.npz"))
    T = world["world_from_camera"]
    np.testing.assert_allclose(world["joints_cam"] @ T[:3, :3].T + T[:3, 3], joints, atol=1e-5)


def check_truth(truth: dict, body: Body, tolerance: float) -> None:
    """By OpenCV's rotation vectors and its projection, and kinematics spelled out here."""
    poses = truth["poses"].reshape(len(truth["trans"]), -1, 3).astype(float)
    J = body.J_template + body.J_shapedirs @ truth["betas"].astype(float)
    camera_from_world = np.linalg.inv(truth["world_from_camera"])
    names = [str(n) for n in truth["joint_names"]]
    for f in range(0, len(poses), 7):
        transforms: list[np.ndarray] = []
        for i, parent in enumerate(body.parents):
            local = np.eye(4)
            local[:3, :3] = cv2.Rodrigues(poses[f, i])[0]
            local[:3, 3] = J[i] + truth["trans"][f] if parent < 0 else J[i] - J[parent]
            transforms.append(local if parent < 0 else transforms[parent] @ local)
        camera = np.array([(camera_from_world @ T)[:3, 3] for T in transforms])
        np.testing.assert_allclose(truth["joints_cam"][f], camera, atol=tolerance)
        knee = camera[names.index("left_knee")]
        pixel = cv2.projectPoints(
            knee[None], np.zeros(3), np.zeros(3), truth["intrinsics"], truth["dist"]
        )[0].ravel()
        column = [str(n) for n in truth["names"]].index("LKnee")
        np.testing.assert_allclose(
            truth["uv"][f, column], pixel, atol=0.5 if tolerance > 1e-3 else 1e-2
        )


def test_the_clip_in_the_assets_fits_its_truth_and_the_body(body):
    truth = dict(np.load(ASSETS / "sample" / "sample_truth.npz"))
    # another build of the body may move a joint a little: the clip still shows it
    check_truth(truth, body, 0.01)
    clip = ASSETS / "sample" / "sample.mp4"
    assert clip.stat().st_size < 2_000_000
    width, height = truth["size"]
    assert (truth["uv"] > 0).all()
    assert (truth["uv"] < (width - 1, height - 1)).all()
    with open_video(clip) as video:
        images = [frame.image_rgb.astype(int) for frame in video]
    assert (video.width, video.height, video.fps) == (width, height, truth["fps"])
    assert len(images) == len(truth["frame_index"]) == 150
    # walks from the left to the right half
    room = np.hstack([images[-1][:, : width // 2], images[0][:, width // 2 :]])
    for f in range(0, 150, 10):  # what differs from the empty room surrounds the projected limbs
        moved = cv2.dilate(
            (np.abs(images[f] - room).max(-1) > 30).astype(np.uint8), np.ones((5, 5))
        )
        u, v = np.round(truth["uv"][f]).astype(int).T
        assert moved[v, u].mean() > 0.8
