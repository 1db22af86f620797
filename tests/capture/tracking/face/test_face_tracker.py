# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces in real footage, and with a fake network: found by the body, followed, lost, and somebody
else's.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.perception.face_landmarks import (
    FACE_POINTS,
    FaceEstimate,
    eye_light,
    region_from_body,
)
from scope.scope_addon.capture.perception.face_record import eye_light_of, parts
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.capture.tracking import face_tracker
from scope.scope_addon.capture.tracking.face_tracker import FaceTracker
from scope.solver.body_file import load_body
from scope.solver.rotations import exp

IMAGE = np.zeros((800, 800, 3), np.uint8)
SHAPE = np.random.default_rng(0).uniform(-0.5, 0.5, (FACE_POINTS, 3))
SHAPE[:2] = [[-0.5] * 3, [0.5] * 3]  # the corners of its box
SHAPE[[33, 263]] = [[-0.3, 0, 0], [0.3, 0, 0]]
SHAPE[[10, 152]] = [[0, -0.5, 0], [0, 0.5, 0]]


def person(x: float, y: float, scale: float = 500.0, yaw: float | None = None) -> Observation:
    """A head with its eyes around (x, y), frontal in the image; its depth says that it is turned by
    ``yaw`` degrees.
    """
    points = np.zeros((33, 2))
    places = {
        "left_eye": (0.03, 0),
        "right_eye": (-0.03, 0),
        "mouth_left": (0.02, 0.068),
        "mouth_right": (-0.02, 0.068),
    }
    for name, offset in places.items():
        points[KEYPOINT_NAMES.index(name)] = offset
    points[[0, 7, 8]] = (0, 0.03), (0.07, 0.01), (-0.07, 0.01)
    world = np.zeros((33, 3))
    if yaw is not None:
        world[:, :2] = points
        world = world @ exp(np.radians([0.0, yaw, 0.0])).T
    points = scale * points + [x, y]
    return Observation(points, np.ones(33), world, 1.0, Region((x, y), 400.0, 0.0), False)


class FakeNetwork:
    """Sees the faces (x, y, size) whose middle is inside the inner half of a region."""

    def __init__(self, *_):
        self.faces = []
        self.calls = 0
        self.presence = 0.01

    def estimate(self, _image, region):
        self.calls += 1
        for x, y, size in self.faces:
            if np.abs(np.subtract((x, y), region.center_px)).max() < region.side_px / 4:
                return FaceEstimate(size * SHAPE + [x, y, 0], 0.99, region)
        return FaceEstimate(region.side_px * SHAPE + [*region.center_px, 0], self.presence, region)


@pytest.fixture
def tracker(monkeypatch):
    monkeypatch.setattr(face_tracker, "FaceNetwork", FakeNetwork)
    return FaceTracker()


def face_of(tracker, people, time_s=0.0):
    return {n: parts(o.face[None]) for n, o in tracker.step(IMAGE, list(people.items()), time_s)}


def middle(x, y, scale=500.0):
    return np.array(region_from_body(person(x, y, scale).keypoints_px).center_px)


def test_a_face_is_found_and_then_followed_with_one_run_of_the_network(tracker):
    tracker._network.faces = [(*middle(300, 200), 92.0)]
    confidence, size, weights, gaze, _ = face_of(tracker, {7: person(300, 200)})[7]
    assert size[0] == pytest.approx(92, abs=1)
    assert confidence[0] > 0
    assert not weights.any()
    assert not gaze.any()  # both are found later, see `with_expressions`
    assert tracker._network.calls == 2
    # farther than it would be seen from where it was
    tracker._network.faces = [(*middle(360, 200), 92.0)]
    assert face_of(tracker, {7: person(360, 200)}, 1 / 30)[7][0][0] > 0
    assert tracker._network.calls == 3


def test_a_face_has_the_light_around_its_eyes(tracker):
    x, y = middle(300, 200)
    tracker._network.faces = [(x, y, 92.0)]
    landmarks = 92.0 * SHAPE[:, :2] + [x, y]
    image = np.random.default_rng(3).integers(100, 200, IMAGE.shape, np.uint8)
    ((_, seen),) = tracker.step(image, [(1, person(300, 200))], 0.0)
    (light,) = eye_light_of(seen.face[None])
    assert light == eye_light(image, landmarks)
    assert light != 1  # which it is where nothing is known


def test_a_lost_face_is_looked_for_less_often(tracker):
    for k in range(60):
        face_of(tracker, {1: person(300, 200)}, k / 30)
    assert 30 < tracker._network.calls < 60  # two runs each: ten eager frames, then every fourth


def test_where_surely_no_face_is_the_landmarks_say_nothing_of_another_place(tracker):
    tracker._network.presence = 1e-4
    face_of(tracker, {1: person(300, 200)})
    assert tracker._network.calls == 1


@pytest.mark.parametrize(
    ("yaw", "is_looked_for"), [(None, True), (0, True), (75, True), (-90, False), (180, False)]
)
def test_a_face_is_looked_for_on_heads_that_the_body_does_not_see_from_the_side_or_the_back(
    tracker, yaw, is_looked_for
):
    tracker._network.faces = [(*middle(300, 200), 92.0)]
    seen = face_of(tracker, {1: person(300, 200, yaw=yaw)})[1][0][0] > 0
    assert seen == is_looked_for
    assert (tracker._network.calls > 0) == is_looked_for


def test_one_face_is_not_that_of_two_people(tracker: FaceTracker) -> None:
    """Of two people whose heads are near each other, one looks away or is hidden."""
    network = tracker._network
    assert isinstance(network, FakeNetwork)
    people = {1: person(300, 200), 2: person(336, 200)}
    network.faces = [(*middle(334, 200), 92.0)]
    for k in range(3):
        seen = {n: values[0][0] > 0 for n, values in face_of(tracker, people, k / 30).items()}
        assert seen == {1: False, 2: True}
    # Cheek to cheek, each has their own.
    people = {1: person(300, 200), 2: person(370, 200)}
    network.faces = [(*middle(300, 200), 92.0), (*middle(370, 200), 92.0)]
    seen = {n: values[0][0] > 0 for n, values in face_of(tracker, people, 1.0).items()}
    assert seen == {1: True, 2: True}


def test_a_head_too_small_is_not_looked_at(tracker):
    assert face_of(tracker, {1: person(300, 200, 70.0)})[1][0][0] == 0
    assert tracker._network.calls == 0


@pytest.mark.slow
def test_a_real_face_is_captured_and_moves_little_but_the_head(shared):
    clip = shared / "data" / "clips" / "squats_5fps.mp4"
    body = load_body("scope")
    without, found = (
        capture(
            clip, body, CaptureOptions(quality="fast", wanted=VideoRange(end_s=2.0), face=face)
        ).motions[0]
        for face in (False, True)
    )
    assert without.face == {}
    assert (found.face["expression_confidence"] > 0.8).all()
    assert found.face["expressions"].any()
    face = found.face["face_points"]
    nose = found.keypoints2d[:, KEYPOINT_NAMES.index("nose"), :2]
    assert (face.min(axis=1) < nose).all()
    assert (nose < face.max(axis=1)).all()
    for name in ("keypoints2d", "frames", "timestamps", "valid", "joint_confidence"):
        np.testing.assert_array_equal(getattr(found, name), getattr(without, name))
    # The head's direction shifts the weight a little, and with it the lean and what follows.
    np.testing.assert_allclose(found.betas, without.betas, atol=0.05)
    np.testing.assert_allclose(found.height_sigma_m, without.height_sigma_m, rtol=0.05)
    moved_m = np.linalg.norm(found.joints_cam - without.joints_cam, axis=-1).mean(axis=0)
    limbs = [
        k
        for k, name in enumerate(body.joint_names)
        if name.endswith(("hip", "knee", "ankle", "elbow", "wrist"))
    ]
    assert moved_m[limbs].max() < 0.015
    assert moved_m[body.joint_names.index("head")] > moved_m[limbs].max()
