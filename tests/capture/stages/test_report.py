# SPDX-License-Identifier: GPL-3.0-or-later
"""What the report says of a face, counted by hand, and of the up direction."""

import numpy as np
import pytest
from scope.scope_addon.capture.stages.report import face_frames, up_warnings
from scope.scope_addon.capture.world.world_frame import BODIES, LINES
from scope.solver import load_body

from ...made_motion import made_face, made_motion

T = 300
RATE = 30.0


@pytest.fixture(scope="module")
def motion():
    body = load_body("scope")
    return made_motion(body, np.zeros((T, 3 * (body.K + 1))), np.zeros((T, 3)), RATE)


def test_a_motion_without_a_face_says_nothing_of_one(motion):
    assert face_frames(motion) == {}


def test_blinks_are_counted_and_related_to_the_time_in_which_the_face_was_seen(motion):
    lids = np.zeros(T)
    jaw = np.zeros(T)
    lids[10:14] = lids[100:103] = lids[200:210] = 0.9  # the last one while the face is not seen
    jaw[:20] = 0.8  # a tenth of the frames, so the 95th percentile is there
    motion.face = made_face(T, eyeBlinkLeft=lids, eyeBlinkRight=lids, jawOpen=jaw)
    motion.face["expression_confidence"][180:] = 0.0
    # Seen for 6 s: two blinks are twenty a minute.
    assert face_frames(motion) == {
        "face_frames": 180,
        "blinks": 2,
        "blinks_per_minute": 20.0,
        "jaw_open": 0.8,
    }


def test_one_eye_alone_is_a_wink(motion):
    motion.face = made_face(T, eyeBlinkLeft=np.ones(T))
    assert face_frames(motion)["blinks"] == 0


def test_a_face_that_was_never_seen_has_no_rate(motion):
    motion.face = made_face(T)
    motion.face["expression_confidence"][:] = 0.0
    assert face_frames(motion) == {"face_frames": 0, "blinks": 0}


def test_a_still_without_edges_says_that_up_is_a_guess():
    """And how far it may be off; clips, and pictures with edges, say nothing."""
    (warning,) = map(str, up_warnings("a.jpg", BODIES, is_still=True))
    assert "a.jpg" in warning
    assert "11 degrees" in warning
    assert up_warnings("a.jpg", LINES, is_still=True) == []
    assert up_warnings("a.mp4", BODIES, is_still=False) == []
