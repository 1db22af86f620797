# SPDX-License-Identifier: Apache-2.0
"""How to fit: weights, stages, robust kernels, damping, and the priors on joints and shape."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .errors import InvalidValueError
from .learned_prior import load_joint_prior
from .measurements import SIGMA_2D, SIGMA_3D
from .part import Array
from .residuals import joint_limits, joint_prior
from .residuals.registry import COLUMNS, FIRST_EXTERNAL, RESIDUALS, column_of, registered
from .validation import (
    as_finite,
    as_number,
    check_count,
    check_information,
    check_list,
    check_not_negative,
    check_robust,
    check_rotations,
    check_switch,
    check_type,
    check_weight,
    warn_of_kernel,
    warn_of_weight,
)


@dataclass(frozen=True)
class Weights:
    """Weight 1/sigma^2 of each kind of residual, on 1/2 |r|^2: sigma is the standard deviation of
    what was measured with confidence 1, or of what is expected.

    keypoints2d: per squared normalized image coordinate, pixels over focal length; 1e6 is a pixel
    at a focal length of 1000. keypoints3d, foot_contact, floor: per metre^2; 1e4 is a centimetre.
    orientation_field: per squared difference of unit vectors, joint_prior and joint_limits: per
    radian^2. joint_flow multiplies a density's exponent, and shape the population's, so that 1 is
    what was learned of people; to draw a fit to the population more than is likely, `regularized`.
    pose_prior and the tables weigh what their rows say. `tables`: of further registered residuals
    by name, 1 if left out.
    """

    keypoints2d: float = SIGMA_2D**-2
    keypoints3d: float = SIGMA_3D**-2
    orientation_field: float = 2500.0
    pose_prior: float = 1.0
    joint_prior: float = 4.0
    joint_limits: float = 2000.0
    joint_flow: float = 1.0
    foot_contact: float = 4e4
    floor: float = 4e4
    shape: float = 1.0
    tables: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the weights.

        :raises InvalidValueError: one is negative, infinite or no number, or `tables` names no
            registered residual.
        """
        check_type(self.tables, Mapping, "Weights.tables")
        for own in fields(self):
            if own.name != "tables":
                check_weight(getattr(self, own.name), f"Weights.{own.name}")
        for name, weight in self.tables.items():
            registered(name)
            check_weight(weight, f"Weights.tables[{name!r}]")

    def regularized(self, strength: float) -> Weights:
        """Return weights with `strength` times those of the population, joint_flow and shape.

        With 1, a fit is the most likely person and pose; a larger strength is regularization.

        :raises InvalidValueError: the strength is negative, infinite or no number.
        """
        check_weight(strength, "strength")
        return replace(self, joint_flow=strength * self.joint_flow, shape=strength * self.shape)

    def row(self) -> list[float]:
        """Return the weights in the registry's order."""
        row = [self.keypoints2d, self.keypoints3d, self.orientation_field, self.shape]
        row += [getattr(self, name, 1.0) for name in RESIDUALS]
        row += [1.0] * (COLUMNS - FIRST_EXTERNAL)
        for name, weight in self.tables.items():
            row[column_of(name)] = weight
        return row


@dataclass(frozen=True)
class Stage:
    """Weights until the cost's relative decrease in an accepted step falls below `tolerance`.

    widening: factor of the sigmas of the robust kernels, larger than 1 in early stages, from where
    the measurements are still far away.
    """

    weights: Weights = Weights()
    tolerance: float = 1e-6
    max_iterations: int = 50
    widening: float = 1.0

    def __post_init__(self) -> None:
        """Check the values.

        :raises InvalidValueError: the tolerance is negative or NaN, the limit is negative or not a
            whole number, or the widening is not positive.
        """
        check_type(self.weights, Weights, "Stage.weights")
        if not as_number(self.tolerance, "Stage.tolerance") >= 0.0:
            raise InvalidValueError(
                f"Stage.tolerance must be a number of at least 0, but is {self.tolerance}."
            )
        check_count(self.max_iterations, "Stage.max_iterations", 0)
        check_robust(self.widening, "Stage.widening")


def cold_stages(weights: Weights) -> tuple[Stage, ...]:
    """Return the stages of a fit from far away: directions, which have no bad minimum nearby, and
    priors first; positions join in, and the robust kernels become narrow.
    """
    far = replace(
        weights,
        orientation_field=4.0 * weights.orientation_field,
        keypoints3d=0.1 * weights.keypoints3d,
        keypoints2d=0.01 * weights.keypoints2d,
        joint_prior=20.0 * weights.joint_prior,
        joint_flow=10.0 * weights.joint_flow,
        shape=100.0 * weights.shape,
    )
    near = replace(
        weights,
        orientation_field=1.6 * weights.orientation_field,
        keypoints2d=0.2 * weights.keypoints2d,
        joint_prior=6.0 * weights.joint_prior,
        joint_flow=3.0 * weights.joint_flow,
        shape=10.0 * weights.shape,
    )
    return Stage(far, 5e-2, 10, 1000.0), Stage(near, 1e-2, 15, 30.0), *warm_stages(weights)


def warm_stages(weights: Weights) -> tuple[Stage, ...]:
    """Return the stages of a fit from a state that is known."""
    return (Stage(weights, 1e-6, 200),)


COLD_STAGES = cold_stages(Weights())
WARM_STAGES = warm_stages(Weights())


@dataclass(frozen=True)
class Options:
    """How the optimizer works.

    weights: of the default schedule, whose earlier stages scale them; `Weights()` if None.
    robust_*: Geman-McClure sigma in the square of each residual's unit; infinity turns the kernel
    off. damping: Levenberg-Marquardt lambda at the start, on joint rotations in radians;
    root_length: metres of pelvis motion that are damped like one radian. stages: replaces the
    default schedule, COLD_STAGES or, where an initial state is given, WARM_STAGES. curvature:
    estimate from the steps taken what Gauss-Newton leaves out of the joints' Hessians
    (curvature.py), in every fit of one frame; without, each step is plain Levenberg-Marquardt's. It
    changes the steps, not the minimum. report: also tell what the cost is made of
    (`Fit.cost_by_term`), which takes another evaluation for each kind of residual.
    """

    stages: Sequence[Stage] | None = None
    robust_keypoints2d: float = 0.01
    robust_keypoints3d: float = 0.1
    robust_orientation_field: float = 1.0
    damping: float = 1.0
    root_length: float = 0.3
    curvature: bool = True
    report: bool = False
    weights: Weights | None = None

    def __post_init__(self) -> None:
        """Check the values.

        :raises InvalidValueError: a value that no fit could use.
        """
        for name in ("damping", "root_length"):
            value = getattr(self, name)
            if not 0.0 < as_number(value, f"Options.{name}") < math.inf:
                raise InvalidValueError(
                    f"Options.{name} must be positive and finite, but is {value}."
                )
        for name in ("robust_keypoints2d", "robust_keypoints3d", "robust_orientation_field"):
            check_robust(getattr(self, name), f"Options.{name}")
        for name in ("curvature", "report"):
            check_switch(getattr(self, name), f"Options.{name}")
        check_type(self.stages, (Sequence, type(None)), "Options.stages")
        for k, stage in enumerate(self.stages or ()):
            check_type(stage, Stage, f"Options.stages[{k}]")
        check_type(self.weights, (Weights, type(None)), "Options.weights")
        warn_of_kernel(self.robust_keypoints2d, 1.0, "Options.robust_keypoints2d")
        warn_of_kernel(self.robust_keypoints3d, 100.0, "Options.robust_keypoints3d")
        if self.weights is not None:
            warn_of_weight(self.weights.keypoints2d, 10.0, "Options.weights.keypoints2d")
            warn_of_weight(self.weights.keypoints3d, 0.05, "Options.weights.keypoints3d")
        if self.stages is not None and self.weights is not None:
            raise InvalidValueError(
                "Options.weights are those of the default stages; with Options.stages, give each "
                "Stage its weights."
            )

    @cached_property
    def _default_stages(self) -> tuple[tuple[Stage, ...], tuple[Stage, ...]]:
        """The schedules of a cold and of a warm start."""
        if self.weights is None:
            return COLD_STAGES, WARM_STAGES
        return cold_stages(self.weights), warm_stages(self.weights)

    def schedule(self, cold: bool) -> Sequence[Stage]:
        """Return the stages of a fit, `cold` without an initial state.

        :raises InvalidValueError: there are none.
        """
        if self.stages is None:
            return self._default_stages[0 if cold else 1]
        if not self.stages:
            raise InvalidValueError(
                "A fit needs at least one stage, but Options.stages is empty; None is the default."
            )
        return self.stages

    def stage_table(self, stages: Sequence[Stage]) -> tuple[Array, Array, Array]:
        """Return (S, 2, weights) of weights and 1/sigma, tolerances (S,) and iteration limits (S,).

        :raises InvalidValueError: an entry of `stages` is not a `Stage`.
        """
        table = np.zeros((len(stages), 2, COLUMNS))
        sigmas = np.array(
            [self.robust_keypoints2d, self.robust_keypoints3d, self.robust_orientation_field]
        )
        for k, stage in enumerate(stages):
            check_type(stage, Stage, f"Options.stages[{k}]")
            table[k, 0] = stage.weights.row()
            table[k, 1, :3] = 1.0 / (stage.widening * sigmas)
        tolerances = np.array([float(stage.tolerance) for stage in stages])
        return (
            table,
            tolerances,
            np.array([int(stage.max_iterations) for stage in stages], dtype=np.int64),
        )


@dataclass(frozen=True)
class Priors:
    """What is known before measuring. Everything may be left out.

    joint_mean (K, 3, 3) states of joints 1..K, rest pose if None; joint_weights (K,), ones if None.
    shape_mean (P,), zeros if None; shape_information (P, P), identity if None: the prior's inverse
    covariance over `Weights.shape`. limits: tables of residuals/joint_limits.py, for instance
    `joint_limits.hinges_of(body.joint_names)`. flow: tables of residuals/joint_flow.py, for
    instance `load_joint_prior().tables(body.joint_names)`.
    """

    joint_mean: ArrayLike | None = None
    joint_weights: ArrayLike | None = None
    shape_mean: ArrayLike | None = None
    shape_information: ArrayLike | None = None
    limits: tuple[Array, Array] | None = None
    flow: tuple[Array, Array] | None = None

    def packed_tables(self, K: int) -> dict[str, tuple[Array, Array]]:
        """Return the tables of joint_prior, joint_limits and joint_flow for a body of K joints.

        :raises ShapeError: an array has another shape.
        :raises InvalidValueError: a mean is not a rotation, or a weight is negative; both must be
            finite.
        """
        mean = np.tile(np.eye(3), (K, 1, 1)) if self.joint_mean is None else self.joint_mean
        weights = np.ones(K) if self.joint_weights is None else self.joint_weights
        mean = as_finite(mean, (K, 3, 3), "Means of the joint prior")
        weights = as_finite(weights, (K,), "Weights of the joint prior")
        check_rotations(mean, "Means of the joint prior", weights)
        check_not_negative(weights, "Weights of the joint prior")
        tables = {"joint_prior": joint_prior.pack(np.arange(1, K + 1), mean, weights)}
        if self.limits is not None:
            tables["joint_limits"] = self.limits
        if self.flow is not None:
            tables["joint_flow"] = self.flow
        return tables

    def packed_shape(self, P: int) -> tuple[Array, Array]:
        """Return the shape prior's mean (P,) and information (P, P).

        :raises ShapeError: an array has another shape.
        :raises InvalidValueError: one is not finite, or the information is not symmetric positive
            semidefinite.
        """
        mean = np.zeros(P) if self.shape_mean is None else self.shape_mean
        mean = as_finite(mean, (P,), "Mean of the shape prior")
        information = np.eye(P) if self.shape_information is None else self.shape_information
        information = as_finite(information, (P, P), "Information of the shape prior")
        if self.shape_information is not None:
            check_information(
                information, "Information of the shape prior (Priors.shape_information)"
            )
        return mean, 0.5 * (information + information.T)


def given_priors(body: object, priors: Priors | None, options: Options) -> Priors:
    """Return the priors, those of `default_priors` if None.

    :raises InvalidValueError: `priors` or `options` is of another type.
    """
    priors = default_priors(body) if priors is None else priors
    check_type(priors, Priors, "priors")
    check_type(options, Options, "options")
    return priors


def default_priors(body: object) -> Priors:
    """Return what is known of any person: the learned prior of the joints that `body` names as SMPL
    does, the limits of its knees and elbows, and the population's shape. Joints without a learned
    prior are drawn to the rest pose.

    :param body: `joint_names` (K+1,) are all that is read of it; without any, only the shape is
        known.
    :raises ModelFileError: the prior cannot be read.
    :raises InvalidValueError: `joint_names` is not a list.
    """
    names = getattr(body, "joint_names", ())
    check_list(names, "joint_names of the body", "part")
    names = list(names)
    limits = joint_limits.hinges_of(names)
    if not names:
        return Priors(limits=limits)
    prior = load_joint_prior()
    unknown = np.array([name not in prior.names for name in names[1:]], dtype=np.float64)
    return Priors(joint_weights=unknown, limits=limits, flow=prior.tables(names))
