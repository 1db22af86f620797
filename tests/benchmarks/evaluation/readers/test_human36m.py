# SPDX-License-Identifier: GPL-3.0-or-later
"""Human3.6M's layout: compressed CDF files in millimetres beside videos."""

import numpy as np
from scope.benchmarks.evaluation.joint_sets import LSP14
from scope.benchmarks.evaluation.models import Models
from scope.benchmarks.evaluation.readers.human36m import clips

from ..made_data import K, write_cdf, write_h36m

JOINTS = np.random.default_rng(0).normal(scale=500, size=(12, 32, 3)) + [0, 0, 5000]
FRONTAL = "Walking 1.60457274"


def write(root, **options):
    write_h36m(root, JOINTS, "S9", FRONTAL, **options)
    return write_h36m(root, JOINTS, "S11", "Directions.54138969", **options)


def test_every_fifth_frame_in_metres(tmp_path):
    write(tmp_path)
    write_cdf(
        tmp_path / "S9/MyPoseFeatures/D3_Positions_mono/_ALL.60457274.cdf",
        "Pose",
        np.zeros((1, 2, 96)),
    )
    first, second = clips(tmp_path, Models())
    assert (first.name, first.protocols) == (f"S9 {FRONTAL}", ("h36m-p1", "h36m-p2"))
    assert (second.name, second.protocols) == ("S11 Directions.54138969", ("h36m-p1",))
    truth = first.truth()
    (person,) = truth.people
    assert person.rows.tolist() == [0, 5, 10]
    # Numbers of the data set's own skeleton: the right side first, as in its documentation.
    by_number = {
        "right_hip": 1,
        "right_ankle": 3,
        "left_knee": 7,
        "left_wrist": 19,
        "right_elbow": 26,
        "head_top": 15,
    }
    for name, number in by_number.items():
        assert name in LSP14
        assert np.allclose(
            person.camera.joints([name])[2, 0], JOINTS[10, number] / 1000, atol=1e-6
        ), name
    assert np.allclose(person.camera.joints(["neck"])[0, 0], JOINTS[0, 24] / 1000, atol=1e-6)
    assert np.allclose(truth.intrinsics, K, atol=0.01)
