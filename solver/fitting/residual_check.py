# SPDX-License-Identifier: Apache-2.0
"""`check_residual`: whether the blocks of a registered residual are those of its cost."""

from typing import Any

import numpy as np

from ..errors import InvalidValueError
from ..gauss_newton.terms import make_terms
from ..measurements import Measurements
from ..options import Options, Priors, Stage, Weights
from ..rotations import exp
from ..state import State
from ..tree import BodyArrays, Tree, make_tree
from ..validation import check_count, check_type
from .normal_equations import equations, moved

_STEP = 1e-5  # of the differences, radians and metres
_UNEXPLAINED = 1e-6  # of the gradient, outside the range of JᵀJ: more is no rounding
_OTHERS_OFF = {"joint_prior": 0.0, "joint_limits": 0.0, "joint_flow": 0.0, "shape": 0.0}


def check_residual(
    body: BodyArrays, name: str, ints: Any, floats: Any, *, seed: int = 0
) -> dict[str, float]:
    """Compare the derivatives that a registered residual returns with differences of its cost, at a
    random state.

    A wrong Jacobian makes a fit slow, or stops it away from the minimum, without any error. The
    differences are relative to the largest derivative: with the right Jacobian they are below 1e-5,
    unless the residual has a kink.

    :param ints, floats: rows for `name`, as in `Measurements.tables`.
    :param seed: of the state: the root 3 m in front of the camera, joints rotated by about 50°, the
        shape as varied as the population's.
    :return: the largest difference for the root's six unknowns ("root"), the joints' rotations
        ("joints") and the shape ("shape"), and by how much JᵀJ is too small for them: gᵀ (JᵀJ)⁺ g /
        2 cost - 1, with g = Jᵀr ("curvature"); infinite where JᵀJ is missing.
    :raises ShapeError: the rows do not fit the residual or the body.
    :raises InvalidValueError: there is no residual of that name, its kernel does not compile, or
        its cost is 0 or not finite at that state, where derivatives say nothing; its Jᵀr or JᵀJ is
        not finite there; or the seed is not a whole number of at least 0.
    """
    check_type(name, str, "name")
    check_count(seed, "seed", 0)
    tree = make_tree(body)
    terms = make_terms(tree, Measurements(tables={name: (ints, floats)}), Priors())
    alone = Weights(tables={name: 1.0}, **_OTHERS_OFF)
    stage = Options().stage_table([Stage(alone)])[0][0]
    state = _random_state(tree, seed)
    at_state = equations(tree, terms, stage, state)
    cost = at_state.cost
    g = at_state.g
    H = at_state.H
    found = np.zeros(len(g))
    if not 0.0 < cost < np.inf:
        raise InvalidValueError(
            f"The cost of {name!r} must be positive and finite to be differentiated, but is "
            f"{cost:g} at the random "
            f"state of seed {seed}; use other rows or another seed."
        )
    if not (np.isfinite(g).all() and np.isfinite(H).all()):
        raise InvalidValueError(
            f"The derivatives Jᵀr and JᵀJ of {name!r} must be finite, but hold NaN or infinity at "
            "the random state of "
            f"seed {seed}."
        )
    for k, step in enumerate(_STEP * np.eye(len(g))):
        ahead = equations(tree, terms, stage, moved(tree, state, step)).cost
        behind = equations(tree, terms, stage, moved(tree, state, -step)).cost
        found[k] = (ahead - behind) / (2.0 * _STEP)
    off = np.abs(g - found) / max(np.abs(found).max(), np.abs(g).max(), 1e-300)
    joints = 6 + 3 * (len(tree.parents) - 1)
    x = np.linalg.pinv(H, rcond=1e-10, hermitian=True) @ g
    # the pseudoinverse drops that part of g
    is_missing = np.linalg.norm(g - H @ x) > _UNEXPLAINED * np.linalg.norm(g)
    explained = np.inf if is_missing else float(g @ x) / (2.0 * cost)
    return {
        "root": float(off[:6].max()),
        "joints": float(off[6:joints].max(initial=0.0)),
        "shape": float(off[joints:].max(initial=0.0)),
        "curvature": max(0.0, explained - 1.0),
    }


def _random_state(tree: Tree, seed: int) -> State:
    rng = np.random.default_rng(seed)
    K = len(tree.parents) - 1
    place = np.array([0.0, 0.0, 3.0]) + 0.2 * rng.standard_normal(3)
    Omega = exp(0.5 * rng.standard_normal((K, 3)))
    return State(exp(rng.standard_normal(3)), place, Omega, rng.standard_normal(tree.shape))
