# SPDX-License-Identifier: GPL-3.0-or-later
"""Repair spans of a clip: interpolation from the neighbours, and swapped left and right limbs."""

import numpy as np
import pytest
from scope.scope_addon.edit import spans
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.errors import UsageError
from scope.solver import load_body
from scope.solver.rotations import exp

from .walking import BETAS, BODY, NAMES, RATE, angle, walk


def test_a_broken_span_is_gone_over_as_the_neighbours_move():
    clip = walk(2.0)
    broken = Clip(clip.times, clip.rotations.copy(), clip.root.copy())
    bad = slice(20, 26)
    broken.rotations[bad] = exp(np.random.default_rng(0).standard_normal((6, len(NAMES), 3)))
    broken.root[bad] += 1.0
    mended = spans.interpolate(broken, 20 / RATE, 25 / RATE)
    # of a swing of 23 degrees
    assert angle(mended.rotations, clip.rotations).max() < np.radians(6.0)
    assert np.abs(mended.root - clip.root).max() < 0.03
    outside = np.r_[0:20, 26 : len(clip)]
    np.testing.assert_array_equal(mended.rotations[outside], broken.rotations[outside])
    with pytest.raises(UsageError, match="reaches the motion's end"):
        spans.interpolate(clip, 0.0, 0.5)
    with pytest.raises(UsageError, match="no keys"):
        spans.interpolate(clip, 50.0, 60.0)


def bone(joints, side, start, end):
    """Return the directions (T, 3) of a bone of joints (T, K+1, 3)."""
    along = joints[:, NAMES.index(f"{side}_{end}")] - joints[:, NAMES.index(f"{side}_{start}")]
    return along / np.linalg.norm(along, axis=1, keepdims=True)


@pytest.mark.parametrize("limbs", ["arms", "both"])
def test_swapping_puts_each_limb_where_the_other_one_was(limbs):
    clip = walk(1.0)
    rng = np.random.default_rng(1)
    clip.rotations[:, 1:] = clip.rotations[:, 1:] @ exp(
        0.2 * rng.standard_normal((len(NAMES) - 1, 3))
    )
    out = spans.swap_sides(clip, BODY, 0.2, 0.5, limbs)
    span = (clip.times > 0.199) & (clip.times < 0.501)
    before = clip.joints(BODY, BETAS)
    after = out.joints(BODY, BETAS)
    for kind, chain in (
        ("legs", ("hip", "knee", "ankle", "foot")),
        ("arms", ("shoulder", "elbow", "wrist")),
    ):
        for a, b in zip(chain, chain[1:], strict=False):
            for side, other in (("left", "right"), ("right", "left")):
                source = other if limbs in (kind, "both") else side
                cosine = (bone(after, side, a, b) * bone(before, source, a, b)).sum(1)[span]
                assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 12.0, (a, b, side)
    np.testing.assert_array_equal(out.rotations[~span], clip.rotations[~span])
    again = spans.swap_sides(out, BODY, 0.2, 0.5, limbs)
    np.testing.assert_allclose(again.rotations, clip.rotations, atol=1e-12)


def test_fingers_of_exchanged_arms_are_bent_as_far_as_the_other_hands_were() -> None:
    body = load_body("scope_h")
    names = list(body.joint_names)
    clip = Clip(np.arange(10) / RATE, np.tile(np.eye(3), (10, len(names), 1, 1)), np.zeros((10, 3)))
    right, left = (names.index(f"{side}_middle1") for side in ("right", "left"))
    # The right hand's fingers point along -x at rest, its palm along -y: this makes a fist.
    clip.rotations[:, right] = exp(np.array([0.0, 0.0, 1.2]))
    out = spans.swap_sides(clip, body, 0.0, 1.0, "arms")
    betas = np.zeros(body.P)
    tip, wrist = names.index("left_middle2"), names.index("left_wrist")
    R, joints = out.parts(body, betas)
    in_hand = np.swapaxes(R[:, wrist], 1, 2) @ (joints[:, tip] - joints[:, left])[..., None]
    assert (in_hand[:, 1, 0] < -0.8 * np.linalg.norm(in_hand[:, :, 0], axis=1)).all()
    np.testing.assert_allclose(
        out.rotations[:, left], np.tile(exp(np.array([0, 0, -1.2])), (10, 1, 1))
    )
    np.testing.assert_array_equal(out.rotations[:, right], np.tile(np.eye(3), (10, 1, 1)))
