# SPDX-License-Identifier: GPL-3.0-or-later
"""Three calibrated cameras around a moving person: all frames and one shape at once, with the
joints' uncertainty.

Each camera has its own intrinsics and its own place in the world; in some frames nobody sees the
person.
"""

import numpy as np
from numpy.typing import NDArray

from .. import (
    Keypoints2D,
    Measurements,
    Options,
    Stage,
    State,
    View,
    Weights,
    fit_motion,
    load_body,
    rotations,
)
from . import person

RATE = 30.0
FRAMES = 24
NOISE_PX = 3.0
LOST = range(10, 14)


def cameras() -> list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """Return intrinsics (3, 3), R_camera_world (3, 3) and t_camera_world (3,) of each; the first is
    the world's.
    """
    found = []
    for angle, focal in ((0.0, 1100.0), (1.2, 900.0), (-1.4, 1300.0)):
        R = rotations.exp([0.0, angle, 0.0])
        pivot = np.array([0.0, 0.0, 4.0])  # they look at the same place
        K = np.array([[focal, 0.0, 640.0], [0.0, focal, 360.0], [0.0, 0.0, 1.0]])
        found.append((K, R, pivot - R @ pivot))
    return found


def main() -> float:
    """Fit, print, and return the mean error of the joints in millimetres."""
    body = load_body("scope")
    rng = np.random.default_rng(8)
    index = list(body.keypoint_set("blazepose").values())
    start = person.pose(body, seed=9)
    times = np.arange(FRAMES) / RATE
    frames: list[list[View]] = []
    truth = []
    for f, t in enumerate(times):
        swing = rotations.exp(
            np.outer(np.linspace(-0.3, 0.3, body.K), [0.3, 0.1, 1.0]) * np.sin(4.0 * t)
        )
        moved = start.t_camera_root + [0.4 * t, 0.02 * np.sin(9.0 * t), 0.2 * t]
        state = State(
            start.R_camera_root @ rotations.exp([0.0, 0.5 * t, 0.0]),
            moved,
            start.Omega @ swing,
            start.beta,
        )
        R, joints = person.place(body, state)
        truth.append(joints)
        points = body.keypoints(R, joints, state.beta, index)
        views = []
        for K, R_camera_world, t_camera_world in cameras() if f not in LOST else []:
            pixels = (points @ R_camera_world.T + t_camera_world) @ K.T
            pixels = pixels[:, :2] / pixels[:, 2:] + NOISE_PX * rng.standard_normal((len(index), 2))
            seen = Measurements(K, keypoints2d=Keypoints2D(index, pixels, np.ones(len(index))))
            views.append(View(seen, R_camera_world, t_camera_world))
        frames.append(views)

    # one over the variance of normalized coordinates
    weights = Weights(keypoints2d=(1100.0 / NOISE_PX) ** 2)
    found = fit_motion(
        body, frames, times, options=Options(stages=[Stage(weights)]), covariance=True
    )

    errors = 1e3 * np.linalg.norm(found.t_world_part - truth, axis=-1)
    assert found.joint_covariance is not None
    sigma = 1e3 * np.sqrt(np.trace(found.joint_covariance, axis1=2, axis2=3))
    lost = np.isin(np.arange(FRAMES), LOST)
    print(
        f"{found.status.name}: joints off by {errors[~lost].mean():.1f} mm on average where seen, "
        "expected "
        f"{sigma[~lost].mean():.1f}; {errors[lost].mean():.1f} mm where unseen, expected "
        f"{sigma[lost].mean():.1f}"
    )
    return float(errors.mean())


if __name__ == "__main__":
    main()
