# SPDX-License-Identifier: GPL-3.0-or-later
"""SMPL-style parameters from 3D joints, such as another tracker's, with 5 mm of noise."""

import numpy as np

from .. import Keypoints3D, Measurements, Options, Stage, Weights, fit, load_body, rotations
from . import person

NOISE_M = 0.005


def main() -> float:
    """Fit, print, and return the mean error of the joints in millimetres."""
    body = load_body("scope")
    truth = person.pose(body)
    joints = person.place(body, truth)[1]
    joints = joints + NOISE_M * np.random.default_rng(1).standard_normal(joints.shape)

    M = len(body.keypoint_names)  # points are numbered: keypoints first, then joints
    measured = Keypoints3D(
        indices=M + np.arange(body.K + 1), points=joints, confidence=np.ones(body.K + 1)
    )
    # Weights are one over a variance: this good measurement counts for more than a detector's,
    # which are the default.
    weights = Weights(keypoints3d=1.0 / NOISE_M**2, shape=1.0, joint_limits=100.0)
    found = fit(body, Measurements(keypoints3d=measured), options=Options(stages=[Stage(weights)]))

    error = person.joint_error_mm(body, found.t_camera_part, truth)
    poses = np.concatenate(
        [rotations.log(found.state.R_camera_root)[None], rotations.log(found.state.Omega)]
    )
    print(
        f"{found.status.name} after {found.iterations} iterations; joints off by {error:.1f} mm "
        "on average"
    )
    print(
        f"poses (72,) begin {poses.ravel()[:6].round(3)}, betas begin "
        f"{found.state.beta[:3].round(2)}"
    )
    return error


if __name__ == "__main__":
    main()
