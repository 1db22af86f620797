# SPDX-License-Identifier: GPL-3.0-or-later
"""A clip's objective: what its weights mean, and that of a part of the clip."""

from dataclasses import replace

import numpy as np
from scope.solver import rotations

from .clips import K, noisy_clip


def test_a_weight_means_the_same_at_any_frame_rate():
    """Of one motion sampled twice as often, the integrals hardly change."""
    costs = []
    for frames in (60, 120):
        clip = noisy_clip(3, frames=frames, cameras=1)
        times = np.linspace(0.0, 2.0, frames)
        for f, t in enumerate(times):
            s = clip.starts[0]
            angle = 0.3 * np.sin(3.0 * t) * np.ones((K, 3))
            clip.starts[f] = type(s)(
                rotations.exp(np.array([0.0, 0.5 * np.sin(2.0 * t), 0.0])),
                np.array([0.2 * np.sin(4.0 * t), 0.0, 4.0]),
                rotations.exp(angle),
                s.beta,
            )
        clip.times = times
        problem, poses, system = clip.problem(focal=False)
        problem.motion.probability[1:] = 0.5
        problem.linearize(0, poses, system)
        costs.append((problem.costs["acceleration"], problem.costs["contact"]))
    np.testing.assert_allclose(costs[0], costs[1], rtol=0.05)


def test_a_part_of_a_clip_knows_nothing_of_the_frame_before_it():
    """Its Hessian and gradient are those of a clip that begins there; standing points had added to
    the first frame's Hessian, without a cost.
    """
    clip = noisy_clip(2, frames=7)
    problem, _, _ = clip.problem()
    first = 3
    later = replace(
        clip,
        starts=clip.starts[first:],
        times=clip.times[first:],
        pixels=[each[first:] for each in clip.pixels],
        points=clip.points[first:],
        stands=replace(clip.stands, probability=clip.stands.probability[first:]),
    )
    alone, poses, expected = later.problem()
    alone.linearize(0, poses, expected)
    part, poses, found = later.problem()
    part.motion = problem.motion.part(slice(first, 7))
    part.linearize(0, poses, found)
    np.testing.assert_allclose(found.D, expected.D, rtol=1e-12)
    np.testing.assert_allclose(found.N, expected.N, rtol=1e-12)
