# SPDX-License-Identifier: GPL-3.0-or-later
"""The examples run, and find what they say they find."""

import subprocess
import sys

import pytest
from scope.solver.examples import (
    from_2d_keypoints,
    from_3d_joints,
    from_hand,
    from_markers,
    from_several_cameras,
    refine_regression,
)


def test_from_3d_joints():
    assert from_3d_joints.main() < 15.0


def test_from_2d_keypoints():
    assert from_2d_keypoints.main() < 2.5  # noise of 2 px along each axis is 2.5 px on average


def test_from_markers():
    assert from_markers.main() < 12.0


def test_from_hand():
    assert from_hand.main() < 8.0


def test_from_several_cameras():
    assert from_several_cameras.main() < 12.0


def test_refine_regression():
    before, after = refine_regression.main()
    assert after < 0.6 * before


@pytest.mark.parametrize("name", ["from_3d_joints", "refine_regression"])
def test_an_example_is_a_program(name):
    command = [sys.executable, "-m", f"scope.solver.examples.{name}"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert " mm" in done.stdout
