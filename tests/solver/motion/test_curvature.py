# SPDX-License-Identifier: GPL-3.0-or-later
"""The learned curvature makes the steps of a clip fewer."""

from dataclasses import replace

import numpy as np
from scope.solver import Keypoints2D, Measurements, Options, Stage, State, Weights, fit_motion, load_body, rotations
from scope.solver.examples import person


def test_a_cost_as_low_in_fewer_steps():
    body, rng = load_body("scope"), np.random.default_rng(0)
    index = list(body.keypoint_set("blazepose").values())
    first = person.pose(body, seed=1)
    frames, starts, times = [], [], np.arange(6) / 30
    for t in times:
        bent = first.Omega @ rotations.exp(2.0 * t * rng.standard_normal((1, 3)))
        state = State(first.R_camera_root, first.t_camera_root, bent, first.beta)
        R, joints = person.place(body, state)
        pixels = person.project(body.keypoints(R, joints, state.beta, index)) + 4.0 * rng.standard_normal(
            (len(index), 2)
        )
        frames.append(Measurements(person.INTRINSICS, Keypoints2D(index, pixels, np.ones(len(index)))))
        starts.append(replace(state, Omega=first.Omega))
    options = Options(stages=[Stage(Weights(keypoints2d=1e5, joint_prior=4.0), 1e-9, 200)])
    given = {"init": starts, "shape": first.beta}
    learned = fit_motion(body, frames, times, options=options, **given)
    plain = fit_motion(body, frames, times, options=replace(options, curvature=False), **given)
    assert learned.iterations < 0.7 * plain.iterations
    assert learned.cost < (1.0 + 1e-5) * plain.cost
