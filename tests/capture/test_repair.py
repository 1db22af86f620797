# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of tentative hands in a track: nothing that comes after the repair sees a negative
confidence.

Wrists of the body and hands that contradict them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture import repair as repair_module
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.perception.hand_landmarks import HAND_LENGTH_M, pixels_per_metre
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.repair import repair, wrists_at_hands

from .exact_tracks import track_of_points
from .walking import someone_walking, track_without_depth

T = 12


def test_tentative_hands_are_believed_beside_sure_ones_and_dropped_elsewhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for repaired_by in ("repair_left_right", "repair_limb_swaps", "repair_keypoint_jumps"):
        monkeypatch.setattr(repair_module, repaired_by, lambda track, *_: track)
    hands = np.zeros((T, 2, 21, 7), np.float32)
    hands[..., :2] = np.random.default_rng(0).uniform(200, 240, (21, 2))
    hands[..., 2] = -0.4
    hands[3, 0, :, 2] = 0.9
    hands[4, 0] = 0.0
    track = track_of_points(np.ones((T, 33, 3)), np.eye(3), 10.0, hands=hands)
    repaired = repair(track, Camera(np.eye(3), np.zeros(5), ""))
    assert repaired.hands is not None
    np.testing.assert_allclose(
        repaired.hands[:, 0, 0, 2], [0.4, 0.4, 0.4, 0.9] + 8 * [0.0], atol=1e-6
    )
    assert not repaired.hands[:, 1].any()
    assert track.hands is hands


LEFT = 0


RIGHT = 1


WRISTS = [KEYPOINT_NAMES.index(f"{side}_wrist") for side in ("left", "right")]


OTHERS = [
    k
    for k, name in enumerate(KEYPOINT_NAMES)
    if name.split("_")[-1] not in ("wrist", "pinky", "index", "thumb")
]


@pytest.fixture(scope="module")
def walking_track():
    pixels, world = someone_walking(10, 30.0, 0.3)
    return replace(track_without_depth(pixels, 30.0, {}), world_landmarks=world)


def with_hand(track, row, side, away, confidence):
    """The track with an upright hand so many hand lengths to the right of the body's wrist in one
    frame.
    """
    length = HAND_LENGTH_M * pixels_per_metre(track.keypoints_px[row], track.world_landmarks[row])
    hands = np.zeros((len(track), 2, 21, 7), np.float32)
    hands[row, side, :, :2] = track.keypoints_px[row, WRISTS[side]] + [away * length, 0]
    hands[row, side, 1:, 1] -= length / 2
    hands[row, side, :, 2] = confidence
    return replace(track, hands=hands)


@pytest.mark.parametrize(
    ("away", "confidence", "moves"), [(1.0, 0.95, True), (0.3, 0.95, False), (1.0, 0.5, False)]
)
@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_a_wrist_goes_to_a_sure_hand_that_contradicts_it(
    walking_track, side, away, confidence, moves
):
    before = with_hand(walking_track, 5, side, away, confidence)
    after = wrists_at_hands(before)
    wrist = WRISTS[side]
    expected = before.hands[5, side, 0, :2] if moves else before.keypoints_px[5, wrist]
    np.testing.assert_allclose(after.keypoints_px[5, wrist], expected, atol=1e-3)
    moved_m = away * HAND_LENGTH_M if moves else 0.0
    np.testing.assert_allclose(
        after.world_landmarks[5, wrist] - before.world_landmarks[5, wrist],
        [moved_m, 0, 0],
        atol=1e-4,
    )
    np.testing.assert_array_equal(after.keypoints_px[:, OTHERS], before.keypoints_px[:, OTHERS])
    np.testing.assert_array_equal(after.keypoints_px[6:], before.keypoints_px[6:])


def test_without_hands_nothing_changes(walking_track):
    assert wrists_at_hands(walking_track) is walking_track
