# SPDX-License-Identifier: GPL-3.0-or-later
"""The learned curvature makes the steps of a clip fewer."""

from dataclasses import replace

import numpy as np
import pytest
from scope.solver import (
    Keypoints2D,
    Measurements,
    MotionPrior,
    Options,
    Stage,
    State,
    Weights,
    fit_motion,
    load_body,
    rotations,
)

from .. import person

STIFF = MotionPrior(joints=1.0, root_rotation=1.0, root_position=30.0, pose_memory=0.0)


def both_fits(seed):
    """Fits of one clip, seen in 2D with noise, with the learned curvature and without it."""
    body = load_body("scope")
    rng = np.random.default_rng(seed)
    index = list(body.keypoint_set("blazepose").values())
    first = person.pose(body, seed=1)
    frames = []
    starts = []
    times = np.arange(6) / 30
    for t in times:
        bent = first.Omega @ rotations.exp(2.0 * t * rng.standard_normal((1, 3)))
        state = State(first.R_camera_root, first.t_camera_root, bent, first.beta)
        R, joints = person.place(body, state)
        pixels = person.project(body.keypoints(R, joints, state.beta, index))
        pixels = pixels + 4.0 * rng.standard_normal(pixels.shape)
        keypoints = Keypoints2D(index, pixels, np.ones(len(index)))
        frames.append(Measurements(person.INTRINSICS, keypoints))
        starts.append(replace(state, Omega=first.Omega))
    options = Options(stages=[Stage(Weights(keypoints2d=1e5, joint_prior=4.0), 1e-9, 200)])
    given = {"init": starts, "shape": first.beta, "motion": STIFF}
    learned = fit_motion(body, frames, times, options=options, **given)
    plain = fit_motion(body, frames, times, options=replace(options, curvature=False), **given)
    return learned, plain


@pytest.mark.slow
def test_a_cost_as_low_in_fewer_steps():
    """In the median: depth is free in 2D, so that both may end in different minima of one clip,
    some of which neither finds in 200 steps.
    """
    fits = [both_fits(seed) for seed in range(5)]
    assert np.median([learned.iterations / plain.iterations for learned, plain in fits]) < 0.8
    assert np.median([learned.cost / plain.cost for learned, plain in fits]) < 1.0 + 1e-5
