# SPDX-License-Identifier: GPL-3.0-or-later
"""Every residual once more, in plain numpy, straight from its equation: what its kernel is compared
with.

Each function is named after its residual's module, whose docstring has the equation, and returns
the residual (n,) without robust kernel. Points are given by `v_bar` (3,) and `V` (3, P), relative
to their part's origin, in metres.
"""

import numpy as np
from scope.solver.residuals import joint_flow as flow
from scope.solver.residuals.keypoint2d import Z_MIN
from scope.solver.rotations import log


def lever(part, v_bar, V):
    """Return where a point is from its part's origin, in camera axes."""
    return part.R @ (V @ part.beta + v_bar)


def keypoint2d(part, v_bar, V, uv):
    """Return two rows, or three behind z_min; uv (2,) normalized image coordinates."""
    p = lever(part, v_bar, V) + part.t
    r = p[:2] / max(p[2], Z_MIN) - uv
    return r if p[2] > Z_MIN else np.append(r, (Z_MIN - p[2]) / Z_MIN)


def keypoint3d(part, v_bar, V, point):
    """Return three rows, metres; of a contact too."""
    return lever(part, v_bar, V) + part.t - point


def orientation_field(part, v_bar, V, direction):
    """Return three rows; v_bar and V of the second point relative to the first."""
    d = lever(part, v_bar, V)
    return d / np.linalg.norm(d) - direction


def floor(part, v_bar, V, normal, offset, w_below, w_above):
    """Return one row; of the plane normal^T p = offset in camera axes, metres."""
    h = normal @ (lever(part, v_bar, V) + part.t) - offset
    return np.array([np.sqrt(w_below if h < 0.0 else w_above) * h])


def outline(part, v_bar, V, contour, normal, w_out, w_in):
    """Return one row; v_bar with delta, contour (2,) and its outward normal (2,)."""
    p = lever(part, v_bar, V) + part.t
    d = normal @ (p[:2] / p[2] - contour)
    return np.array([np.sqrt(w_out if d > 0.0 else w_in) * d])


def pose_prior(part, R_hat, t_hat, w_R, w_t):
    """Return three rows in radians and three in metres."""
    turn = np.sqrt(w_R) * log(R_hat.T @ part.R)
    return np.concatenate([turn, np.sqrt(w_t) * (part.t - t_hat)])


def joint_prior(part, Omega_mean):
    """Return three rows, radians."""
    return log(Omega_mean.T @ part.Omega)


def joint_flow(part, parameters):
    """Return three rows; parameters (SIZE,) of the joint."""
    return flow.transform(parameters, part.Omega)[0]


def joint_limits(part, axis, lower, upper, swing_limit, w, w_swing):
    """Return four rows, radians; axis (3,) a unit vector in the parent's rest axes."""
    phi = log(part.Omega)
    angle = axis @ phi
    beyond = max(0.0, angle - upper) - max(0.0, lower - angle)
    swing = phi - angle * axis
    share = max(0.0, 1.0 - swing_limit / max(np.linalg.norm(swing), 1e-12))
    return np.append(np.sqrt(w) * beyond, np.sqrt(w_swing) * share * swing)
