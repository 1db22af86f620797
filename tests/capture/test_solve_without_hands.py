# SPDX-License-Identifier: GPL-3.0-or-later
"""People of whom no hand is seen, on a body with fingers: fitted as if hands had not been looked
for.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from scope.scope_addon.capture.solve import prepare, solve
from scope.solver.body_file import load_body

from . import standing_people
from .standing_people import seen, steps

pytestmark = pytest.mark.usefixtures("exact_lifting")
FINGERS = 30


@pytest.fixture(scope="module")
def body():
    return load_body("scope_h")


def with_hands(track, frame=None):
    """The track with hands that were looked for, and seen in one frame at most."""
    hands = np.zeros((len(track), 2, 21, 7), np.float32)
    if frame is not None:
        hands[frame, 0, :, :2] = track.keypoints_px[frame, 15]
        hands[frame, 0, :, 2] = 0.9
        hands[frame, 0, :, 3:6] = np.random.default_rng(0).standard_normal((21, 3)) * 0.04
    return replace(track, hands=hands)


def test_the_motion_is_that_without_hands_and_its_fingers_are_at_rest(body, monkeypatch):
    monkeypatch.setattr(standing_people, "STAYS_S", 0.5)
    track = steps(0.0)
    shot = replace(seen(track), body=body)
    (looked_for,), (not_looked_for,) = (
        solve(shot, [each], lambda *_: None).motions for each in (with_hands(track), track)
    )
    for field in fields(looked_for):
        a, b = (getattr(motion, field.name) for motion in (looked_for, not_looked_for))
        if not field.name.startswith("keypoints2d") and isinstance(a, np.ndarray):
            assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f"), field.name
    assert looked_for.keypoints2d.shape[1] == not_looked_for.keypoints2d.shape[1] + 42
    poses = looked_for.poses.reshape(len(track), body.K + 1, 3)
    fingers = [
        k for k, name in enumerate(body.joint_names) if name[-1].isdigit() and "spine" not in name
    ]
    assert len(fingers) == FINGERS
    assert not poses[:, fingers].any()
    assert not looked_for.joint_confidence[:, fingers].any()
    sigma_m = looked_for.joint_sigma_m
    for side in ("left", "right"):
        wrist = body.joint_names.index(f"{side}_wrist")
        own = [k for k in fingers if body.joint_names[k].startswith(side)]
        assert (sigma_m[:, own] > sigma_m[:, [wrist]]).all()
        assert (sigma_m[:, own] < sigma_m[:, [wrist]] + 0.1).all()


def test_fingers_are_left_out_of_the_fit_unless_a_hand_is_seen_in_some_frame(body):
    """Of each person separately: in a hand's absence, they would take most of the time."""
    track = steps(0.0)
    tracks = [track, with_hands(track), with_hands(track, frame=len(track) - 1)]
    people = prepare(replace(seen(track), body=body), tracks, lambda *_: None, ())
    assert [each.prepared.body.K for each in people] == [body.K - FINGERS, body.K - FINGERS, body.K]
    assert [each.prepared.whole_body.K for each in people] == 3 * [body.K]
