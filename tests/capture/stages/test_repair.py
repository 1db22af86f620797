# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of tentative hands in a track: nothing that comes after the repair sees a negative
confidence.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.stages import repair as repair_module
from scope.scope_addon.capture.stages.repair import repair
from scope.scope_addon.capture.tracking.track import Track

T = 12


def test_tentative_hands_are_believed_beside_sure_ones_and_dropped_elsewhere(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for repaired_by in ("repair_left_right", "repair_limb_swaps", "repair_keypoint_jumps"):
        monkeypatch.setattr(repair_module, repaired_by, lambda track, *_: track)
    hands = np.zeros((T, 2, 21, 6), np.float32)
    hands[..., :2] = np.random.default_rng(0).uniform(200, 240, (21, 2))
    hands[..., 2] = -0.4
    hands[3, 0, :, 2] = 0.9
    hands[4, 0] = 0.0
    track = Track(
        frames=np.arange(T),
        times=np.arange(T) / 10,
        seen=np.ones(T, bool),
        keypoints_px=np.zeros((T, 33, 2), np.float32),
        confidence=np.ones((T, 33), np.float32),
        world_landmarks=np.zeros((T, 33, 3), np.float32),
        acquired=np.arange(T) == 0,
        hands=hands,
    )
    repaired = repair(track, Camera(np.eye(3), np.zeros(5), ""))
    assert repaired.hands is not None
    np.testing.assert_allclose(
        repaired.hands[:, 0, 0, 2], [0.4, 0.4, 0.4, 0.9] + 8 * [0.0], atol=1e-6
    )
    assert not repaired.hands[:, 1].any()
    assert track.hands is hands
