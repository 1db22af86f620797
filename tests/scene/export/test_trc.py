# SPDX-License-Identifier: GPL-3.0-or-later
"""Markers in .trc files: their places, by the joints of the motion file, and the format."""

import numpy as np
import pytest
from scope.scope_addon.scene.export.without_scene import trc_text


def read(text):
    """Return the header's values, and the marker positions (T, 3) by name, as the format says."""
    lines = text.split("\n")
    keys = lines[1].split("\t")
    values = dict(zip(keys, lines[2].split("\t"), strict=True))
    names = [name for name in lines[3].split("\t")[2:] if name]
    axes = lines[4].split("\t")[2:]
    assert axes == [f"{axis}{k + 1}" for k in range(len(names)) for axis in "XYZ"]
    assert lines[5] == ""
    rows = np.array([line.split("\t") for line in lines[6:] if line], float)
    markers = {name: rows[:, 2 + 3 * k : 5 + 3 * k] for k, name in enumerate(names)}
    return lines[0], values, rows[:, 0], rows[:, 1], markers


def test_markers_are_the_joints_with_y_up(whole_body, make_motion, joints_world):
    motion = make_motion(whole_body, 12)
    first, values, numbers, times_s, markers = read(trc_text("walk.trc", motion, whole_body))
    assert first == "PathFileType\t4\t(X/Y/Z)\twalk.trc"
    assert (values["NumFrames"], values["NumMarkers"], values["Units"]) == ("12", "23", "m")
    assert (values["DataRate"], values["OrigDataRate"]) == ("30", "30")
    assert len(markers) == 23
    np.testing.assert_array_equal(numbers, np.arange(1, 13))
    np.testing.assert_allclose(times_s, motion.timestamps, atol=1e-6)
    world = joints_world(motion)
    for name, joint in {"RKnee": "right_knee", "LWrist": "left_wrist", "Neck": "neck"}.items():
        x, y, z = world[:, whole_body.joint_names.index(joint)].T
        np.testing.assert_allclose(markers[name], np.stack([y, z, x], 1), atol=2e-5)
    middle = (markers["RHip"] + markers["LHip"]) / 2
    np.testing.assert_allclose(markers["Hip"], middle, atol=2e-6)
    assert (markers["Nose"][:, 1] > markers["Neck"][:, 1]).all()
    assert (markers["RHeel"][:, 1] < markers["RKnee"][:, 1]).all()


def test_a_variable_rate_becomes_constant(whole_body, make_motion):
    steady = make_motion(whole_body, 9)
    kept = np.array([0, 1, 2, 4, 5, 8])
    varying = make_motion(whole_body, timestamps=kept / 30)
    *_, times_s, markers = read(trc_text("a.trc", varying, whole_body))
    *_, expected = read(trc_text("a.trc", steady, whole_body))
    np.testing.assert_allclose(times_s, np.arange(9) / 30, atol=1e-6)
    np.testing.assert_allclose(markers["LKnee"][kept], expected["LKnee"][kept], atol=2e-6)
    between = (expected["LKnee"][2] + expected["LKnee"][4]) / 2
    assert markers["LKnee"][3] == pytest.approx(between, abs=2e-6)
