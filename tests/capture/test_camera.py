# SPDX-License-Identifier: GPL-3.0-or-later
"""Intrinsics from every source, against the definitions of focal length and field of view."""

import json

import numpy as np
import pytest
from scope.scope_addon.capture.camera import choose_camera
from scope.solver.errors import InputError, UsageError


def test_field_of_view_spans_the_longer_side():
    for size in ((1920, 1080), (1080, 1920)):
        K = choose_camera(*size, fov_deg=90).intrinsics
        assert np.isclose(K[0, 0], 960)  # tan 45 degrees = half the longer side over f
        assert np.allclose(K[:2, 2], np.array(size) / 2)


def test_focal_mm_is_35_mm_equivalent():
    assert np.isclose(choose_camera(1800, 1000, focal_mm=36).intrinsics[0, 0], 1800)


def test_metadata_counts_only_without_the_users_word():
    assert np.isclose(choose_camera(3600, 2000, metadata_focal_mm=26).intrinsics[0, 0], 2600)
    assert np.isclose(choose_camera(3600, 2000, metadata_focal_mm=26, focal_mm=50).intrinsics[0, 0], 5000)
    assert "assumed" in choose_camera(640, 480).source


def test_calibration_scales_with_the_footage(tmp_path):
    path = tmp_path / "cam.json"
    path.write_text(
        json.dumps({"intrinsics": [[1000, 0, 500], [0, 1100, 300], [0, 0, 1]], "dist": [0.1, 0], "size": [1000, 600]})
    )
    camera = choose_camera(2000, 1200, calibration=path)
    assert np.allclose(camera.intrinsics, [[2000, 0, 1000], [0, 2200, 600], [0, 0, 1]])
    assert np.allclose(camera.dist, [0.1, 0, 0, 0, 0])


def test_undistorted_points_project_back_through_the_distortion(tmp_path):
    path = tmp_path / "cam.json"
    path.write_text(
        json.dumps({"intrinsics": [[900, 0, 320], [0, 900, 240], [0, 0, 1]], "dist": [-0.2, 0.05, 0.001, -0.002, 0]})
    )
    camera = choose_camera(640, 480, calibration=path)
    x, y = 0.2, -0.15  # normalized point; the Brown model written out
    k1, k2, p1, p2, _ = camera.dist
    r2 = x * x + y * y
    q = 1 + k1 * r2 + k2 * r2 * r2
    seen = [x * q + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * q + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y]
    pixels = np.array(seen) * 900 + [320, 240]
    assert np.allclose(camera.undistort(pixels[None]), np.array([[x, y]]) * 900 + [320, 240], atol=0.05)


@pytest.mark.parametrize(
    "options", [{"focal_mm": 26, "fov_deg": 60}, {"fov_deg": 0}, {"fov_deg": 180}, {"focal_mm": -1}]
)
def test_contradictory_or_impossible_values_are_refused(options):
    with pytest.raises(UsageError):
        choose_camera(640, 480, **options)


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"intrinsics": 1}', '{"intrinsics": [[0,0,0],[0,0,0],[0,0,1]]}', '{"intrinsics": [["a"]]}'],
)
def test_a_broken_calibration_is_named(tmp_path, text):
    path = tmp_path / "cam.json"
    path.write_text(text)
    with pytest.raises(InputError, match="cam.json"):
        choose_camera(640, 480, calibration=path)
