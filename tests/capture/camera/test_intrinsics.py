# SPDX-License-Identifier: GPL-3.0-or-later
"""Intrinsics from every source, against the definitions of focal length and field of view."""

import numpy as np
import pytest
from scope.scope_addon.capture.camera.camera_rotation import BackgroundTracker
from scope.scope_addon.capture.camera.intrinsics import (
    Camera,
    assumed_camera,
    choose_camera,
    pinhole,
)
from scope.scope_addon.errors import UsageError


def test_field_of_view_spans_the_longer_side():
    for size in ((1920, 1080), (1080, 1920)):
        K = choose_camera(*size, fov_deg=90).intrinsics
        assert np.isclose(K[0, 0], 960)  # tan 45 degrees = half the longer side over f
        assert np.allclose(K[:2, 2], np.array(size) / 2)


def test_metadata_counts_only_without_the_users_value():
    assert np.isclose(choose_camera(3600, 2000, metadata_focal_mm=26).intrinsics[0, 0], 2600)
    assert np.isclose(
        choose_camera(3600, 2000, metadata_focal_mm=26, focal_mm=50).intrinsics[0, 0], 5000
    )
    assert "assumed" in choose_camera(640, 480).source


@pytest.mark.parametrize(
    ("size", "content", "degrees"),
    [
        ((1280, 720), (1280, 720), 60),
        ((720, 720), (720, 720), 60),
        ((720, 1280), (720, 1280), 65),
        ((1920, 1080), (608, 1080), 65),  # an upright clip in a wide frame
        ((1080, 1920), (1080, 608), 60),  # a film on an upright screen
    ],
)
def test_upright_pictures_are_taken_for_a_phones(size, content, degrees):
    """Phones that were calibrated for motion capture, 720 x 1280, have 856 to 925 pixels."""
    camera = assumed_camera(*size, content)
    focal_px = max(content) / 2 / np.tan(np.radians(degrees / 2))
    assert camera.intrinsics[0, 0] == pytest.approx(focal_px)
    assert camera.source.startswith(f"assumed, {degrees} degrees")
    if degrees == 65:
        calibrated = np.array([856.0, 913.0, 925.0]) / 1280
        error = np.log(calibrated * max(content) / focal_px) / camera.focal_deviation
        assert np.abs(error).max() < 1.5


@pytest.mark.parametrize(
    "options", [{"focal_mm": 26, "fov_deg": 60}, {"fov_deg": 0}, {"fov_deg": 180}, {"focal_mm": -1}]
)
def test_contradictory_or_impossible_values_are_refused(options):
    with pytest.raises(UsageError):
        choose_camera(640, 480, **options)


def test_a_distorting_lens_and_a_background_without_features():
    """A black picture and a bare wall have no corners or edges: the camera is static."""
    camera = Camera(pinhole(320, 240, 300.0), np.array([-0.2, 0.05, 0.0, 0.0, 0.0]), "calibration")
    assert camera.rays(np.zeros((0, 2))).shape == (0, 3)
    background = BackgroundTracker(camera, 320, 240)
    for k, grey in enumerate((0, 0, 128, 128)):
        background.add(
            np.full((240, 320, 3), grey, np.uint8),
            k / 10,
            [np.array([[100.0, 60.0], [160.0, 200.0]])],
        )
    record = background.record()
    motion = record.motion(camera, camera, (320, 240))
    assert motion.is_static
    assert len(record.lines(motion, camera).lengths) == 0


def test_a_given_focal_length_is_that_of_the_picture_between_bars(tmp_path):
    """A portrait clip of 608 x 1080 in a wide video, filmed with a phone's 26 mm."""
    camera = choose_camera(1920, 1080, focal_mm=26.0)
    between = camera.between_bars((608.0, 1080.0), 1920, 1080)
    assert between.intrinsics[0, 0] == pytest.approx(26.0 / 36.0 * 1080.0)
    assert between.source == "given, 26 mm between the bars"
    assert camera.between_bars((1920.0, 1080.0), 1920, 1080) is camera
    file = tmp_path / "calibration.json"
    file.write_text('{"intrinsics": [[1400, 0, 960], [0, 1400, 540], [0, 0, 1]]}')
    calibrated = choose_camera(1920, 1080, calibration=file)
    assert calibrated.between_bars((608.0, 1080.0), 1920, 1080) is calibrated
