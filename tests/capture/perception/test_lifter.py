# SPDX-License-Identifier: GPL-3.0-or-later
"""The committed lifting network on people whose depth is known exactly, and its invariances."""

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.keypoint_offsets import with_keypoint_offsets
from scope.scope_addon.capture.perception.landmark_network import (
    HIPS,
    KEYPOINT_NAMES,
    LandmarkNetwork,
)
from scope.scope_addon.capture.perception.lifter import (
    LIFTER_FILE,
    Lifter,
    network_input,
    virtual_camera,
)
from scope.scope_addon.capture.perception.person_detector import PersonDetector
from scope.scope_addon.capture.tracking.left_right import MIRROR_PARTNER
from scope.scope_addon.errors import SetupError
from scope.solver.errors import ModelFileError
from scope.solver.rotations import exp


@pytest.fixture(scope="module")
def lifter():
    return Lifter()


def before_camera(body, R, heading):
    """Place a pose (24, 3, 3) 5 m away: its keypoints (2, 33, 3) in camera axes, exact and with
    keypoint offsets.
    """
    R[0] = np.diag([1.0, -1.0, -1.0]) @ exp(np.array([0, heading, 0])) @ R[0]
    pose = body.forward_kinematics(R, np.array([0.3, 0.1, 5.0]))
    at = list(body.keypoint_set("blazepose").values())
    return np.array([which.keypoints(*pose)[at] for which in (body, with_keypoint_offsets(body))])


def truth_and_rays(moments):
    own, seen = np.array(moments).swapaxes(0, 1)
    return own, seen[..., :2] / seen[..., 2:]


@pytest.fixture(scope="module")
def people(body):
    """Create keypoints of the body in camera axes (T, 33, 3) and their image (T, 33, 2) at z = 1:
    walking-like poses, every heading, a camera 5 m away.
    """
    rng = np.random.default_rng(0)
    out = []
    for k in range(48):
        pose = rng.normal(0, 0.05, (body.K + 1, 3))
        swing = 0.5 * np.sin(k)
        for name, angle in (
            ("left_hip", -swing),
            ("right_hip", swing),
            ("left_knee", 0.4),
            ("right_knee", 0.4),
        ):
            pose[body.joint_names.index(name), 0] += angle
        for name, side in (("left_shoulder", -1), ("right_shoulder", 1)):
            pose[body.joint_names.index(name), 2] += 1.2 * side
        R = exp(pose)
        out.append(before_camera(body, R, 2 * np.pi * k / 48))
    return truth_and_rays(out)


def relative(points):
    return points - points[:, HIPS].mean(axis=1, keepdims=True)


def test_depth_of_people_outside_the_training_data_is_estimated_from_their_image_alone(
    lifter, people
):
    people, rays = people
    lifted = lifter.lift(rays, np.ones(rays.shape[:2]), None)
    limbs = [*range(11, 17), *range(25, 29)]
    error = np.linalg.norm(lifted.points - relative(people), axis=-1)[:, limbs].mean()
    flat = np.linalg.norm(relative(people) * [1, 1, 0] - relative(people), axis=-1)[:, limbs].mean()
    assert error < 0.1
    assert error < 0.7 * flat


def test_errors_match_their_standard_deviations(lifter, people):
    people, rays = people
    lifted = lifter.lift(rays, np.ones(rays.shape[:2]), None)
    z = (lifted.points - relative(people))[..., 2] / lifted.sigma_along
    assert 0.9 < np.sqrt(np.square(z).mean()) < 1.15
    assert (lifted.sigma_along > 0).all()
    # wrists are harder than hips
    assert lifted.sigma_along[:, 15].mean() > lifted.sigma_along[:, HIPS].mean()


LIMBS = [
    f"{side}_{part}"
    for part in ("shoulder", "elbow", "wrist", "knee", "ankle")
    for side in ("left", "right")
]


@pytest.mark.slow
def test_real_people_are_lifted_better_than_their_world_landmarks_are(lifter, shared, frames):
    """A man filmed by four cameras, with true joints in the camera's axes, NaN where not measured.

    Root mean square of residual over standard deviation: 1 if calibrated.
    """
    detector = PersonDetector(threads=1)
    network = LandmarkNetwork("pose_landmark_heavy", threads=1)
    limbs = [KEYPOINT_NAMES.index(name) for name in LIMBS]
    found = []
    for camera in range(1, 5):
        truth = np.load(shared / "data" / "pose2sim" / f"truth_cam{camera}.npz")
        names = [
            {"L": "left_", "R": "right_"}.get(n[0], "") + n[1:].lower() for n in truth["names"]
        ]
        rows = {int(index): row for row, index in enumerate(truth["frame_index"])}
        K = truth["intrinsics"]
        for k, image in enumerate(frames(f"pose2sim/cam{camera}", stop=81, every=20)):
            if 20 * k not in rows:
                continue
            (seen,) = network.estimate(
                image, [max(detector.detect(image), key=lambda d: d.region.side_px).region]
            )
            (seen,) = network.estimate(image, [seen.next_region])
            joints = dict(zip(names, truth["joints"][rows[20 * k]], strict=True))
            hips = (joints["left_hip"] + joints["right_hip"]) / 2
            true_limbs = np.array([joints[name] for name in LIMBS]) - hips
            rays = (seen.keypoints_px - K[:2, 2]) / np.diag(K)[:2]
            found.append((rays, seen.keypoints_confidence, seen.world_landmarks, true_limbs))
    rays, confidence, world, exact = (np.array(part) for part in zip(*found, strict=True))
    assert len(exact) >= 15
    lifted = lifter.lift(rays, confidence, world)
    ours, theirs = (
        np.nanmean(np.linalg.norm(p[:, limbs] - exact, axis=-1)) for p in (lifted.points, world)
    )
    assert ours < 0.115
    assert ours < 0.85 * theirs
    error = (lifted.points[:, limbs] - exact) @ np.swapaxes(virtual_camera(rays), 1, 2)
    across = error[..., :2] / lifted.sigma_across[:, limbs, None]
    along = error[..., 2] / lifted.sigma_along[:, limbs]
    assert 0.75 < np.sqrt(np.nanmean(np.square(across))) < 1.25
    assert 0.75 < np.sqrt(np.nanmean(np.square(along))) < 1.25


def test_a_mirrored_image_is_lifted_to_the_mirrored_body(lifter, people):
    people, rays = people
    ones = np.ones(people.shape[:2])
    plain = lifter.lift(rays, ones, None).points
    mirrored = lifter.lift(rays[:, MIRROR_PARTNER] * [-1, 1], ones, None).points
    assert np.linalg.norm(mirrored - plain[:, MIRROR_PARTNER] * [-1, 1, 1], axis=-1).mean() < 0.05


def test_panning_the_camera_changes_neither_input_nor_shape(lifter, people):
    """A pan around the camera's centre moves the person in the image; the lifted keypoints rotate
    with it.
    """
    turn = exp(np.array([0.0, 0.35, 0.0]))
    (_, rays) = people
    turned = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1) @ turn.T
    other = turned[..., :2] / turned[..., 2:]
    ones = np.ones(rays.shape[:2])
    none = np.zeros((*rays.shape[:2], 3))
    x, _ = network_input(rays, ones, none, np.zeros(len(rays)))
    y, _ = network_input(other, ones, none, np.zeros(len(rays)))
    # The mean of rays is not quite the ray of a mean, so the two cameras differ a little.
    assert np.abs(x - y).max() < 0.1
    a = lifter.lift(rays, ones, None).points
    b = lifter.lift(other, ones, None).points
    assert np.linalg.norm(a @ turn.T - b, axis=-1).mean() < 0.03


def test_wrong_files_are_named(tmp_path):
    with pytest.raises(SetupError, match="nowhere"):
        Lifter(tmp_path / "nowhere.onnx")
    (tmp_path / "junk.onnx").write_bytes(LIFTER_FILE.read_bytes()[:1000])
    with pytest.raises(ModelFileError, match="junk"):
        Lifter(tmp_path / "junk.onnx")
