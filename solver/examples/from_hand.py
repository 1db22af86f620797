# SPDX-License-Identifier: GPL-3.0-or-later
"""An SMPL+H hand: 21 keypoints of one hand in space, 51 joints in the tree, the rest known by its
joints.
"""

import numpy as np

from .. import Keypoints3D, Measurements, fit, load_body, rotations
from . import person


def main() -> float:
    """Fit, print, and return the mean error of the left hand's joints in millimetres."""
    body = load_body("scope_h")
    truth = person.pose(body, seed=7)
    fingers = [
        i
        for i, name in enumerate(body.joint_names)
        if name.startswith("left_") and name[-1] in "123"
    ]
    # about the finger's own axis: the palm of the left hand faces down
    grip = rotations.exp([0.0, 0.0, -0.6])
    for i in fingers:
        truth.Omega[i - 1] = truth.Omega[i - 1] @ grip
    R, t = person.place(body, truth)

    M = len(body.keypoint_names)
    hand = [k for k, name in enumerate(body.keypoint_names) if name.startswith("hand/left_")]
    torso = [M + i for i, name in enumerate(body.joint_names[:22])]
    index = np.array(hand + torso)
    points = np.concatenate([body.keypoints(R, t, truth.beta), t])[index]
    points += 0.002 * np.random.default_rng(8).standard_normal(points.shape)
    found = fit(body, Measurements(keypoints3d=Keypoints3D(index, points, np.ones(len(index)))))

    error = float(np.linalg.norm(found.t_camera_part[fingers] - t[fingers], axis=1).mean() * 1e3)
    print(f"{found.status.name}: {len(fingers)} finger joints off by {error:.1f} mm on average")
    return error


if __name__ == "__main__":
    main()
