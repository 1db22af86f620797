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
from scope.tools.render_sample.choreography import choreograph
from scope.tools.render_sample.truth import sample_shot, write_truth

FPS = 30


@pytest.fixture(scope="module")
def posed(body) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rotations, trans and joints in the world of every frame, at the shape of the clip."""
    rotations, trans = choreograph(body, np.zeros(body.P), FPS)
    return rotations, trans, body.forward_kinematics(rotations, trans)[1]


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


@pytest.mark.slow
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
