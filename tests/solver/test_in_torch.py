# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit as a function in PyTorch, with the gradient of its solution."""

import numpy as np
import pytest
from scope import solver

from . import person

torch = pytest.importorskip("torch")

BODY = solver.load_body("scope")
EXACT = solver.Options(stages=[solver.Stage(tolerance=0.0, max_iterations=200)])
POINTS = "keypoints3d.points"


def measured(points):
    return solver.Measurements(keypoints3d=solver.Keypoints3D(BODY.joint_names, points))


class FittedJoints(torch.autograd.Function):  # type: ignore[name-defined]
    """The joints (24, 3) of the body that fits points (24, 3)."""

    @staticmethod
    def forward(context, points):
        context.points = points.detach().double().cpu().numpy()
        first = solver.fit(BODY, measured(context.points)).state
        fit = solver.fit(BODY, measured(context.points), init=first, options=EXACT)
        context.state = fit.state
        return points.new_tensor(fit.t_camera_part)

    @staticmethod
    def backward(context, loss):
        found = solver.solution_gradient(
            BODY,
            measured(context.points),
            context.state,
            loss.double().cpu().numpy(),
            [POINTS],
            options=EXACT,
        )
        return loss.new_tensor(found[POINTS])


def test_the_gradient_in_torch_is_that_of_differences():
    points = person.place(BODY, person.pose(BODY, seed=3))[1]
    points = points + 0.01 * np.random.default_rng(0).standard_normal(points.shape)
    along = torch.tensor(np.random.default_rng(1).standard_normal(points.shape))
    given = torch.tensor(points, requires_grad=True)

    def loss(points):
        return (FittedJoints.apply(points)[20] ** 2).sum()

    loss(given).backward()
    with torch.no_grad():
        ahead, behind = (float(loss(given + step * along)) for step in (1e-4, -1e-4))
    assert float((given.grad * along).sum()) == pytest.approx((ahead - behind) / 2e-4, rel=1e-4)
