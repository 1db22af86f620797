# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys and strips that are moved to another frame rate."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.actions import fcurves
from scope.scope_addon.scene.timing import Retiming, action_strips, retime_keys, retime_strip

DOUBLED = Retiming(1.0, 2.0)


@pytest.fixture
def moved() -> bpy.types.Object:
    """An object with keys in frames 1, 4 and 10.5."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    thing = bpy.data.objects.new("thing", None)
    bpy.context.scene.collection.objects.link(thing)
    for frame in (1.0, 4.0, 10.5):
        thing.location.x = frame
        thing.keyframe_insert("location", index=0, frame=frame)
    return thing


def test_keys_move_away_from_the_origin_with_their_handles(moved: bpy.types.Object) -> None:
    (curve,) = fcurves(moved)
    for key in curve.keyframe_points:
        key.handle_left_type = key.handle_right_type = "FREE"  # Blender places others itself
    before = [[*key.handle_left, *key.co, *key.handle_right] for key in curve.keyframe_points]
    retime_keys(fcurves(moved), DOUBLED)
    after = [[*key.handle_left, *key.co, *key.handle_right] for key in curve.keyframe_points]
    expected = np.array(before)
    expected[:, ::2] = 1 + 2 * (expected[:, ::2] - 1)
    np.testing.assert_allclose(after, expected, atol=1e-4)
    assert [key.co[0] for key in curve.keyframe_points] == [1.0, 7.0, 20.0]


def test_keys_near_whole_frames_are_put_on_them() -> None:
    frames = np.array([2, 5, 100_003], np.float32)
    there = Retiming(1.0, 25 / 24).frames(frames).astype(np.float32)
    np.testing.assert_array_equal(Retiming(1.0, 24 / 25).frames(there), frames)
    np.testing.assert_allclose(Retiming(0.0, 0.5).frames(np.array([5], np.float32)), 2.5)


def test_a_span_contains_what_it_contained() -> None:
    assert DOUBLED.span(1, 10) == (1, 19)
    assert Retiming(1.0, 24 / 30).span(2, 9) == (1, 8)
    # 49 / 49 is less than 1 in double precision
    assert Retiming(0.0, 1 / 49).span(49, 98) == (1, 2)


@pytest.mark.parametrize("factor", [2.0, 0.5])
def test_strips_move_with_the_part_that_they_play(moved: bpy.types.Object, factor: float) -> None:
    animation = moved.animation_data
    action = animation.action
    strip = animation.nla_tracks.new().strips.new("walk", 21, action)
    strip.action_frame_start = 2.0
    strip.action_frame_end = 8.0
    strip.frame_start_raw = 21.0
    strip.frame_end_raw = 27.0
    (strip,) = action_strips(moved)
    assert strip.action == action
    retime_strip(strip, Retiming(1.0, factor))
    ends = strip.frame_start, strip.frame_end, strip.action_frame_start, strip.action_frame_end
    assert ends == pytest.approx([1 + factor * (frame - 1) for frame in (21, 27, 2, 8)])
