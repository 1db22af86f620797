# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands and faces come from the camera that sees them best; made people whose truth is exact."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.camera.line_segments import Lines
from scope.scope_addon.capture.fitting.hand_measurements import HAND_KEYPOINT_NAMES, finger_joints
from scope.scope_addon.capture.fitting.keypoint_offsets import with_keypoint_offsets
from scope.scope_addon.capture.perception.face_record import RECORD, parts, with_expression
from scope.scope_addon.capture.perception.hand_landmarks import HAND_POINTS
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.lifter import camera_towards
from scope.scope_addon.capture.reporting import hand_frames
from scope.scope_addon.capture.several_views.best_view import best_camera, with_best_faces
from scope.scope_addon.capture.several_views.bundle import CameraPlace
from scope.scope_addon.capture.several_views.person_in_views import PersonInViews
from scope.scope_addon.capture.solve import solve_people
from scope.scope_addon.capture.world.assemble import Shot
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.solver import load_body
from scope.solver.rotations import exp

from ..exact_tracks import pixels_of, track_of_points

T = 20
K = np.array([[1200.0, 0.0, 640.0], [0.0, 1200.0, 360.0], [0.0, 0.0, 1.0]])
CAMERA = Camera(K, np.zeros(5), "given")
SIDES = ("left", "right")
GRIPS = (0.9, 0.4)  # radians, of every joint of the fingers of the left and the right hand


@pytest.fixture(scope="module")
def body():
    return load_body("scope_h")


MIDDLE = np.array([0.0, 0.0, 3.0])
TURN = exp(np.array([0.0, np.radians(60.0), 0.0]))
BESIDE = CameraPlace(TURN, MIDDLE - TURN @ MIDDLE)  # of a camera that looks from the side


def points_of(body):
    """Return keypoints (n, 3) of somebody with both hands raised, in the first camera's axes."""
    Omega = np.tile(np.eye(3), (body.K + 1, 1, 1))
    Omega[0] = np.diag([1.0, -1.0, -1.0])
    for side, sign, grip in zip(SIDES, (1.0, -1.0), GRIPS, strict=True):
        at = {name: body.joint_names.index(f"{side}_{name}") for name in ("shoulder", "elbow")}
        Omega[at["shoulder"]] = exp(np.array([0.0, -0.5 * sign, -0.9 * sign]))
        Omega[at["elbow"]] = exp(np.array([0.0, -1.0 * sign, 0.0]))
        for joint in finger_joints(body, side)[:12]:
            Omega[joint] = exp(np.array([0.0, 0.0, -grip * sign]))
    root = np.array([0.0, -0.1, 3.0])
    placed = with_keypoint_offsets(body)
    return placed.keypoints(*placed.forward_kinematics(Omega, root - body.rest_joints()[0]))


def track_of(body, points, hand_confidence):
    """Return what a camera sees of keypoints (n, 3) in its axes, the same in all frames.

    :param hand_confidence: of the left and the right hand.
    """
    at = body.keypoint_set("blazepose")
    own = points[[at[name] for name in KEYPOINT_NAMES]]
    hands = np.zeros((T, 2, HAND_POINTS, 7))
    for side, name in enumerate(SIDES):
        names = [n for n in HAND_KEYPOINT_NAMES if n.startswith(f"hand/{name}")]
        of_hand = points[[body.keypoint_names.index(n) for n in names]]
        middle = of_hand.mean(axis=0)
        R_virtual_camera = camera_towards((middle[:2] / middle[2])[None])[0]
        hands[:, side, :, :2] = pixels_of(of_hand, K)
        hands[:, side, :, 2] = hand_confidence[side]
        hands[:, side, :, 3:6] = (of_hand - middle) @ R_virtual_camera.T
    return track_of_points(np.tile(own, (T, 1, 1)), K, hands=hands)


def tracks_of(body, *hand_confidence):
    """Return what both cameras see, with the confidences of both hands in each."""
    points = points_of(body)
    seen = points, BESIDE.of(points)
    return [track_of(body, *each) for each in zip(seen, hand_confidence, strict=True)]


def person_in_views(body, first, second):
    shot = Shot(body, CAMERA, CameraPath.static(T), Lines.none(), Fraction(30), (1280, 720), "made")
    return shot, PersonInViews(shot, first, [(second, CAMERA, BESIDE)], None, lambda *_: None)


@pytest.mark.slow
def test_each_hand_comes_from_the_camera_that_sees_it(body):
    first, second = tracks_of(body, (0.0, 0.9), (0.9, 0.3))
    # What the second camera guesses of the right hand is wrong.
    second.hands[:, 1, :, 3:6] = -second.hands[:, 1, :, 3:6]
    shot, person = person_in_views(body, first, second)
    (motion,) = solve_people(shot, [person]).motions
    assert hand_frames(body, motion) == {"left_hand_frames": T, "right_hand_frames": T}
    # The file has the hands of the first camera's picture.
    at = motion.keypoints2d_names.tolist().index("hand/left_wrist")
    assert not motion.keypoints2d[:, at, 2].any()
    vectors = motion.poses.reshape(T, -1, 3)
    for side, grip in zip(SIDES, GRIPS, strict=True):
        found = np.linalg.norm(vectors[:, finger_joints(body, side)[:12]], axis=2)
        assert np.degrees(abs(found - grip).mean()) < 10.0


def test_what_one_other_camera_sees_counts_as_from_one_camera(body):
    first, second = tracks_of(body, (0.9, 0.9), (0.9, 0.9))
    first.seen[10:] = False
    first.confidence[10:] = 0.0
    prepared = person_in_views(body, first, second)[1].prepared
    (other,) = prepared.others
    _, both = prepared.views(5, prepared.measure(5), False)
    _, alone = prepared.views(15, prepared.measure(15), False)
    assert both.measurements.keypoints3d is None
    whole = other.measure(15)
    np.testing.assert_array_equal(alone.measurements.keypoints3d.points, whole.keypoints3d.points)
    np.testing.assert_array_equal(
        alone.measurements.orientation_field.confidence, whole.orientation_field.confidence
    )


def test_a_hand_does_not_change_between_cameras_that_see_it_equally_well():
    rng = np.random.default_rng(1)
    times = np.arange(120) / 30.0
    scores = 0.8 + rng.normal(0.0, 0.02, (2, 120))
    scores[0, 60:] -= 0.3
    scores[1, :5] = 0.0
    scores[1, 100:103] = 0.0
    best = best_camera(scores, times)
    assert (best[:5] == 0).all()
    assert (best[70:100] == 1).all()
    assert (best[100:103] == 0).all()
    assert np.count_nonzero(np.diff(best)) <= 6


def test_expressions_come_from_the_camera_that_sees_the_face():
    rng = np.random.default_rng(2)
    seen = track_of_points(np.ones((T, 33, 3)), K)
    faces = []
    for weight in (0.1, 0.7):
        rows = rng.uniform(0.0, 1.0, (T, RECORD))
        forward = np.tile([0.0, 0.0, 1.0], (T, 2, 1))
        faces.append(with_expression(rows, np.full((T, 52), weight), forward))
    faces[0][:, 0] = 0.9
    faces[0][10:, 0] = 0.0
    faces[1][:, 0] = 0.5
    faces[1][:10, 0] = 0.0
    tracks = [replace(seen, face=face) for face in faces]
    alone, whole = with_best_faces(tracks)
    confidence, _, weights, _, contours = parts(whole.face)
    np.testing.assert_array_equal(confidence, np.repeat([0.9, 0.5], 10))
    np.testing.assert_array_equal(weights[:, 0], np.repeat([0.1, 0.7], 10))
    np.testing.assert_array_equal(contours, parts(faces[0])[4])
    np.testing.assert_array_equal(alone[0].face[:10], faces[0][:10])
    assert not alone[0].face[10:].any()
    assert not alone[1].face[:10].any()
    np.testing.assert_array_equal(alone[1].face[10:], faces[1][10:])
