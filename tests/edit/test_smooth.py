# SPDX-License-Identifier: GPL-3.0-or-later
"""Amounts of smoothing: the raw and the finished motion exactly, a filter in between, and one
beyond, but for feet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.edit.clip import Clip, clip_from_motion
from scope.scope_addon.edit.smooth import smoothed
from scope.scope_addon.errors import UsageError
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.scope_addon.motion import Motion
from scope.solver.rotations import exp, log

from ..made_motion import rows_of
from .walking import BETAS, BODY, NAMES, RATE, motion_of, walk

ELBOW = NAMES.index("left_elbow")


def shaking(hz: float, seconds: float = 6.0) -> Motion:
    """Return a motion whose left elbow moves by a sinusoid of 0.1 radians, raw and finished
    alike.
    """
    still = walk(seconds, speed=0.0)
    rotations = np.tile(np.eye(3), still.rotations.shape[:2] + (1, 1))
    rotations[:, ELBOW] = exp(np.outer(0.1 * np.sin(2 * np.pi * hz * still.times), [0.0, 0.0, 1.0]))
    root = np.tile(still.root[0], (len(still.times), 1))
    return motion_of(Clip(still.times, rotations, root))


def amplitude(clip: Clip) -> float:
    angles = log(clip.rotations[:, ELBOW])[:, 2]
    inner = slice(len(angles) // 4, -len(angles) // 4)
    return float(np.sqrt(2) * angles[inner].std())


@pytest.mark.parametrize(
    ("seconds", "raw_at"),
    [
        (4.0, {0.0: True, 1.0: False}),
        # two frames, which no filter changes
        (1 / RATE, {0.0: True, 0.5: True, 1.0: False, 2.0: False}),
    ],
)
def test_strength_zero_is_the_raw_motion_and_one_the_finished(
    seconds: float, raw_at: dict[float, bool]
) -> None:
    motion = motion_of(walk(seconds), noise=0.05)
    for strength, raw in raw_at.items():
        found = smoothed(BODY, motion, strength)
        expected = clip_from_motion(BODY, motion, raw=raw)
        np.testing.assert_array_equal(found.rotations, expected.rotations)
        np.testing.assert_array_equal(found.root, expected.root)


def test_more_strength_leaves_less_of_a_quick_movement_and_all_of_a_slow_one() -> None:
    """The finished motion has all of what it has; from there, at strength 3, the filter's gain is
    1/√2 at 1.6 Hz.
    """
    motion = shaking(6.0)
    quick = [amplitude(smoothed(BODY, motion, s)) for s in (1.0, 2.0, 3.0)]
    assert quick[0] == pytest.approx(0.1, rel=0.02)  # the finished motion has it
    assert 0.1 > quick[1] > quick[2]
    assert quick[2] < 0.001
    assert amplitude(smoothed(BODY, shaking(0.3), 3.0)) == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize(("strength", "end_m"), [(2.5, 0.8), (8.0, 1.6)])
def test_a_walk_begins_and_ends_where_it_was(strength: float, end_m: float) -> None:
    """A filter that sees one side alone would move both ends inwards, by 12 cm, and more near the
    camera.
    """
    motion = motion_of(walk(2.0))
    camera = motion.world_from_camera[:, :3, 3]
    away = clip_from_motion(BODY, motion, raw=False).root - camera
    nearer = np.linspace(0.0, 1.0 - end_m / np.linalg.norm(away[-1]), len(motion))
    motion = replace(motion, trans=motion.trans - nearer[:, None] * away[-1])
    found = smoothed(BODY, motion, strength)
    before = clip_from_motion(BODY, motion, raw=False)
    assert np.linalg.norm((before.root - camera)[-1]) == pytest.approx(end_m, abs=0.01)
    np.testing.assert_allclose(found.root[[0, -1]], before.root[[0, -1]], atol=1e-3)
    np.testing.assert_allclose(found.rotations[[0, -1]], before.rotations[[0, -1]], atol=1e-6)


def test_feet_that_rest_stay_in_place_when_the_rest_is_smoothed() -> None:
    """Somebody who sways and squats on feet that do not move."""
    clip = walk(4.0, speed=0.0)
    w = np.zeros((len(clip.times), len(NAMES), 3))
    bend = 0.3 * (1 - np.cos(4 * np.pi * clip.times))
    for side in ("left", "right"):
        for joint, share in (("hip", -1.0), ("knee", 2.0), ("ankle", -1.0)):
            w[:, NAMES.index(f"{side}_{joint}"), 0] = share * bend
    rotations = exp(w)
    rotations[:, 0] = R_WORLD_MODEL
    still = Clip(clip.times, rotations, clip.root)
    ankles = [NAMES.index(f"{side}_ankle") for side in ("left", "right")]
    root = (
        clip.root
        - still.joints(BODY, BETAS)[:, ankles].mean(axis=1)
        + still.joints(BODY, BETAS)[0, ankles].mean(0)
    )
    motion = motion_of(Clip(clip.times, rotations, root))
    rests = np.ones((len(clip.times), 4))
    rests[70:, 2:] = 0.0  # the right foot does not rest any more
    held, free = (
        replace(motion, foot_contact=contact) for contact in (rests, np.zeros_like(rests))
    )
    moved = []
    for each in (held, free):
        joints = smoothed(BODY, each, 2.5).joints(BODY, BETAS)[:, ankles]
        moved.append(np.linalg.norm(joints - motion_joints(motion)[:, ankles], axis=-1))
    assert moved[1][20:60].max() > 0.01
    assert moved[0][20:60].max() < 0.001
    np.testing.assert_allclose(moved[0][90:, 1], moved[1][90:, 1], atol=1e-6)


def motion_joints(motion: Motion) -> np.ndarray:
    return clip_from_motion(BODY, motion, raw=False).joints(BODY, BETAS)


@pytest.mark.parametrize("strength", [-0.1, np.nan])
def test_what_is_no_strength_is_refused(strength: float) -> None:
    with pytest.raises(UsageError, match="0 or more"):
        smoothed(BODY, motion_of(walk(0.5)), strength)


@pytest.mark.parametrize(
    ("strength", "lengths"), [(0.5, (1.0, 1.0)), (2.0, (1.0, 1.0)), (8.0, (1.0, 0.0))]
)
def test_scenes_on_both_sides_of_a_cut_are_smoothed_apart(
    strength: float, lengths: tuple[float, float]
) -> None:
    """As two motions are of which each has one of them; also a scene of one frame."""
    first, second = (walk(seconds) for seconds in lengths)
    second.root[:, 0] += 2.0
    second.rotations[:, ELBOW] = exp(np.array([0.0, 0.0, 0.8]))
    both = Clip(
        np.arange(len(first) + len(second)) / RATE,
        np.concatenate([first.rotations, second.rotations]),
        np.concatenate([first.root, second.root]),
    )
    joined = replace(motion_of(both, noise=0.02), scene_starts=[len(first)])
    found = smoothed(BODY, joined, strength)
    for rows in (slice(0, len(first)), slice(len(first), None)):
        alone = rows_of(joined, rows)
        expected = smoothed(BODY, alone, strength)
        if len(alone) > 2:  # a filter changes nothing else
            np.testing.assert_allclose(found.root[rows], expected.root, atol=1e-6)
            np.testing.assert_allclose(found.rotations[rows], expected.rotations, atol=1e-6)
    np.testing.assert_array_equal(found.times, both.times)
