# SPDX-License-Identifier: GPL-3.0-or-later
import sys
from subprocess import run
from types import SimpleNamespace

import numpy as np
from scope.scope_addon.review_spans import Span, body_confidence, low_confidence_spans


def motion(count: int = 30):
    confidence = np.ones((count, 4))
    confidence[:, 3] = 0.0  # a joint that nothing measures
    return SimpleNamespace(
        valid=np.ones(count, bool),
        residual_px=np.full(count, 2.0),
        image_size=np.array([640, 480]),
        joint_confidence=confidence,
        timestamps=np.arange(count) / 30.0,
        __len__=lambda: count,
    )


def test_a_good_motion_has_none():
    assert low_confidence_spans(motion()) == []


def test_each_frame_has_one_reason():
    m = motion()
    m.valid[[0, 1, 29]] = False
    m.residual_px[:5] = 100.0
    m.joint_confidence[:8, :3] = 0.1
    expected = [Span("unseen", 0, 1), Span("unseen", 29, 29), Span("far", 2, 4), Span("unsure", 5, 7)]
    assert low_confidence_spans(m) == expected


def test_near_spans_become_one():
    m = motion()
    m.valid[[3, 6, 20]] = False
    assert low_confidence_spans(m, gap_s=0.2) == [Span("unseen", 3, 6), Span("unseen", 20, 20)]


def test_joints_that_nothing_measures_do_not_count():
    np.testing.assert_array_equal(body_confidence(motion()), 1.0)


def test_fingers_that_are_not_seen_leave_the_body_sure():
    m = motion()
    m.joint_confidence = np.ones((30, 52))
    m.joint_confidence[5:, 22:] = 0.0
    np.testing.assert_array_equal(body_confidence(m), 1.0)


def test_it_needs_no_blender():
    code = "import sys, scope.scope_addon.review_spans; sys.exit('bpy' in sys.modules)"
    assert run([sys.executable, "-c", code], check=False).returncode == 0
