# SPDX-License-Identifier: GPL-3.0-or-later
"""Random bodies, states and measurements for the solver's tests."""

from dataclasses import dataclass

import numpy as np
from scope.solver import rotations
from scope.solver.residuals import joint_flow


@dataclass
class RandomBody:
    """A random tree with keypoints; no mesh."""

    parents: np.ndarray
    S: np.ndarray
    l: np.ndarray
    keypoint_part: np.ndarray
    v_bar: np.ndarray
    V: np.ndarray


def random_body(rng, K=23, P=10, M=40, shape=0.02):
    """Return a random tree of K joints; the M keypoints are spread evenly over the parts, every V_j
    non-zero.
    """
    parents = np.array([-1] + [rng.integers(max(0, i - 4), i) for i in range(1, K + 1)])
    part = np.sort(np.arange(M) % (K + 1))
    return RandomBody(
        parents,
        shape * rng.standard_normal((K + 1, 3, P)),
        0.15 * rng.standard_normal((K + 1, 3)),
        part,
        0.15 * rng.standard_normal((M, 3)),
        shape * rng.standard_normal((M, 3, P)),
    )


def forward(body, R0, t0, Omega, beta):
    """Return R (K+1, 3, 3), t (K+1, 3) and keypoints (M, 3), straight from the definition;
    complex-safe.
    """
    n = len(body.parents)
    R = [R0]
    t = [t0]
    for i in range(1, n):
        j = body.parents[i]
        R.append(R[j] @ Omega[i - 1])
        t.append(t[j] + R[j] @ (body.S[i] @ beta + body.l[i]))
    R = np.array(R)
    t = np.array(t)
    part = body.keypoint_part
    points = np.einsum("mij,mj->mi", R[part], body.V @ beta + body.v_bar) + t[part]
    return R, t, points


def random_state(rng, K, P, angle=0.4, distance=4.0):
    """Return R0, t0, Omega, beta."""
    return (
        rotations.exp(rng.standard_normal(3)),
        np.array([0.3, -0.2, distance]) + 0.2 * rng.standard_normal(3),
        rotations.exp(angle * rng.standard_normal((K, 3))),
        rng.standard_normal(P),
    )


INTRINSICS = np.array([[1100.0, 0.0, 640.0], [0.0, 1080.0, 360.0], [0.0, 0.0, 1.0]])


def project(points, intrinsics=INTRINSICS):
    """Return pixels (n, 2) of points (n, 3) in the camera frame."""
    p = points @ intrinsics.T
    return p[:, :2] / p[:, 2:]


def random_flow(rng, mean, bend=0.3):
    """Return parameters (SIZE,) of a joint flow about `mean` (3, 3), far from linear."""
    p = np.zeros(joint_flow.SIZE)
    p[:9] = np.ravel(mean)
    for k in range(joint_flow.LAYERS):
        values = {
            name: bend * rng.standard_normal(shape)
            for name, shape in joint_flow.LAYER_SHAPES.items()
        }
        values["A"] = rotations.exp(rng.standard_normal(3)) @ (np.eye(3) + 0.2 * np.tri(3))
        values |= {
            name: rng.standard_normal(np.shape(values[name])) for name in ("W2", "W3", "c2", "c3")
        }
        values["beta"] = rng.uniform(-0.7, 0.7, 3)
        at = joint_flow.FIRST_LAYER + k * joint_flow.LAYER_SIZE
        p[at : at + joint_flow.LAYER_SIZE] = np.concatenate([np.ravel(v) for v in values.values()])
    p[joint_flow.LAST : joint_flow.LAST + 12] = np.append(2.0 * np.eye(3), rng.standard_normal(3))
    matrices = [p[joint_flow.LAST : joint_flow.LAST + 9]]
    matrices += [
        p[joint_flow.FIRST_LAYER + k * joint_flow.LAYER_SIZE :][:9]
        for k in range(joint_flow.LAYERS)
    ]
    p[joint_flow.CONSTANT] = sum(
        np.log(abs(np.linalg.det(A.reshape(3, 3)))) for A in matrices
    ) - np.log(2 / np.pi**2)
    p[joint_flow.BOUND] = joint_flow.transform(p, mean)[2] + 1.0
    return p
