# SPDX-License-Identifier: GPL-3.0-or-later
"""What Gauss-Newton leaves out of the joints' Hessians: learned exactly, added safely, and taken
away in the end.
"""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    FrameSolver,
    Keypoints3D,
    Measurements,
    Options,
    Stage,
    State,
    Weights,
    default_priors,
    fit,
    fit_clip,
    gauss_newton_step,
    make_tree,
    rotations,
)
from scope.solver.gauss_newton.curvature import (
    apply_correction,
    make_curvature,
    reset,
    set_current,
    update,
)
from scope.solver.gauss_newton.linearize import linearize, make_blocks, make_pose
from scope.solver.gauss_newton.optimizer import MIN_DAMPING
from scope.solver.gauss_newton.recursion import eliminate, make_workspace
from scope.solver.gauss_newton.terms import make_terms
from scope.solver.learned_prior import load_joint_prior
from scope.solver.part import GRADIENT
from scope.solver.residuals.registry import SHAPE_PRIOR

from ..fitting.test_normal_equations import problem
from ..synthetic import forward, random_body, random_state

K = 5


def symmetric(rng, n):
    A = rng.standard_normal((n, 3, 3))
    return A + np.swapaxes(A, 1, 2)


def upper(matrices):
    """The upper triangles (n, 6) of symmetric matrices, by rows."""
    return matrices[:, *np.triu_indices(3)]


def placed(rng, tree):
    """A pose whose parts are turned at random: axes of parents and camera differ."""
    pose = make_pose(tree)
    pose.R[:] = rotations.exp(2.0 * rng.standard_normal((K + 1, 3)))
    return pose


def filled(tree, pose, H, g):
    """Blocks of joint functions with Hessian H and gradient g, (K+1, ...) in the parents' axes."""
    blocks = make_blocks(tree)
    R = pose.R[tree.parents[1:]]
    blocks.H_uu[1:] = R @ H[1:] @ np.swapaxes(R, 1, 2)
    blocks.H_u[1:, :, GRADIENT] = np.einsum("iab,ib->ia", R, g[1:])
    return blocks


@pytest.fixture
def small():
    rng = np.random.default_rng(0)
    tree = make_tree(random_body(rng, K, 2, 0))
    return rng, tree, make_curvature(tree)


@pytest.mark.parametrize("accepted", [True, False])
def test_three_steps_teach_the_hessian_of_a_quadratic(small, accepted):
    """A rank-one update finds a symmetric 3 x 3 matrix from three independent steps, in whatever
    axes they come.
    """
    rng, tree, curvature = small
    true = symmetric(rng, K + 1)
    known = np.tile(2.0 * np.eye(3), (K + 1, 1, 1))
    at = rng.standard_normal((K + 1, 3))
    pose = placed(rng, tree)
    set_current(tree, pose, filled(tree, pose, known, np.einsum("iab,ib->ia", true, at)), curvature)
    for _ in range(12):  # some of them are too nearly orthogonal to teach anything
        w = 0.1 * rng.standard_normal((K + 1, 3))
        u = np.zeros((K + 1, 3))
        u[1:] = np.einsum("iab,ib->ia", pose.R[tree.parents[1:]], w[1:])
        trial = placed(rng, tree)
        trial_blocks = filled(tree, trial, known, np.einsum("iab,ib->ia", true, at + w))
        update(tree, pose, u, trial, trial_blocks, accepted, curvature)
        if accepted:
            pose = trial
            at = at + w
            set_current(tree, pose, trial_blocks, curvature)
    np.testing.assert_allclose(curvature.S[1:], upper((true - known)[1:]), atol=1e-8)
    # Residuals that couple joint and part teach nothing.
    blocks = filled(tree, pose, known, -at)
    blocks.cross[0] = 1
    update(tree, pose, u, placed(rng, tree), blocks, accepted, curvature)
    np.testing.assert_allclose(curvature.S[1:], upper((true - known)[1:]), atol=1e-8)
    reset(curvature)
    assert not curvature.S.any()


def test_what_is_solved_with_stays_above_a_share_of_gauss_newton(small):
    rng, tree, curvature = small
    for _ in range(20):
        J = rng.standard_normal((K + 1, 3, 3))
        H = J @ np.swapaxes(J, 1, 2)
        pose = placed(rng, tree)
        blocks = filled(tree, pose, H, np.zeros((K + 1, 3)))
        before = blocks.H_uu.copy()
        set_current(tree, pose, blocks, curvature)
        curvature.S[:] = upper(5.0 * symmetric(rng, K + 1))
        apply_correction(tree, pose, blocks, curvature, 1.0)
        assert np.linalg.eigvalsh(blocks.H_uu[1:] - 0.2 * before[1:]).min() > -1e-9
        apply_correction(tree, pose, blocks, curvature, 0.0)
        np.testing.assert_allclose(blocks.H_uu, before, atol=1e-12)
    for overflowed in (np.nan, 1e300):
        curvature.S[:] = overflowed
        apply_correction(tree, pose, blocks, curvature, 1.0)
        assert np.isfinite(blocks.H_uu).all()


def noisy(body, seed):
    """A start near, and noisy measurements of, a person whose joints are drawn from the learned
    prior.
    """
    rng = np.random.default_rng(seed)
    prior = load_joint_prior()
    R, t, _, beta = random_state(rng, 23, 10)
    Omega = np.array([prior.sample(name, 1, rng)[0] for name in body.joint_names[1:]])
    points = forward(body, R, t, Omega, beta)[2]
    seen = points + 0.02 * rng.standard_normal(points.shape)
    start = State(R, t, Omega @ rotations.exp(0.1 * rng.standard_normal((23, 3))), beta)
    return start, Measurements(
        keypoints3d=Keypoints3D(np.arange(len(seen)), seen, np.full(len(seen), 0.1))
    )


def test_the_default_stop_is_close_to_the_end(body):
    """Cost within 0.1 % and joints within 1 mm of the same start run to the end; Gauss-Newton alone
    stops short of that in one such frame of ten.
    """
    solver = FrameSolver(body)
    close = []
    end = Options(stages=(Stage(Weights(), 1e-13, 500),))
    for seed in range(20):
        start, m = noisy(body, seed)
        found, best = (solver.fit(m, start, None, o) for o in (Options(), end))
        apart = np.linalg.norm(found.t_camera_part - best.t_camera_part, axis=1).max()
        close.append(apart < 1e-3 and abs(found.cost / best.cost - 1.0) < 1e-3)
    assert np.mean(close) >= 0.95


def test_without_it_the_minimum_is_the_same(body):
    start, m = noisy(body, 1)  # of ten seeds, 0 alone has two minima near the start
    to_the_end = (Stage(Weights(), 1e-14, 1000),)
    found, plain = (
        fit(body, m, init=start, options=Options(to_the_end, curvature=on)) for on in (True, False)
    )
    assert plain.cost == pytest.approx(found.cost, rel=1e-8)
    np.testing.assert_allclose(plain.t_camera_part, found.t_camera_part, atol=1e-4)
    assert plain.iterations != found.iterations


def test_without_it_every_step_is_gauss_newtons():
    """Three steps, hardly damped; with it, the third is another."""
    body, start, seen, priors = problem(1, 7, 4, 30, noise=4.0)
    weights = Weights(joint_limits=0.0, joint_prior=4000.0)
    options = Options([Stage(weights, 0.0, 3)], damping=MIN_DAMPING, curvature=False)
    state = start
    for _ in range(3):
        given = {"priors": priors, "options": options, "damping": MIN_DAMPING}
        state = gauss_newton_step(body, seen, state, **given).state
    plain = fit(body, seen, init=start, priors=priors, options=options)
    assert (plain.iterations, plain.rejected) == (3, 0)
    for found, expected in zip(vars(plain.state).values(), vars(state).values(), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-7)
    learned = replace(options, curvature=True)
    other = fit(body, seen, init=start, priors=priors, options=learned)
    assert np.abs(other.state.Omega - state.Omega).max() > 1e-6


def test_clips_heed_the_option(body):
    _, m = noisy(body, 1)
    first, then = (
        fit_clip(body, [m, m], options=Options(curvature=on)).frames[0].state.Omega
        for on in (False, True)
    )
    assert np.abs(first - then).max() > 1e-9


def test_the_information_on_the_shape_is_gauss_newtons(body):
    """What was learned serves the steps; it does not stay in what the fit reports."""
    start, m = noisy(body, 3)
    found = fit(body, m, init=start)
    priors = default_priors(body)
    tree = make_tree(body)
    table, _, _ = Options().stage_table([Stage()])
    pose = found.state.pose(tree)
    blocks = make_blocks(tree)
    work = make_workspace(tree)
    linearize(tree, make_terms(tree, m, priors), table[0], pose, blocks, work.scratch)
    eliminate(tree, pose, blocks, MIN_DAMPING, 1.0 / 0.3, work)
    expected = work.C[:10, :10] - table[0, 0, SHAPE_PRIOR] * np.eye(10)
    np.testing.assert_allclose(
        found.beta_information, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max()
    )
