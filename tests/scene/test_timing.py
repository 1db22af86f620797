# SPDX-License-Identifier: GPL-3.0-or-later
from fractions import Fraction

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError, UsageError
from scope.scope_addon.scene import timing


@pytest.mark.parametrize(
    ("rate", "expected"),
    [
        (24.0, (24, 1.0)),
        (25.0, (25, 1.0)),
        (29.97, (30, 1.001)),
        (30000 / 1001, (30, 1.001)),
        (30.0, (30, 1.0)),
        (23.976, (24, 1.001)),
        (23.98, (24, 1.001)),
        (24000 / 1001, (24, 1.001)),
        (59.94, (60, 1.001)),
        (60000 / 1001, (60, 1.001)),
        (119.88, (120, 1.001)),
        (240.0, (240, 1.0)),
    ],
)
def test_standard_rates_are_exact(rate, expected):
    assert timing.blender_rate(rate) == expected


@pytest.mark.parametrize("rate", [0.5, 1.0, 12.5, 14.985, 17.3, 27.42, 29.5, 333.3, 960.0])
def test_any_rate_survives_the_scene(rate):
    scene = bpy.context.scene
    timing.set_scene_rate(scene, rate)
    assert timing.scene_rate(scene) == pytest.approx(rate, rel=1e-6)


def test_a_broadcast_scene_has_the_exact_rate():
    scene = bpy.context.scene
    timing.set_scene_rate(scene, 29.97)
    assert timing.scene_rate(scene) == float(Fraction(30000, 1001))


@pytest.mark.parametrize("rate", [0.0, -30.0, float("nan"), float("inf"), 1e6])
def test_impossible_rates_are_refused(rate):
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


@pytest.mark.parametrize("stamps", [[0.0, 0.1, 0.1], [0.1, 0.0], [0.0, np.nan]])
def test_bad_timestamps_are_refused(stamps):
    with pytest.raises(MotionFileError, match="timestamps"):
        timing.key_frames(np.array(stamps), 30.0)


@pytest.mark.parametrize(
    ("first", "last", "expected"), [(0.0, 9.2, (0, 10)), (500.5, 600.0, (500, 600))]
)
def test_frame_range_covers_the_keys(first, last, expected):
    scene = bpy.context.scene
    scene.frame_start = 100
    scene.frame_end = 200
    timing.set_frame_range(scene, first, last)
    assert (scene.frame_start, scene.frame_end) == expected
