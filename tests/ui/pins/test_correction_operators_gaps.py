# SPDX-License-Identifier: GPL-3.0-or-later
"""Pins in frames in which the person was not seen, and where the footage has no frames."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.scene.character.correction_list import listed_corrections
from scope.scope_addon.scene.packed_motion import pack_motion, stored_motion

from ...edit.walking import NAMES, motion_of, walk
from ...scene import made_rigs
from ...scene.made_rigs import captured

FRAMES = range(1, 92)  # of the scene


def pinned(motion, frame):
    """Pin the left wrist of a capture in a scene frame; return the armature, the target, and all
    joints before.
    """
    armature = captured(motion)
    pack_motion(armature, motion.to_bytes())
    armature["scope_body_file"] = "scope"
    before = made_rigs.seen(armature, NAMES, FRAMES)
    target = before[frame - 1, NAMES.index("left_wrist")] + [0.1, 0.05, 0.1]
    bpy.ops.scope.add_pin(joint="left_wrist", frame=frame, location=target)
    return armature, target, before


def test_a_pin_in_frames_in_which_the_person_was_not_seen_is_met():
    motion = motion_of(walk(3.0))
    hidden = np.arange(len(motion.valid))[30:60]
    motion.valid[hidden] = False
    motion.joint_confidence[hidden] = 0.0
    motion.residual_px[hidden] = np.nan
    armature, target, before = pinned(motion, 46)
    after = made_rigs.seen(armature, NAMES, FRAMES)
    assert np.linalg.norm(after[45, NAMES.index("left_wrist")] - target) < 0.01
    far = np.abs(np.arange(1, 92) - 46) > 0.4 * 30
    np.testing.assert_allclose(after[far], before[far], atol=1e-6)
    assert not stored_motion(armature).valid[hidden].any()  # a pin does not make them seen


def test_a_pin_in_a_gap_of_the_footage_is_refused_and_one_at_its_edge_is_met():
    whole = walk(3.0)
    rows = np.r_[0:31, 60:91]  # as numbered images of which some are missing
    clip = Clip(whole.times[rows], whole.rotations[rows], whole.root[rows])
    motion = replace(motion_of(clip), frames=rows)
    with pytest.raises(
        RuntimeError,
        match="Frame 46 is in a gap of the captured motion of 'walk', where the footage",
    ):
        pinned(motion, 46)
    (armature,) = (obj for obj in bpy.context.scene.objects if "scope_source" in obj)
    assert listed_corrections(armature) == []
    before = made_rigs.seen(armature, NAMES, FRAMES)
    target = before[30, NAMES.index("left_wrist")] + [0.1, 0.05, 0.1]
    bpy.ops.scope.add_pin(joint="left_wrist", frame=31, location=target)
    after = made_rigs.seen(armature, NAMES, FRAMES)
    assert np.linalg.norm(after[30, NAMES.index("left_wrist")] - target) < 0.01
    np.testing.assert_allclose(after[60:], before[60:], atol=1e-6)
