# SPDX-License-Identifier: GPL-3.0-or-later
"""Both fits of a track work from one preparation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scope.scope_addon.capture import fitting
from scope.scope_addon.capture.camera import choose_camera
from scope.scope_addon.capture.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.lifter import Lifted, Lifter
from scope.scope_addon.capture.placement import place_track
from scope.scope_addon.capture.seen_keypoints import as_seen
from scope.scope_addon.capture.track import Track
from scope.solver import load_body
from scope.solver.rotations import exp

FRAMES = 4


def _standing_track(body, camera, bent=()) -> Track:
    """A person in the rest pose, but for ``bent`` (joint, radians about x), upright, 4 m in front of the camera."""
    flip = np.diag([1.0, -1.0, -1.0])  # body y up, OpenCV y down
    rotations = np.tile(np.eye(3), (1, body.K + 1, 1, 1))
    rotations[:, 0] = flip
    for joint, angle in bent:
        rotations[:, body.joint_names.index(joint)] = exp(np.array([angle, 0.0, 0.0]))
    R, t = body.forward_kinematics(rotations, np.array([[0.0, 0.0, 4.0]]), np.zeros(body.P))
    at = body.keypoint_set("blazepose")
    points = as_seen(body).keypoints(R, t, np.zeros(body.P))[0, [at[name] for name in KEYPOINT_NAMES]]
    pixels = points[:, :2] / points[:, 2:] * camera.intrinsics[0, 0] + camera.intrinsics[:2, 2]
    hips = [KEYPOINT_NAMES.index(f"{side}_hip") for side in ("left", "right")]
    J = len(KEYPOINT_NAMES)
    return Track(
        frames=np.arange(FRAMES),
        times=np.arange(FRAMES) / 30.0,
        keypoints_px=np.tile(pixels, (FRAMES, 1, 1)),
        confidence=np.ones((FRAMES, J)),
        world_landmarks=np.tile(points - points[hips].mean(0), (FRAMES, 1, 1)),
        seen=np.ones(FRAMES, bool),
        acquired=np.arange(FRAMES) == 0,
    )


def test_the_lifting_network_runs_once_for_both_fits(monkeypatch):
    body, camera = load_body("scope"), choose_camera(1080, 1920)
    track = _standing_track(body, camera)
    lifts = []

    lift_both_ways = Lifter.lift_both_ways

    def counted(self, *arguments):
        lifts.append(1)
        return lift_both_ways(self, *arguments)

    monkeypatch.setattr(Lifter, "lift_both_ways", counted)
    prepared = fitting.prepare_track(body, track, camera)
    first = fitting.fit_track(prepared, lambda *_: None)
    second = fitting.refit_track(prepared, first, first.t_camera_root, lambda *_: None)
    assert len(lifts) == 1
    np.testing.assert_array_equal(second.betas, first.betas)
    placed = place_track(body, track, second, smoothing=False)
    np.testing.assert_allclose(placed.joints[:, 0], second.t_camera_root, atol=1e-9)
    assert abs(placed.joints[:, 0, 2].mean() - 4.0) < 0.6  # metres; one view tells the distance by the body's size


def test_who_is_nearer_than_it_seemed_is_smaller():
    """A floor that others stand on tells the distance, and with it the size: the picture stays the same."""
    body, camera = load_body("scope"), choose_camera(1080, 1920)
    prepared = fitting.prepare_track(body, _standing_track(body, camera), camera)
    first = fitting.fit_track(prepared, lambda *_: None)

    def leg(fit):
        J = body.rest_joints(fit.betas)
        return np.linalg.norm(J[body.joint_names.index("left_hip")] - J[body.joint_names.index("left_ankle")])

    for nearer in (0.85, 1.1):
        second = fitting.refit_track(prepared, first, nearer * first.t_camera_root, lambda *_: None)
        moved = second.t_camera_root[:, 2].mean() / first.t_camera_root[:, 2].mean()
        assert abs(moved / nearer - 1) < 0.05
        assert abs(leg(second) / leg(first) / moved - 1) < 0.03


def test_a_limb_goes_where_it_is_seen_to_go_for_sure_and_was_there_before():
    """A leg before the body looks as one behind it, and the first frames are believed to show the wrong one."""
    body, camera = load_body("scope"), choose_camera(1080, 1920)
    track = _standing_track(body, camera, (("right_hip", 0.3), ("right_knee", 0.9)))
    prepared = fitting.prepare_track(body, track, camera)
    leg = [KEYPOINT_NAMES.index(f"right_{name}") for name in ("knee", "ankle", "heel", "foot_index")]
    hip = KEYPOINT_NAMES.index("right_hip")
    truth, sigma = track.world_landmarks.copy(), np.full((FRAMES, len(KEYPOINT_NAMES)), 0.1)
    lifted = truth.copy()
    lifted[:2, leg, 2] = 2 * truth[:2, hip, None, 2] - truth[:2, leg, 2]  # the leg's mirror image in depth
    sigma[:2, leg] = 0.25
    prepared = replace(prepared, lifted=Lifted(lifted, sigma, sigma))

    first = fitting.fit_track(prepared, lambda *_: None)
    for fit in (first, fitting.refit_track(prepared, first, first.t_camera_root, lambda *_: None)):
        joints = place_track(body, track, fit, smoothing=False).joints
        for joint in ("knee", "ankle"):
            k, at_hip = (body.joint_names.index(f"right_{name}") for name in (joint, "hip"))
            i = KEYPOINT_NAMES.index(f"right_{joint}")
            there = truth[:, i, 2] - truth[:, hip, 2]
            np.testing.assert_allclose(joints[:, k, 2] - joints[:, at_hip, 2], there, atol=0.2)
