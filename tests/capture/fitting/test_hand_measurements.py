# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands in the solver: the fingers of a known pose are recovered; unseen fingers move smoothly."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.fitting.frame_measurements import Measurer
from scope.scope_addon.capture.fitting.hand_measurements import (
    FINGERS,
    HAND_KEYPOINT_NAMES,
    HandMeasurer,
    finger_joints,
    reliability,
    smooth_fingers,
    with_finger_limits,
)
from scope.scope_addon.capture.fitting.weights import ROBUST, WEIGHTS, cold_stages
from scope.scope_addon.capture.perception.hand_landmarks import HAND_NAMES, HAND_POINTS
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.left_right import MIRROR_PARTNER, repair_left_right
from scope.scope_addon.capture.tracking.track import Tracklet, make_track
from scope.solver import (
    State,
    default_priors,
    fit,
    load_body,
)
from scope.solver.rotations import exp, log

from ...solver.residuals.references import joint_limits

K = np.array([[1200.0, 0, 640], [0, 1200, 360], [0, 0, 1]])
SIDES = ("left", "right")
WALKER = np.random.default_rng(3).standard_normal((33, 3))


@pytest.fixture(scope="module")
def body():
    return load_body("scope_h")


def somebody(body, grips) -> State:
    """Arms half raised towards the camera; every finger joint bends by the hand's grip, in
    radians.
    """
    Omega = np.tile(np.eye(3), (body.K, 1, 1))
    for side, sign, grip in zip(SIDES, (1.0, -1.0), grips, strict=True):
        at = {name: body.joint_names.index(f"{side}_{name}") - 1 for name in ("shoulder", "elbow")}
        Omega[at["shoulder"]] = exp([0.0, -0.5 * sign, -0.9 * sign])
        Omega[at["elbow"]] = exp([0.0, -1.0 * sign, 0.0])
        for joint in finger_joints(body, side)[:12]:
            Omega[joint - 1] = exp([0.0, 0.0, -grip * sign])
    R_camera_root = np.diag([1.0, -1.0, -1.0]) @ exp([0.0, 0.3, 0.0])
    return State(R_camera_root, np.array([0.3, 0.1, 2.5]), Omega, np.zeros(body.P))


def part_poses(body, state):
    R = np.concatenate([state.R_camera_root[None], state.Omega])
    t = state.t_camera_root - body.rest_joints(state.beta)[0]
    return body.forward_kinematics(R, t, state.beta)


def points_of(body, state):
    return body.keypoints(*part_poses(body, state), state.beta)


def joints_of(body, state):
    return part_poses(body, state)[1]


def line_of_sight(points):
    """(3, 3) rotation from camera axes to axes that look at the centre of the points, without
    roll.
    """
    z = points.mean(axis=0) / points[:, 2].mean()
    z = z / np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def hands_of(body, points):
    """(2, 21, 7) the output of a perfect network for both hands: world landmarks in the axes of the
    line of sight.
    """
    hands = np.zeros((2, HAND_POINTS, 7))
    for side, name in enumerate(SIDES):
        at = [
            body.keypoint_names.index(n)
            for n in HAND_KEYPOINT_NAMES
            if n.startswith(f"hand/{name}")
        ]
        p = points[at]
        pixels = p @ K.T
        hands[side, :, :2] = pixels[:, :2] / pixels[:, 2:]
        hands[side, :, 2] = 1.0
        hands[side, :, 3:6] = (p - p.mean(axis=0)) @ line_of_sight(p).T
    return hands


def measure(body, points, hands):
    at = body.keypoint_set("blazepose")
    p = points[[at[n] for n in KEYPOINT_NAMES]]
    hips = [KEYPOINT_NAMES.index(f"{side}_hip") for side in SIDES]
    pixels = p @ K.T
    n = len(p)
    measured = Measurer(body, K).measure(
        pixels[:, :2] / pixels[:, 2:], np.ones(n), p - p[hips].mean(axis=0), np.full(n, 0.05)
    )
    return measured if hands is None else HandMeasurer(body, K).add(measured, hands)


def fitted(body, measured):
    priors = with_finger_limits(replace(default_priors(body), joint_weights=np.ones(body.K)), body)
    return fit(body, measured, priors=priors, options=replace(ROBUST, stages=cold_stages(WEIGHTS)))


def bends(body, Omega, side):
    """(12,) flexion of each finger joint in radians: its rotation vector's component about the
    body's z axis.
    """
    sign = -1.0 if side == "left" else 1.0
    return sign * log(Omega[np.array(finger_joints(body, side)[:12]) - 1])[:, 2]


def test_the_fingers_of_a_known_pose_are_recovered(body):
    truth = somebody(body, grips=(0.8, 0.3))
    points = points_of(body, truth)
    found = fitted(body, measure(body, points, hands_of(body, points)))
    for side, grip in zip(SIDES, (0.8, 0.3), strict=True):
        assert np.abs(bends(body, found.state.Omega, side) - grip).mean() < 0.12
        joints = finger_joints(body, side)
        t = joints_of(body, truth)
        wrist = body.joint_names.index(f"{side}_wrist")
        ours = found.t_camera_part[joints] - found.t_camera_part[wrist]
        assert np.linalg.norm(ours - (t[joints] - t[wrist]), axis=1).mean() < 0.008  # metres


def test_a_hand_that_is_not_seen_adds_no_measurements(body):
    points = points_of(body, somebody(body, grips=(0.8, 0.8)))
    hands = hands_of(body, points)
    hands[1] = 0.0
    measured = measure(body, points, hands)
    plain = measure(body, points, None)
    names = np.array(body.keypoint_names)[measured.keypoints2d.indices]
    assert not any(name.startswith("hand/right") for name in names)
    assert HandMeasurer(body, K).add(plain, np.zeros_like(hands)) is plain
    found = fitted(body, measured)
    assert np.abs(bends(body, found.state.Omega, "right")).max() < 0.1  # the prior's rest
    assert bends(body, found.state.Omega, "left").mean() > 0.6


def test_the_palm_determines_the_wrists_rotation(body):
    truth = somebody(body, grips=(0.2, 0.2))
    wrist = body.joint_names.index("left_wrist")
    truth.Omega[wrist - 1] = exp([0.7, 0.0, 0.3])
    points = points_of(body, truth)
    found = fitted(body, measure(body, points, hands_of(body, points)))
    R = part_poses(body, truth)[0][wrist]
    assert np.linalg.norm(log(R.T @ found.R_camera_part[wrist])) < 0.2


def test_limits_let_fingers_bend_towards_the_palm_only(body):
    ints, floats = with_finger_limits(default_priors(body), body).limits
    at = {int(joint): row for joint, row in zip(ints[:, 0], floats, strict=True)}
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
        for joint in finger_joints(body, side)[:12]:
            row = at[joint]
            for angle, allowed in ((1.2, True), (-0.9, False)):
                turned = SimpleNamespace(Omega=exp([0.0, 0.0, sign * angle]))
                r = joint_limits(turned, row[:3], row[3], row[4], row[5], row[6], 0.0)
                assert (abs(r[0]) < 1e-9) == allowed, body.joint_names[joint]


def test_unseen_fingers_are_interpolated_over_short_gaps_and_rest_in_long_ones(body):
    T = 240
    times = np.arange(T) / 30.0
    rotations = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    fingers = [finger_joints(body, side) for side in SIDES]
    rotations[:, fingers[0]] = exp([0.0, 0.0, -1.0])
    seen = np.ones((T, 2), bool)
    seen[10:14, 0] = seen[60:200, 0] = False
    seen[:, 1] = False
    rotations[~seen[:, 0]] = np.eye(3)
    calm = smooth_fingers(rotations, fingers, seen, times)
    bend = -log(calm[:, fingers[0]])[..., 2]
    assert np.allclose(bend[10:14], 1.0)
    assert np.allclose(bend[95:165], 0.0, atol=1e-9)
    assert np.allclose(bend[seen[:, 0]], 1.0)
    assert np.abs(np.diff(bend, axis=0)).max() < 0.1  # radians a frame
    assert np.allclose(calm[:, fingers[1]], np.eye(3))
    others = np.setdiff1d(np.arange(body.K + 1), sum(fingers, []))
    assert np.array_equal(calm[:, others], rotations[:, others])


def test_fingers_of_a_long_clip_take_no_more_memory_than_the_clip(body):
    T = 4000
    rotations = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    seen = np.tile((np.arange(T) % 2 == 0)[:, None], (1, 2))
    fingers = [finger_joints(body, side) for side in SIDES]
    tracemalloc.start()
    smooth_fingers(rotations, fingers, seen, np.arange(T) / 30.0)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 4 * rotations.nbytes


def test_fingers_have_the_confidence_of_the_hand_and_other_joints_none(body):
    hands = np.zeros((3, 2, HAND_POINTS, 7))
    hands[1, 0, :, 2] = 0.8
    confidence = HandMeasurer(body, K).joint_confidence(hands)
    left = [body.joint_names.index(f"left_{finger}2") for finger in FINGERS]
    assert np.allclose(confidence[1, left], 0.8)
    assert confidence[[0, 2]].max() == 0
    assert confidence[:, body.joint_names.index("right_index1")].max() == 0
    assert confidence[:, body.joint_names.index("left_elbow")].max() == 0


def test_tracks_keep_hands_in_their_rows_and_swap_them_with_left_and_right():
    tracklet = Tracklet()
    for row in (1, 2):
        hands = np.zeros((2, HAND_POINTS, 7))
        hands[0] = row
        where = Region((0.0, 0.0), 1.0, 0.0)
        tracklet.add(
            row, Observation(np.zeros((33, 2)), np.ones(33), WALKER, 1.0, where, False, hands=hands)
        )
    track = make_track([0, 1, 2], [0.0, 0.1, 0.2], [tracklet])
    assert [track.hands[k, 0].max() for k in range(3)] == [0, 1, 2]
    assert track.hands.dtype == np.float32  # an hour of one person's take 110 MB
    assert make_track([0], [0.0], [Tracklet()]).hands is None
    # the reference network has left and right swapped in both frames
    landmarks = track.world_landmarks[[1, 2]][:, MIRROR_PARTNER]
    judged = replace(track, reference_rows=np.array([1, 2]), reference_landmarks=landmarks)
    repaired = repair_left_right(judged, choose_camera(640, 480))
    assert repaired.hands[1, 1].max() == 1
    assert repaired.hands[1, 0].max() == 0


def test_directions_of_a_small_hand_or_one_that_is_hardly_present_count_less():
    def weight(presence, size_px):
        hand = np.zeros((HAND_POINTS, 7))
        hand[HAND_NAMES.index("middle_finger_mcp"), :2] = size_px * np.array([0.6, 0.8])
        hand[:, 2] = presence
        return reliability(hand).mean()

    assert weight(0.9, 300.0) == pytest.approx(0.9)
    assert weight(0.9, 100.0) == pytest.approx(0.9)
    assert weight(0.9, 50.0) == pytest.approx(0.9 / 4)
    assert weight(0.3, 100.0) < 0.1 * 0.9
