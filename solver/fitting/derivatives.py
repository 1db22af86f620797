# SPDX-License-Identifier: Apache-2.0
"""How a solution changes with what was measured and with the weights, by the implicit function
theorem.

At a minimum x(m) of the cost E(x, m) the gradient g(x, m) = dE/dx vanishes, so that
    H dx/dm = -dg/dm,   H = dg/dx
with the whole Hessian H: that of Gauss-Newton leaves out the curvature of residuals and robust
kernels. g is exact; H, symmetric, and dg/dm are its central differences, in 2 (n + numbers)
linearizations. The gradient of a loss L(x) needs no H, but one adjoint a, H a = dL/dx, of which
    dL/dm = -(dg/dm)ᵀ a
It is found by conjugate gradients, each with H p as a difference of g, and preconditioned by the
recursion's Gauss-Newton step: each step in O(K + N). dg/dm takes a linearization, O(K + N), for
each number.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import as_array, as_numbers
from ..errors import InvalidValueError
from ..gauss_newton.terms import make_terms
from ..measurements import Measurements
from ..options import Options, Priors, default_priors
from ..part import Array
from ..points import numbered
from ..residuals.registry import NAMES, SHAPE_PRIOR, column_of, registered
from ..state import State
from ..tree import BodyArrays
from ..validation import check_finite, check_list, check_type
from .normal_equations import (
    gradient,
    motion_of_joints,
    moved,
    preconditioner,
    problem_of,
    remaining_decrease,
)

_STEP = 1e-5  # of the unknowns, radians, metres and shape
_SHARE = 1e-6  # by which a measured number is changed, of a standard deviation its share
_LEAST_CURVATURE = 1e-12  # smallest over largest eigenvalue of H: below, an unknown is not fixed
_ADJOINT = 1e-7  # of its norm, by which conjugate gradients miss the adjoint's equation
_UNSOLVED = 1e-3  # the same, of an adjoint that there is not
# Share of the cost, and cost, by which a step may still lower it: fits with the default tolerance
# have shares of up to 2e-4, those with other priors or weights than are given here 0.06 and more.
_LEFT_SHARE = 1e-2
_LEFT = 1e-3
_NO_MINIMUM = (
    "The derivatives of a solution need a minimum, where the cost rises in every direction; fit "
    "the same measurements with these priors and options and a tolerance of 0, and give priors of "
    "what was not measured."
)
_WEIGHTS = "weights"
# the measurements' numbers that a solution depends on smoothly
_MEASURED = {
    "keypoints2d": ("pixels", "confidence", "sigma_px"),
    "keypoints3d": ("points", "confidence", "sigma_m"),
    "orientation_field": ("directions", "confidence"),
    "pose_priors": ("t_camera_part", "weight_rotation", "weight_translation"),
    "foot_contacts": ("points", "probability"),
    "floor": ("offset", "contact"),
}
# those of which g is linear, like weights; a difference from 0 may not go below it
_LINEAR = ("confidence", "weight_rotation", "weight_translation", "probability", "contact")


@dataclass
class SolutionDerivatives:
    """Derivatives of a solution, each by the name that was asked for; the last axes are its own."""

    # (n, ...) of the unknowns of `NormalEquations`: the root's turn and place, joints, shape
    unknowns: dict[str, Array]
    joints: dict[str, Array]  # (K+1, 3, ...) of the joints' positions, camera frame, metres


def solution_derivatives(
    body: BodyArrays,
    measurements: Measurements,
    state: State,
    wrt: Sequence[str],
    *,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> SolutionDerivatives:
    """Return how the solution x of a frame changes with its measurements and weights m.

    By the implicit function theorem, dx/dm = -H^-1 dg/dm, with g and H the gradient and the Hessian
    of the cost.
    For a loss L of the joints, np.tensordot(dL, derivatives.joints[name], 2) is its gradient.

    :param state: the solution: where the gradient of the cost vanishes. That of a fit whose
        `Options` have a tolerance of 0 is exact.
    :param wrt: names: of measured numbers, "keypoints2d.pixels" or "keypoints3d.sigma_m", as they
        are given in `measurements`; of weights, "weights.keypoints3d" or "weights.shape", the
        fields of `Weights`, or of a registered residual. A derivative has the shape of what it is
        named after, before which stand the axes of `SolutionDerivatives`.
    :param priors, options: those of the fit.
    :raises ShapeError: an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use, a name of nothing that was given, or the
        measurements and priors do not fix the solution.
    """
    check_list(wrt, "wrt", "derivative")
    problem = _Problem(body, measurements, state, priors, options)
    H = problem.hessian()
    curvatures = np.linalg.eigvalsh(H)
    if not curvatures[0] > _LEAST_CURVATURE * curvatures[-1]:
        raise InvalidValueError(_NO_MINIMUM)
    motion = motion_of_joints(problem.tree, state.pose(problem.tree))
    unknowns = {}
    for name in wrt:
        mixed = problem.mixed(name)
        change = -np.linalg.solve(H, mixed.reshape(len(H), -1))
        unknowns[name] = change.reshape(mixed.shape)
    joints = {name: np.tensordot(motion, change, 1) for name, change in unknowns.items()}
    return SolutionDerivatives(unknowns, joints)


def solution_gradient(
    body: BodyArrays,
    measurements: Measurements,
    state: State,
    loss: ArrayLike,
    wrt: Sequence[str],
    *,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> dict[str, Array]:
    """Return the gradient of a loss of a frame's solution with respect to its measurements and
    weights: the vector-Jacobian product of `solution_derivatives`, without its Hessian.

    :param loss: dL/dt (K+1, 3), by the joints' positions in the camera frame, per metre; or dL/dx
        (n,), by the unknowns of `NormalEquations`.
    :return: by the name of `wrt`, dL/dm of the shape of what was given.
    :raises ShapeError: an array does not fit the body.
    :raises InvalidValueError: as of `solution_derivatives`, whose other parameters these are.
    """
    check_list(wrt, "wrt", "gradient")
    problem = _Problem(body, measurements, state, priors, options)
    motion = motion_of_joints(problem.tree, state.pose(problem.tree))
    if np.ndim(loss) == 1:
        by_unknowns = as_array(loss, motion.shape[2:], "loss")
    else:
        by_joints = as_array(loss, motion.shape[:2], "loss, by joints or by all unknowns,")
        by_unknowns = np.tensordot(by_joints, motion, 2)
    check_finite(by_unknowns, "loss")
    adjoint = problem.adjoint(by_unknowns)
    return {name: -np.tensordot(adjoint, problem.mixed(name), 1) for name in wrt}


class _Problem:
    """The gradient of a frame's cost as a function of state, measurements and weights."""

    def __init__(
        self,
        body: BodyArrays,
        measurements: Measurements,
        state: State,
        priors: Priors | None,
        options: Options,
    ) -> None:
        check_type(measurements, Measurements, "measurements")
        check_type(state, State, "state")
        self.measurements = numbered(body, measurements)
        self.state = state
        self.priors = default_priors(body) if priors is None else priors
        self.tree, self.terms, self.stage = problem_of(
            body, self.measurements, self.priors, options
        )
        decrease, cost = remaining_decrease(self.tree, self.terms, self.stage, state)
        if not decrease <= _LEFT_SHARE * cost + _LEFT:
            raise InvalidValueError(_NO_MINIMUM)

    def hessian(self) -> Array:
        """Return H (n, n)."""
        axes = np.eye(3 + 3 * len(self.tree.parents) + self.tree.shape_count)
        H: Array = np.array([self._hessian_along(axis) for axis in axes])
        return 0.5 * (H + H.T)

    def adjoint(self, loss: Array) -> Array:
        """Return a (n,) of H a = loss.

        :raises InvalidValueError: there is none, because an unknown is not fixed, or the cost does
            not rise in every direction.
        """
        step = preconditioner(self.tree, self.terms, self.stage, self.state)
        found: Array = np.zeros(len(loss))
        rest = loss
        direction = step(rest)
        size = float(rest @ direction)
        least = _ADJOINT**2 * size
        for _ in loss:
            if not size > least:
                break
            along = self._hessian_along(direction)
            curvature = float(direction @ along)
            if not curvature > 0.0:
                raise InvalidValueError(_NO_MINIMUM)
            found += size / curvature * direction
            rest = rest - size / curvature * along
            stepped = step(rest)
            size_before = size
            size = float(rest @ stepped)
            direction = stepped + size / size_before * direction
        missed = np.abs(self._hessian_along(found) - loss).max() if found.any() else 0.0
        if not missed <= _UNSOLVED * np.abs(loss).max(initial=0.0):
            raise InvalidValueError(_NO_MINIMUM)
        return found

    def _hessian_along(self, direction: Array) -> Array:
        """Return H p (n,)."""
        length = _STEP / np.abs(direction).max()
        ahead = self._gradient_at(moved(self.tree, self.state, length * direction))
        behind = self._gradient_at(moved(self.tree, self.state, -length * direction))
        along: Array = (ahead - behind) / (2.0 * length)
        return along

    def mixed(self, name: str) -> Array:
        """Return dg/dm (n, ...) of the numbers that a name stands for.

        :raises InvalidValueError: it stands for nothing that was given.
        """
        kind, _, of = str(name).partition(".")
        if kind == _WEIGHTS:
            return self._of_weight(name, of)
        given = getattr(self.measurements, kind, None) if kind in _MEASURED else None
        value = getattr(given, of) if of in _MEASURED.get(kind, ()) and given is not None else None
        if value is None:
            known = [f"{one}.{each}" for one, fields in _MEASURED.items() for each in fields]
            raise InvalidValueError(
                f"There is no derivative with respect to {name!r}, which was not measured; choose "
                f"of those that were among {', '.join(known)}, and weights, such as "
                "'weights.keypoints3d'."
            )
        values = as_numbers(value, name)
        at_state = self._gradient_at(self.state)
        columns = np.empty((values.size, len(at_state)))
        for k in range(values.size):
            if of in _LINEAR:
                columns[k] = self._gradient_of(kind, given, of, values, k, 1.0) - at_state
                continue
            step = _SHARE * abs(values.flat[k]) if of.startswith("sigma") else _SHARE
            ahead = self._gradient_of(kind, given, of, values, k, step)
            behind = self._gradient_of(kind, given, of, values, k, -step)
            columns[k] = (ahead - behind) / (2.0 * step)
        return columns.T.reshape(-1, *values.shape)

    def _of_weight(self, name: str, kind: str) -> Array:
        """Return dg/dw (n,): g is linear in each weight."""
        if kind == "shape":
            column = SHAPE_PRIOR
        else:
            if kind not in NAMES:
                registered(kind)
            column = column_of(kind)
        alone = np.zeros_like(self.stage)
        alone[1] = self.stage[1]
        alone[0, column] = 1.0
        return gradient(self.tree, self.terms, alone, self.state)

    def _gradient_at(self, state: State) -> Array:
        return gradient(self.tree, self.terms, self.stage, state)

    def _gradient_of(
        self, kind: str, given: Any, of: str, values: Array, k: int, step: float
    ) -> Array:
        """Return g (n,) with number k of the values changed by a step."""
        changed = values.copy()
        changed.flat[k] += step
        value = changed if changed.ndim else float(changed)
        measurements = replace(self.measurements, **{kind: replace(given, **{of: value})})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what is unlikely was told of the measurements
            terms = make_terms(self.tree, measurements, self.priors)
        return gradient(self.tree, terms, self.stage, self.state)
