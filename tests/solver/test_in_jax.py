# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit as a function in JAX, with the gradient of its solution. Within `jax.jit`, both functions
need `jax.pure_callback`.
"""

import numpy as np
import pytest
from scope import solver

from . import person

jax = pytest.importorskip("jax")

BODY = solver.load_body("scope")
EXACT = solver.Options(stages=[solver.Stage(tolerance=0.0, max_iterations=200)])
POINTS = "keypoints3d.points"


def measured(points):
    return solver.Measurements(keypoints3d=solver.Keypoints3D(BODY.joint_names, np.array(points)))


def solve(points):
    """Return the joints (24, 3) of the body that fits points (24, 3), and what `gradient` needs."""
    first = solver.fit(BODY, measured(points)).state
    fit = solver.fit(BODY, measured(points), init=first, options=EXACT)
    return jax.numpy.asarray(fit.t_camera_part), (points, *vars(fit.state).values())


def gradient(kept, loss):
    points, *arrays = kept
    state = solver.State(*map(np.array, arrays))
    found = solver.solution_gradient(
        BODY, measured(points), state, np.array(loss), [POINTS], options=EXACT
    )
    return (jax.numpy.asarray(found[POINTS]),)


fitted_joints = jax.custom_vjp(lambda points: solve(points)[0])
fitted_joints.defvjp(solve, gradient)


def test_the_gradient_in_jax_is_that_of_differences():
    points = person.place(BODY, person.pose(BODY, seed=3))[1]
    points = points + 0.01 * np.random.default_rng(0).standard_normal(points.shape)
    along = np.random.default_rng(1).standard_normal(points.shape)

    def loss(points):
        return (fitted_joints(points)[20] ** 2).sum()

    found = np.asarray(jax.grad(loss)(jax.numpy.array(points)))
    ahead, behind = (float(loss(points + step * along)) for step in (5e-3, -5e-3))
    assert (found * along).sum() == pytest.approx((ahead - behind) / 1e-2, rel=0.02)
