# SPDX-License-Identifier: GPL-3.0-or-later
"""The landmark network: decoding of hand-made outputs, and real images against measured ground
truth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.perception.landmark_network import (
    KEYPOINT_NAMES,
    LandmarkNetwork,
    interpret,
    refine,
)
from scope.scope_addon.capture.perception.person_detector import PersonDetector
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.perception.sessions import landmark_network_name
from scope.scope_addon.errors import UsageError
from scope.solver.body_file import ASSETS

from ...required import package

SAMPLE = ASSETS / "sample"
TRUTH_NAMES = {
    "LShoulder": "left_shoulder", "RShoulder": "right_shoulder", "LElbow": "left_elbow",
    "RElbow": "right_elbow",
    "LWrist": "left_wrist", "RWrist": "right_wrist", "LHip": "left_hip", "RHip": "right_hip",
    "LKnee": "left_knee",
    "RKnee": "right_knee", "LAnkle": "left_ankle", "RAnkle": "right_ankle",
}  # fmt: skip


@pytest.fixture(scope="module")
def network(networks: Path) -> LandmarkNetwork:
    return LandmarkNetwork(landmark_network_name("best"), threads=1)


def raw_outputs() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Create outputs: landmarks in the middle of the crop, empty heatmaps, world landmarks at the
    origin.
    """
    landmarks = np.zeros((39, 5), np.float32)
    landmarks[:, :2] = 128
    return landmarks, np.full((39, 64, 64), -20, np.float32), np.zeros((39, 3), np.float32)


def test_interpret_maps_to_the_image_and_the_camera() -> None:
    landmarks, heatmaps, world = raw_outputs()
    # right edge of the crop; visibility ½, in frame ¾
    landmarks[15, :] = [256, 128, 0, 0, math.log(3)]
    landmarks[34, :2] = [128, 25.6]
    world[15] = [1, 0, 0.5]
    world[[23, 24]] = [[0.1, 0.02, 0], [-0.1, 0.02, 0]]
    region = Region((100.0, 60.0), 40.0, math.pi / 2)
    estimate = interpret(landmarks.ravel(), 0.8, heatmaps, world.ravel(), region)
    # the crop's right is down
    np.testing.assert_allclose(estimate.keypoints_px[15], [100, 80], atol=1e-9)
    np.testing.assert_allclose(estimate.keypoints_px[0], [100, 60], atol=1e-9)
    assert estimate.keypoints_confidence[15] == pytest.approx(0.5 * 0.75)
    np.testing.assert_allclose(estimate.world_landmarks[15], [0.02, 1, 0.5], atol=1e-6)
    np.testing.assert_allclose(estimate.world_landmarks[[23, 24]].mean(axis=0), 0, atol=1e-9)
    assert estimate.presence == 0.8
    assert estimate.next_region.rotation == pytest.approx(math.pi / 2)
    assert estimate.next_region.side_px == pytest.approx(40.0)


def test_refine_takes_the_centroid_of_hot_cells_only() -> None:
    heatmaps = np.full((3, 64, 64), -30.0, np.float32)
    heatmaps[0, 31, 33:35] = 30  # two full cells
    heatmaps[1, 31, 33] = -0.1  # lukewarm
    heatmaps[2, 0, 0] = 30
    points = np.array([[0.51, 0.5], [0.51, 0.5], [-0.2, 1.7]])
    refined = refine(points, heatmaps)
    np.testing.assert_allclose(refined[0], [33.5 / 64, 31 / 64], atol=1e-9)
    np.testing.assert_array_equal(refined[1:], points[1:])


@pytest.mark.parametrize("camera", [1, 3])
def test_agrees_with_measured_ground_truth(
    network: LandmarkNetwork, first_frame: Callable[..., np.ndarray], shared: Path, camera: int
) -> None:
    """x right, y down, z away from the camera, left is the person's left: any other convention has
    large errors.
    """
    truth = np.load(shared / "data" / "pose2sim" / f"truth_cam{camera}.npz")
    row = 10
    image = first_frame(f"pose2sim/cam{camera}", skip=int(truth["frame_index"][row]))
    detections = PersonDetector(threads=1).detect(image)
    (first,) = network.estimate(image, [max(detections, key=lambda d: d.region.side_px).region])
    (estimate,) = network.estimate(image, [first.next_region])
    columns = [list(truth["names"]).index(name) for name in TRUTH_NAMES]
    numbers = [KEYPOINT_NAMES.index(name) for name in TRUTH_NAMES.values()]
    joints = truth["joints"][row, columns]
    uv = truth["uv"][row, columns]
    height = np.nanmax(uv[:, 1]) - np.nanmin(uv[:, 1])
    distance_px = np.linalg.norm(estimate.keypoints_px[numbers] - uv, axis=1)
    assert np.nanmedian(distance_px) < 0.04 * height
    ours = estimate.world_landmarks[numbers]
    errors = {
        signs: np.nanmean(
            np.linalg.norm(ours * signs - (joints - joints[6:8].mean(axis=0)), axis=1)
        )
        for signs in [(1, 1, 1), (1, 1, -1), (-1, 1, 1), (-1, 1, -1)]
    }
    assert errors[1, 1, 1] < 0.17
    assert errors[1, 1, 1] == min(errors.values())


def test_batch_equals_one_by_one_and_follows_the_rotation(
    network: LandmarkNetwork, first_frame: Callable[[str], np.ndarray]
) -> None:
    image = first_frame("clips/squats_5fps")
    upright = PersonDetector(threads=1).detect(image)[0].region
    turned = Region(upright.center_px, upright.side_px, upright.rotation + math.radians(8))
    both = network.estimate(image, [upright, turned])
    (alone,) = network.estimate(image, [turned])
    np.testing.assert_allclose(both[1].keypoints_px, alone.keypoints_px, atol=0.05)
    np.testing.assert_allclose(both[1].world_landmarks, alone.world_landmarks, atol=1e-4)
    # the same person whichever way the square is turned
    assert (
        np.median(np.linalg.norm(both[0].keypoints_px - both[1].keypoints_px, axis=1))
        < 0.02 * upright.side_px
    )
    assert (
        np.median(np.linalg.norm(both[0].world_landmarks - both[1].world_landmarks, axis=1)) < 0.06
    )
    assert network.estimate(image, []) == []


def test_unknown_quality_lists_the_presets() -> None:
    with pytest.raises(UsageError, match="fast, balanced, best"):
        landmark_network_name("superb")


def test_mask_covers_the_person_alone(network: LandmarkNetwork) -> None:
    """The true body of the sample clip's first frame, drawn into the region, covers what the
    network calls a person.
    """
    cv2 = package("cv2")
    with np.load(SAMPLE / "sample_truth.npz") as truth:
        joints = truth["joints_cam"][0]
        K = truth["intrinsics"]
    _, image = cv2.VideoCapture(str(SAMPLE / "sample.mp4")).read()
    pixels = (joints @ K.T)[:, :2] / (joints @ K.T)[:, 2:]
    low = pixels.min(axis=0)
    high = pixels.max(axis=0)
    center = (low + high) / 2
    height = float((high - low)[1])
    region = Region((float(center[0]), float(center[1])), 1.6 * height, 0.0)
    rgb = np.ascontiguousarray(image[:, :, ::-1])
    mask = network.mask(rgb, region)
    assert mask.shape == (256, 256)
    at = np.rint(region.crop_from_image(pixels) * 256 - 0.5).astype(int)
    assert mask[at[:, 1], at[:, 0]].mean() > 0.9
    assert mask[:, :20].mean() < 0.05
    assert mask[:, -20:].mean() < 0.05
    assert 0.05 < (mask > 0.5).mean() < 0.4
    (alone,) = network.estimate(rgb, [region])
    (masked,) = network.estimate(rgb, [region], with_masks=True)
    assert alone.mask is None
    assert masked.mask is not None
    np.testing.assert_allclose(masked.mask, mask, atol=1e-3)
    np.testing.assert_array_equal(masked.keypoints_px, alone.keypoints_px)
