# SPDX-License-Identifier: GPL-3.0-or-later
"""All fits of a track, from one preparation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.fitting import track_fit
from scope.scope_addon.capture.fitting.frame_sequence import FittedTrack
from scope.scope_addon.capture.fitting.prepared_track import Stance, prepare_track
from scope.scope_addon.capture.perception.face_landmarks import FACE_POINTS, FaceEstimate
from scope.scope_addon.capture.perception.face_record import record
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.lifter import Lifted
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.several_views.bundle import CameraPlace
from scope.scope_addon.capture.several_views.person_in_views import other_view
from scope.scope_addon.capture.tracking.expression_fit import load_response
from scope.scope_addon.capture.tracking.track import Track
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.capture.world.clip_fit import fit_clip
from scope.scope_addon.capture.world.placement import place_track
from scope.scope_addon.live.causal_fit import CausalFit
from scope.solver import load_body
from scope.solver.rotations import exp

from ..exact_tracks import network_points, track_of_points

FRAMES = 4
CAMERA = choose_camera(1080, 1920)
LEG = [KEYPOINT_NAMES.index(f"right_{name}") for name in ("knee", "ankle", "heel", "foot_index")]
FEET = np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0])  # stand, and hands do not


def _standing_track(body, bent=()) -> Track:
    """A person upright, 4 m in front of the camera, in the rest pose except for ``bent`` (joint,
    radians about x).
    """
    rotations = np.tile(np.eye(3), (body.K + 1, 1, 1))
    rotations[0] = np.diag([1.0, -1.0, -1.0])  # body y up, OpenCV y down
    for joint, angle in bent:
        rotations[body.joint_names.index(joint)] = exp(np.array([angle, 0.0, 0.0]))
    pose = body.forward_kinematics(rotations, np.array([0.0, 0.0, 4.0]), np.zeros(body.P))
    points = np.tile(network_points(body, *pose), (FRAMES, 1, 1))
    return track_of_points(points, CAMERA.intrinsics)


def _stance(fit: FittedTrack, contact: float = 0.0, floor_m: float = 0.0) -> Stance:
    """The fitted pelvis, and a floor ``floor_m`` below the camera with this contact probability of
    the feet.
    """
    return Stance(
        root_cam=fit.t_camera_root,
        turn=np.tile(np.eye(3), (FRAMES, 1, 1)),
        floor_normal=np.tile([0.0, -1.0, 0.0], (FRAMES, 1)),
        floor_offset=np.full(FRAMES, -floor_m),
        contact=np.full((FRAMES, 6), contact) * FEET,
        resting=np.full((FRAMES, 6), contact) * FEET,
    )


def _refit(prepared, first, stance) -> FittedTrack:
    """All frames together, with the stance as a measurement, and then each alone."""
    measured, start = track_fit.grounded(prepared, first, stance)
    finished = fit_clip(measured, start, CameraPath.static(FRAMES), lambda *_: None)
    return track_fit.fit_each_frame(measured, finished, lambda *_: None)


def test_a_child_is_lifted_in_its_size():
    """The same pixels of a person of 1.1 m: of a size that no person had whom the lifting network
    was trained on.
    """
    body = load_body("scope_child")
    prepared = prepare_track(body, _standing_track(body), CAMERA, height_m=1.1)
    ends = [KEYPOINT_NAMES.index(f"left_{joint}") for joint in ("hip", "knee", "ankle")]
    leg = np.linalg.norm(np.diff(prepared.lifted.points[:, ends], axis=1), axis=2).sum(axis=1)
    rest = body.rest_joints()[
        [body.joint_names.index(f"left_{joint}") for joint in ("hip", "knee", "ankle")]
    ]
    true = 1.1 / 1.695 * np.linalg.norm(np.diff(rest, axis=0), axis=1).sum()
    np.testing.assert_allclose(leg, true, rtol=0.1)


def test_another_camera_lifts_a_child_in_its_size_too():
    body = load_body("scope_child")
    track = _standing_track(body)
    prepared = prepare_track(body, track, CAMERA, height_m=1.1)
    other = other_view(prepared, track, CAMERA, CameraPlace.first())
    np.testing.assert_array_equal(other.lifted.points, prepared.lifted.points)


def test_a_live_capture_finds_a_child_who_sits_at_its_distance():
    body = load_body("scope_child")
    track = _standing_track(body, [("left_hip", -1.5), ("right_hip", -1.5)])
    priors = prepare_track(body, track, CAMERA, height_m=0.85).priors
    observation = Observation(
        track.keypoints_px[0],
        track.confidence[0],
        track.world_landmarks[0],
        1.0,
        Region((540.0, 960.0), 1000.0, 0.0),
        acquired=True,
    )
    live = CausalFit(body, observation, CAMERA, height_m=0.85)
    live.set_shape(priors.shape_mean)
    fitted = live.fit(0.0, observation)
    assert fitted is not None
    # The person whom the picture shows at 4 m has the mean body's stature.
    assert fitted.root_cam[2] == pytest.approx(4.0 * 0.85 / body.stature(), rel=0.05)


def test_a_person_nearer_than_first_estimated_is_smaller(body):
    """The floor that others stand on determines the distance, and so the size; the image stays the
    same.
    """
    prepared = prepare_track(body, _standing_track(body), CAMERA)
    first = track_fit.fit_track(prepared, lambda *_: None)

    def leg(fit):
        J = body.rest_joints(fit.betas)
        return np.linalg.norm(
            J[body.joint_names.index("left_hip")] - J[body.joint_names.index("left_ankle")]
        )

    for nearer in (0.85, 1.1):
        stance = replace(_stance(first), root_cam=nearer * first.t_camera_root)
        second = _refit(prepared, first, stance)
        moved = second.t_camera_root[:, 2].mean() / first.t_camera_root[:, 2].mean()
        assert abs(moved / nearer - 1) < 0.05
        assert abs(leg(second) / leg(first) / moved - 1) < 0.03


def test_a_head_leans_as_its_face_does_although_the_bodys_keypoints_say_that_it_is_upright(body):
    lean_deg = 15.0
    track = _standing_track(body)
    response = load_response()
    face = 30.0 * response.reference @ exp(np.radians([0.0, 0.0, lean_deg])).T * [1, -1, -1]
    landmarks = np.tile([*track.keypoints_px[0, :11].mean(axis=0), 0.0], (FACE_POINTS, 1))
    landmarks[response.landmarks] += face
    row = record(FaceEstimate(landmarks, 1.0, Region((0.0, 0.0), 1.0, 0.0)))
    for each, expected in (
        (track, 0.0),
        (replace(track, face=np.tile(row, (FRAMES, 1))), lean_deg),
    ):
        prepared = prepare_track(body, each, CAMERA)
        first = track_fit.fit_track(prepared, lambda *_: None)
        for fit in (first, _refit(prepared, first, _stance(first))):
            R = body.forward_kinematics(fit.rotations, fit.t_camera_root, fit.betas)[0][
                :, body.joint_names.index("head")
            ]
            lean = np.degrees(np.arctan2(-R[:, 1, 0], R[:, 0, 0]))
            np.testing.assert_allclose(lean, expected, atol=4)


def test_a_confident_direction_corrects_a_limb_in_earlier_frames_as_well(body):
    """A leg in front of the body looks like one behind it, and the first frames are lifted to the
    wrong one.
    """
    track = _standing_track(body, (("right_hip", 0.15), ("right_knee", 0.9)))
    prepared = prepare_track(body, track, CAMERA)
    hip = KEYPOINT_NAMES.index("right_hip")
    truth = track.world_landmarks.copy()
    sigma = np.full((FRAMES, len(KEYPOINT_NAMES)), 0.1)
    lifted = truth.copy()
    # the leg's mirror image in depth
    lifted[:2, LEG, 2] = 2 * truth[:2, hip, None, 2] - truth[:2, LEG, 2]
    sigma[:2, LEG] = 0.25
    prepared = replace(prepared, lifted=Lifted(lifted, sigma, sigma))

    first = track_fit.fit_track(prepared, lambda *_: None)
    for fit in (first, _refit(prepared, first, _stance(first))):
        joints = place_track(body, track, fit, smoothing=False).joints
        for joint in ("knee", "ankle"):
            k, at_hip = (body.joint_names.index(f"right_{name}") for name in (joint, "hip"))
            i = KEYPOINT_NAMES.index(f"right_{joint}")
            there = truth[:, i, 2] - truth[:, hip, 2]
            np.testing.assert_allclose(joints[:, k, 2] - joints[:, at_hip, 2], there, atol=0.2)


def test_a_leg_at_a_wrong_depth_moves_to_the_floor_only_while_in_contact(body):
    """Seen from above, a foot lifted too near is in the air; the image alone does not show this."""
    down = exp(np.array([0.35, 0.0, 0.0]))  # the camera looks down on the person
    landmarks = _standing_track(body).world_landmarks
    track = track_of_points(landmarks @ down.T + [0.0, 0.0, 4.0], CAMERA.intrinsics)
    up = down @ [0.0, -1.0, 0.0]
    prepared = prepare_track(body, track, CAMERA)
    lifted = track.world_landmarks.copy()
    sigma = np.full((FRAMES, len(KEYPOINT_NAMES)), 0.1)
    good = track_fit.fit_track(
        replace(prepared, lifted=Lifted(lifted.copy(), sigma, sigma)), lambda *_: None
    )
    floor_m = (place_track(body, track, good, smoothing=False).soles @ up).min(axis=1)
    lifted[:, LEG, 2] -= [0.2, 0.4, 0.4, 0.4]
    prepared = replace(prepared, lifted=Lifted(lifted, sigma, sigma))
    first = track_fit.fit_track(prepared, lambda *_: None)

    def heights(fit):
        return (place_track(body, track, fit, smoothing=False).soles @ up - floor_m[:, None])[:, 2:]

    assert heights(first).min() > 0.05
    stance = replace(_stance(good), floor_normal=np.tile(up, (FRAMES, 1)), floor_offset=floor_m)
    free = _refit(prepared, first, stance)
    assert heights(free).min() > 0.03
    standing = replace(
        stance, contact=np.full((FRAMES, 6), 0.9) * FEET, resting=np.full((FRAMES, 6), 0.9) * FEET
    )
    held = _refit(prepared, first, standing)
    assert np.abs(heights(held)).max() < 0.025
    placed, true = (place_track(body, track, fit, smoothing=False).joints for fit in (held, good))
    ankle = body.joint_names.index("right_ankle")
    before = place_track(body, track, first, smoothing=False).joints
    wrong = np.abs(before - true)[:, ankle, 2]
    assert (np.abs(placed - true)[:, ankle, 2] < 0.6 * wrong).all()
