# SPDX-License-Identifier: GPL-3.0-or-later
"""The terms of a clip's views, laid out one after the other, are those that each view has alone."""

import numpy as np
from scope.solver import (
    Floor,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    OrientationField,
    Priors,
    View,
    make_tree,
    rotations,
)
from scope.solver.gauss_newton.terms import HAS_2D, HAS_3D, HAS_DIRECTION, make_terms, pack_priors
from scope.solver.motion.views import pack_frames, terms_of

from ..synthetic import INTRINSICS, random_body

K = 6
P = 3
M = 10


def seen(rng, points):
    """Measurements of some of the points, of which one is not usable."""
    n = len(points)
    confidence = np.r_[0.0, np.ones(n - 1)]
    joint = M + int(rng.integers(1, K + 1))
    return Measurements(
        INTRINSICS,
        Keypoints2D(points, 500.0 * rng.random((n, 2)), confidence),
        Keypoints3D(points[:2], rng.standard_normal((2, 3)), np.ones(2)),
        OrientationField([M], [joint], rng.standard_normal((1, 3)), np.ones(1))
        if len(points) > 3
        else None,
        floor=Floor(points[:1], np.array([0.0, -1.0, 0.0]), 0.1, np.ones(1))
        if len(points) % 2
        else None,
    )


def test_the_terms_of_every_view_are_those_it_has_alone():
    rng = np.random.default_rng(0)
    body = random_body(rng, K, P, M)
    body.parents[1:] = 0  # every joint hangs on the root, so that both ends of a direction do
    tree = make_tree(body)
    priors = Priors(limits=None)
    sets = [np.arange(5), np.arange(5), np.array([7, 2, 9]), np.arange(5), np.array([1, 4])]
    single = [seen(rng, some) for some in sets]
    pair = [
        View(seen(rng, sets[k]), rotations.exp(np.array([0.1, k, 0.0])), np.ones(3)) for k in (0, 2)
    ]
    frames = [*([View(m)] for m in single), pair, []]
    views, counts = pack_frames(tree, frames, pack_priors(tree, priors))
    flat = (
        [(m, priors) for m in single]
        + [(v.measurements, None) for v in pair]
        + [(Measurements(), priors)]
    )
    assert views.of_frame.tolist() == [0, 1, 2, 3, 4, 5, 7, 8]
    assert views.own_axes.tolist() == [True] * 5 + [False] * 2 + [True]
    assert (counts > 0).tolist() == [True] * 6 + [False]
    for v, (m, its_priors) in enumerate(flat):
        found = terms_of(views, v)
        expected = make_terms(tree, m, priors)
        np.testing.assert_array_equal(found.starts, expected.starts)
        np.testing.assert_array_equal(found.flags, expected.flags)
        np.testing.assert_array_equal(found.rest, expected.rest)
        np.testing.assert_array_equal(found.V, expected.V)
        for name, bit in (("image", HAS_2D), ("point", HAS_3D), ("direction", HAS_DIRECTION)):
            has = expected.flags & bit > 0
            np.testing.assert_array_equal(getattr(found, name)[has], getattr(expected, name)[has])
        for k, table in enumerate(expected.floats):
            if its_priors is not None or v == 5:  # the first view of a frame has the priors
                np.testing.assert_array_equal(found.ints[k], expected.ints[k])
                np.testing.assert_array_equal(found.floats[k], table)
    assert len(terms_of(views, 6).floats[1]) < len(terms_of(views, 5).floats[1])
