# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibrations in TOML, as Pose2Sim and Caliscope write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.capture.camera.calibration import placed_cameras, read_calibration
from scope.solver.errors import InputError

POSE2SIM = """
[cam_01]
name = "cam_01"
size = [ 1920.0, 1080.0]
matrix = [ [ 1681.2, 0.0, 960.5], [ 0.0, 1680.1, 540.25], [ 0.0, 0.0, 1.0]]
distortions = [ -0.0013, -0.01, 0.002, 0.001]
rotation = [ 1.2, 0.3, -0.1]
translation = [ 0.1, 1.0, 4.2]
fisheye = false

[cam_02]
name = "cam_02"
size = [ 1280.0, 720.0]
matrix = [ [ 1000.0, 0.0, 640.0], [ 0.0, 1001.0, 360.0], [ 0.0, 0.0, 1.0]]
distortions = [ 0.0, 0.0, 0.0, 0.0]
fisheye = {fisheye}

[metadata]
adjusted = false
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "Calib.toml"
    path.write_text(POSE2SIM.replace("{fisheye}", "false"))
    return path


def test_one_camera_of_several_is_named_after_the_file(path: Path) -> None:
    known = read_calibration(Path(f"{path}#cam_01"))
    assert known.size == (1920, 1080)
    np.testing.assert_allclose(known.dist, [-0.0013, -0.01, 0.002, 0.001, 0.0])
    half = known.intrinsics_for(960, 540)
    np.testing.assert_allclose(half[:2, :2].diagonal(), [840.6, 840.05])
    np.testing.assert_allclose(read_calibration(Path(f"{path}#cam_02")).intrinsics[1, 1], 1001.0)


def test_what_does_not_say_which_camera_it_is_is_refused(path: Path) -> None:
    with pytest.raises(InputError, match=r"cam_01, cam_02: name the one .* Calib\.toml#cam_01"):
        read_calibration(path)
    with pytest.raises(InputError, match="no camera 'cam_3'; its cameras are cam_01, cam_02"):
        read_calibration(Path(f"{path}#cam_3"))
    path.write_text(POSE2SIM.replace("{fisheye}", "true"))
    with pytest.raises(InputError, match="fisheye"):
        read_calibration(Path(f"{path}#cam_02"))
    path.write_text("[cam_0]\nmatrix = [")
    with pytest.raises(InputError, match="not a TOML file"):
        read_calibration(path)
    with pytest.raises(InputError, match="does not exist"):
        read_calibration(path.with_name("none.toml"))


@pytest.mark.parametrize("value", [f"[{'9' * 400}, 1, 1]", "[1979-05-27, 1, 1]"])
@pytest.mark.parametrize("key", ["matrix", "rotation"])
def test_numbers_and_dates_that_json_has_not_are_refused(path: Path, key: str, value: str) -> None:
    lines = path.read_text().splitlines()
    changed = [f"{key} = {value}" if line.startswith(key) else line for line in lines]
    path.write_text("\n".join(changed))

    def read() -> None:
        placed_cameras(path, ["cam_01", "cam_02"])
        read_calibration(Path(f"{path}#cam_01"))

    with pytest.raises(InputError):
        read()


def test_a_key_of_thousands_of_parts_is_refused_before_it_is_read(path: Path) -> None:
    """Python's reader would take minutes."""
    path.write_text("a." * 400_000 + "b = 1")
    with pytest.raises(InputError, match="too deep"):
        read_calibration(path)
