# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of keys that differ from the motion."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.edit.corrected_motion import shot_of
from scope.scope_addon.edit.corrections import FeetOnFloor, Interpolation
from scope.scope_addon.scene.character.corrected_keys import KeyEdits, begin_with_edits, floored

from ....edit.walking import BETAS, BODY, motion_of, walk
from ...made_rigs import captured

WALK = walk(2.0)
FRAMES = 1.0 + np.arange(len(WALK))


@pytest.fixture
def rig():
    return captured(motion_of(WALK))


def raised(by):
    return Clip(WALK.times, WALK.rotations, WALK.root + [0.0, 0.0, by])


def edits(*corrections, new=None, rows=None):
    every = np.ones(len(WALK), bool)
    return KeyEdits(
        corrections, BETAS, shot_of(motion_of(WALK)), new, every if rows is None else rows
    )


def test_feet_of_displayed_keys_are_put_on_the_floor_wherever_the_motion_has_them(rig):
    keys, old = begin_with_edits(
        rig, BODY, (raised(0.3), raised(0.1)), FRAMES, edits(FeetOnFloor())
    )
    np.testing.assert_allclose(keys.root, old.root, atol=1e-9)
    assert np.abs(keys.soles(BODY, BETAS)[..., 2].min(axis=1)).max() < 0.06
    same = floored(rig, BODY, BETAS, raised(0.3), FRAMES, FeetOnFloor())
    np.testing.assert_allclose(keys.root, same.root, atol=1e-12)
    np.testing.assert_allclose(
        floored(rig, BODY, BETAS, WALK, FRAMES, FeetOnFloor(), 0.2).root[:, 2] - 0.2,
        same.root[:, 2],
    )


def test_keys_of_frames_without_the_person_say_nothing_of_the_floor(rig):
    still = Clip(
        WALK.times,
        np.tile(WALK.rotations[:1], (len(WALK), 1, 1, 1)),
        np.tile(WALK.root[:1], (len(WALK), 1)),
    )
    seen = np.arange(len(WALK)) < 20
    still.root[~seen, 2] -= 0.5
    shot = shot_of(replace(motion_of(still), valid=seen))
    put = floored(rig, BODY, BETAS, still, FRAMES, FeetOnFloor(), 0.0, shot)
    assert abs(np.median(put.soles(BODY, BETAS)[:18, :, 2].min(axis=1))) < 0.01


def test_an_edit_from_before_changes_only_keys_that_begin_without_it(rig):
    rows = np.arange(len(WALK)) >= 20
    span = Interpolation(15, 25)
    keys, _ = begin_with_edits(rig, BODY, (WALK, WALK), FRAMES, edits(span, rows=rows))
    np.testing.assert_array_equal(keys.rotations[:20], WALK.rotations[:20])
    assert np.abs(keys.rotations - WALK.rotations)[20:26].max() > 0.01
    keys, _ = begin_with_edits(rig, BODY, (WALK, WALK), FRAMES, edits(span, new=span, rows=rows))
    assert np.abs(keys.rotations - WALK.rotations)[15:20].max() > 0.01
