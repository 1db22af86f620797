# SPDX-License-Identifier: GPL-3.0-or-later
"""A person whose pose and shape are known, and what a camera, a lab or a network would see of
them.
"""

import numpy as np
from numpy.typing import NDArray
from scope.solver import Body, State, rotations

INTRINSICS = np.array([[1400.0, 0.0, 960.0], [0.0, 1400.0, 540.0], [0.0, 0.0, 1.0]])


# Axis-angle vectors in radians of a person in mid-stride; joints that are not named are near their
# rest pose.
STRIDE = {
    "left_hip": (-0.5, 0.0, 0.05), "right_hip": (0.25, 0.0, -0.05), "left_knee": (0.4, 0.0, 0.0),
    "right_knee": (0.6, 0.0, 0.0), "left_shoulder": (0.1, -0.3, -1.1),
    "right_shoulder": (0.1, 0.4, 1.1),
    "left_elbow": (0.0, -0.7, 0.0), "right_elbow": (0.0, 0.5, 0.0), "spine2": (0.1, 0.1, 0.0),
}  # fmt: skip


def pose(body: Body, seed: int = 0, bend: float = 0.05) -> State:
    """Return a stride 3.5 m before the camera, turned a little, every joint `bend` radians off it
    at random.
    """
    rng = np.random.default_rng(seed)
    stride = np.array([STRIDE.get(name, (0.0, 0.0, 0.0)) for name in body.joint_names[1:]])
    upright = np.diag([1.0, -1.0, -1.0])  # the body's y up is the camera's y down
    return State(
        R_camera_root=upright @ rotations.exp([0.0, 0.5, 0.1]),
        t_camera_root=np.array([0.1, -0.1, 3.5]),
        Omega=rotations.exp(stride + bend * rng.standard_normal((body.K, 3))),
        beta=rng.standard_normal(body.P),
    )


def place(body: Body, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return R_camera_part (K+1, 3, 3) and the joints t_camera_part (K+1, 3)."""
    R = np.concatenate([state.R_camera_root[None], state.Omega])
    return body.forward_kinematics(
        R, state.t_camera_root - body.rest_joints(state.beta)[0], state.beta
    )


def project(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return pixels (n, 2) of points (n, 3) in the camera frame."""
    p = points @ INTRINSICS.T
    pixels: NDArray[np.float64] = p[:, :2] / p[:, 2:]
    return pixels
