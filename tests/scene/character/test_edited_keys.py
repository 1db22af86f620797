# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of keys that differ from the motion."""

import numpy as np
from scope.scope_addon.edit.corrected_motion import shot_of
from scope.scope_addon.edit.corrections import Interpolation
from scope.scope_addon.scene.character.corrected_keys import KeyEdits, begin_with_edits

from ...edit.walking import BETAS, BODY, motion_of, walk
from ..made_rigs import captured

WALK = walk(2.0)
FRAMES = 1.0 + np.arange(len(WALK))


def interpolated_keys(rows, *, is_new):
    """Return the rotations (T, K+1, 3, 3) of keys after an interpolation of frames 15 to 25.

    :param rows: (T,) keys that begin without corrections.
    """
    span = Interpolation(15, 25)
    motion = motion_of(WALK)
    edits = KeyEdits((span,), BETAS, shot_of(motion), span if is_new else None, rows)
    keys, _ = begin_with_edits(captured(motion), BODY, (WALK, WALK), FRAMES, edits)
    return keys.rotations


def test_an_edit_from_before_changes_only_keys_that_begin_without_it():
    rows = np.arange(len(WALK)) >= 20
    former = interpolated_keys(rows, is_new=False)
    np.testing.assert_array_equal(former[:20], WALK.rotations[:20])
    assert np.abs(former - WALK.rotations)[20:26].max() > 0.01
    new = interpolated_keys(rows, is_new=True)
    assert np.abs(new - WALK.rotations)[15:20].max() > 0.01
