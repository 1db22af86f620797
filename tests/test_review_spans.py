# SPDX-License-Identifier: GPL-3.0-or-later
"""Review spans of motions with known defects."""

import numpy as np
from scope.scope_addon.review_spans import Span, body_confidence, find_review_spans
from scope.solver.body_file import load_body

from .made_motion import made_motion


def motion(count: int = 30):
    body = load_body("scope")
    m = made_motion(
        body,
        np.zeros((count, 3 * (body.K + 1))),
        np.zeros((count, 3)),
        residual_px=np.full(count, 2.0),
    )
    m.joint_confidence[:, 3] = 0.0  # a joint that nothing measures
    return m


def test_a_good_motion_has_no_review_spans():
    assert find_review_spans(motion()) == []


def test_each_frame_has_one_reason():
    m = motion()
    m.valid[[0, 1, 29]] = False
    m.residual_px[:5] = 100.0
    m.joint_confidence[:8] *= 0.1
    expected = [
        Span("unseen", 0, 1),
        Span("unseen", 29, 29),
        Span("far", 2, 4),
        Span("unsure", 5, 7),
    ]
    assert find_review_spans(m) == expected


def test_feet_under_the_floor_are_a_reason_of_their_own():
    m = motion()
    under = np.zeros(30, bool)
    m.valid[:3] = False
    under[2:6] = True
    assert find_review_spans(m, under_floor=under) == [Span("unseen", 0, 2), Span("floor", 2, 5)]


def test_close_spans_are_merged():
    m = motion()
    m.valid[[3, 6, 20]] = False
    assert find_review_spans(m, gap_s=0.2) == [Span("unseen", 3, 6), Span("unseen", 20, 20)]


def test_joints_without_measurements_do_not_count():
    np.testing.assert_array_equal(body_confidence(motion()), 1.0)


def test_a_body_without_measurements_has_low_confidence_throughout():
    m = motion()
    m.joint_confidence[:] = 0.0
    np.testing.assert_array_equal(body_confidence(m), np.zeros(30))
    assert find_review_spans(m) == [Span("unsure", 0, 29)]


def test_unseen_fingers_do_not_lower_the_confidence_of_the_body():
    m = motion()
    m.joint_confidence = np.ones((30, 52))
    m.joint_confidence[5:, 22:] = 0.0
    np.testing.assert_array_equal(body_confidence(m), 1.0)
