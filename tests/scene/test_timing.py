# SPDX-License-Identifier: GPL-3.0-or-later
from fractions import Fraction

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError, UsageError
from scope.scope_addon.scene import timing


def test_standard_rates_are_exact():
    expected = {25.0: (25, 1.0), 29.97: (30, 1.001), 23.976: (24, 1.001), 23.98: (24, 1.001)}
    expected |= {60000 / 1001: (60, 1.001), 119.88: (120, 1.001), 240.0: (240, 1.0)}
    for rate, stored in expected.items():
        assert timing.blender_rate(rate) == stored


def test_any_rate_survives_the_scene():
    scene = bpy.context.scene
    for rate in (0.5, 12.5, 14.985, 27.42, 960.0):
        timing.set_scene_rate(scene, rate)
        assert timing.scene_rate(scene) == pytest.approx(rate, rel=1e-6)


def test_a_broadcast_scene_has_the_exact_rate():
    scene = bpy.context.scene
    timing.set_scene_rate(scene, 29.97)
    assert timing.scene_rate(scene) == float(Fraction(30000, 1001))


def test_impossible_rates_are_refused():
    for rate in (0.0, float("nan"), 1e6):
        with pytest.raises(UsageError, match="frame rate"):
            timing.blender_rate(rate)


def test_keys_lie_at_timestamp_times_rate():
    stamps = np.array([0.0, 0.031, 0.07, 0.1])
    np.testing.assert_allclose(timing.key_frames(stamps, 30.0), [0.0, 0.93, 2.1, 3.0])
    np.testing.assert_allclose(
        timing.key_frames(stamps, 24.0, start_frame=1.0), [1.0, 1.744, 2.68, 3.4]
    )


def test_rounded_timestamps_land_on_whole_frames():
    exact = np.arange(500) * 1001 / 30000
    frames = timing.key_frames(np.round(exact, 6), 30000 / 1001)
    np.testing.assert_array_equal(frames, np.arange(500))


def test_bad_timestamps_are_refused():
    for stamps in ([0.0, 0.1, 0.1], [0.0, np.nan]):
        with pytest.raises(MotionFileError, match="timestamps"):
            timing.key_frames(np.array(stamps), 30.0)


def test_frame_range_covers_the_keys():
    scene = bpy.context.scene
    for first, last, expected in ((0.0, 9.2, (0, 10)), (500.5, 600.0, (500, 600))):
        timing.set_frame_range(scene, first, last)
        assert (scene.frame_start, scene.frame_end) == expected
