# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length from fits: the body itself in front of known cameras, and our own clip with
exact ground truth.
"""

from __future__ import annotations

import time

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import assumed_camera, choose_camera
from scope.scope_addon.capture.fitting.focal_length import FocalFits, camera_by_fits
from scope.scope_addon.capture.fitting.keypoint_offsets import with_keypoint_offsets
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.lifter import HIPS
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.cli import SAMPLE
from scope.solver.rotations import exp

WIDTH = 1080
HEIGHT = 1920
ASSUMED = assumed_camera(WIDTH, HEIGHT, float(HEIGHT))
POSES = [  # axis-angle of joints; arms and legs reach towards the camera and away from it
    {
        "left_hip": [-1.2, 0, 0],
        "left_knee": [0.6, 0, 0],
        "right_shoulder": [0, 1.2, 0],
        "left_shoulder": [0, 0, -1.2],
    },
    {
        "right_hip": [-0.8, 0, 0.3],
        "left_hip": [0.5, 0, 0],
        "left_shoulder": [0, -1.4, 0],
        "spine1": [0.4, 0, 0],
    },
    {"left_shoulder": [0, 0.9, -0.5], "right_shoulder": [0, 1.4, 0.3], "right_hip": [0.7, 0, 0]},
]


def observe(body, pose, ratio: float, distance_m: float, pitch: float = 0.35) -> Observation:
    """The body seen by a camera with ``ratio`` times the assumed focal length that looks down on
    it.
    """
    rotations = np.tile(np.eye(3), (body.K + 1, 1, 1))
    rotations[0] = exp([pitch, 0, 0]) @ np.diag([1.0, -1.0, -1.0])
    for joint, vector in pose.items():
        rotations[body.joint_names.index(joint)] = exp(np.array(vector, float))
    R, t = body.forward_kinematics(rotations, np.array([0, 0, distance_m]), np.zeros(body.P))
    at = body.keypoint_set("blazepose")
    points = with_keypoint_offsets(body).keypoints(R, t, np.zeros(body.P))[
        [at[name] for name in KEYPOINT_NAMES]
    ]
    pixels = (
        points[:, :2] / points[:, 2:] * ratio * ASSUMED.intrinsics[0, 0] + ASSUMED.intrinsics[:2, 2]
    )
    region = Region((WIDTH / 2, HEIGHT / 2), float(HEIGHT), 0.0)
    return Observation(
        pixels, np.ones(len(points)), points - points[HIPS].mean(0), 1.0, region, acquired=True
    )


def found(body, ratio: float, distance_m: float):
    fits = FocalFits(body)
    costs = []
    for pose in POSES:
        cost = fits.costs(observe(body, pose, ratio, distance_m), ASSUMED)
        assert cost is not None
        costs.append(cost)
    return camera_by_fits(ASSUMED, ASSUMED, costs, float(HEIGHT))


def test_a_nearby_person_determines_the_focal_length(body):
    """At 1.3 m and half the focal length, a person is as large in the image as at 2.6 m and the
    full one.
    """
    ratios = [0.6, 1.0, 1.6]
    log_f = [
        np.log(found(body, ratio, 2.2 * ratio).intrinsics[0, 0] / ASSUMED.intrinsics[0, 0])
        for ratio in ratios
    ]
    assert log_f[0] < log_f[1] - 0.1 < log_f[2] - 0.2
    before = np.log(ratios)
    after = np.log(ratios) - log_f
    assert np.square(after).mean() < 0.7 * np.square(before).mean()


def test_a_distant_person_does_not_change_the_focal_length(body):
    camera = found(body, 8.0, 60.0)
    assert abs(np.log(camera.intrinsics[0, 0] / ASSUMED.intrinsics[0, 0])) < 0.15
    assert 0.2 < camera.focal_deviation <= 0.25


def test_a_more_certain_estimate_from_edges_weighs_more(body):
    costs = [FocalFits(body).costs(observe(body, POSES[0], 0.6, 1.3), ASSUMED)]
    sure = camera_by_fits(ASSUMED, ASSUMED, costs, float(HEIGHT))
    by_edges = type(ASSUMED)(ASSUMED.intrinsics, ASSUMED.dist, "estimated", 0.03)
    both = camera_by_fits(by_edges, ASSUMED, costs, float(HEIGHT))
    assumed_px = ASSUMED.intrinsics[0, 0]
    assert sure.intrinsics[0, 0] < 0.95 * assumed_px
    assert both.intrinsics[0, 0] == pytest.approx(assumed_px, rel=0.03)
    assert both.focal_deviation == pytest.approx(0.03, rel=0.05)
    assert camera_by_fits(by_edges, ASSUMED, [], float(HEIGHT)) is by_edges


@pytest.mark.parametrize(
    ("seconds", "least", "most"), [(0.01, 1, 1), (1.5, 3, 5), (60.0, 7, 10), (3600.0, 13, 16)]
)
def test_an_hour_takes_few_more_fits_than_a_minute(body, seconds, least, most):
    fits = FocalFits(body)
    due = [k for k in range(int(30 * seconds) + 1) if fits.is_due(7.0 + k / 30)]
    assert due[0] == 0
    assert least <= len(due) <= most


def test_an_observation_that_is_not_finite_has_no_costs(body):
    observation = observe(body, POSES[0], 1.0, 3.0)
    observation.keypoints_px[3] = np.nan
    assert FocalFits(body).costs(observation, ASSUMED) is None


def test_a_given_focal_length_is_not_estimated(body, monkeypatch):
    def never(*_):
        raise AssertionError("a fit of a camera that is known")

    monkeypatch.setattr(FocalFits, "costs", never)
    options = CaptureOptions(quality="fast", fov_deg=40.0, wanted=VideoRange(0, 0.2))
    result = capture(SAMPLE, body, options)
    assert result.report.camera == "given, 40 degrees"
    assert result.report.focal_deviation == 0.0


def test_fits_in_a_slow_thread_are_waited_for(body, monkeypatch):
    options = CaptureOptions(quality="fast", wanted=VideoRange(0, 0.5))
    quick = capture(SAMPLE, body, options)
    costs = FocalFits.costs

    def slow(self, observation, camera):
        time.sleep(0.3)
        return costs(self, observation, camera)

    monkeypatch.setattr(FocalFits, "costs", slow)
    slowly = capture(SAMPLE, body, options)
    np.testing.assert_array_equal(slowly.motions[0].intrinsics, quick.motions[0].intrinsics)
    np.testing.assert_array_equal(slowly.motions[0].poses, quick.motions[0].poses)
    assumed = choose_camera(640, 362).intrinsics[0, 0]
    truth = np.load(SAMPLE.with_name("sample_truth.npz"))["intrinsics"][0, 0]
    estimate = quick.report.focal_px
    assert abs(np.log(estimate / truth)) < abs(np.log(assumed / truth))
