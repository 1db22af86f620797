# SPDX-License-Identifier: Apache-2.0
"""Every residual the optimizer knows. This is the one place to add another; `register_residual`
adds one from outside.

A residual r_i(T_i, Omega_i, beta) in addition to the measurements is a module with

    INTS, FLOATS
        columns of its two tables, one row for each term
    INDEXES
        what all its whole numbers count: "points" as in the measurements, "parts" 0..K or "joints"
        1..K. Rows outside are refused; without it, negative ones
    WEIGHTS
        slice of its other numbers, a row's weights: a row counts as measured where one is above 0;
        without it, every row. slice(0) for what does not say where a body is, so that no row does
    accumulate(tree, ints, floats, weight, pose, blocks) -> cost
        compiled with @kernel; adds JᵀJ and Jᵀr to `Blocks` (see part.py)

To add it here: its import, and one line, its module in RESIDUALS. Its tables come in through
`Measurements.tables[name]`, or through a field of `Measurements` or `Priors` of its own; its weight
through `Weights.tables[name]`. A residual with no rows costs one call.

The three measurements (keypoint2d, keypoint3d, orientation_field) are not here: the hot path in
linearize.py merges those of one point into one term.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..arrays import described
from ..errors import InvalidValueError
from ..kernel import inlined_kernel
from ..part import Array
from ..validation import check_count
from . import floor, foot_contact, joint_flow, joint_limits, joint_prior, outline, pose_prior
from .external import INDEXES, MAX_EXTERNAL, Registered, external_residuals

RESIDUALS = {
    "pose_prior": pose_prior,
    "joint_prior": joint_prior,
    "joint_limits": joint_limits,
    "joint_flow": joint_flow,
    "foot_contact": foot_contact,
    "floor": floor,
    "outline": outline,
}

# Columns of a stage's weights: the measurements, the shape prior, then RESIDUALS in order, then
# external ones.
KEYPOINT2D, KEYPOINT3D, ORIENTATION_FIELD, SHAPE_PRIOR, FIRST_TABLE = range(5)
NAMES = ("keypoints2d", "keypoints3d", "orientation_field", "shape_prior", *RESIDUALS)
FIRST_EXTERNAL = FIRST_TABLE + len(RESIDUALS)
COLUMNS = FIRST_EXTERNAL + MAX_EXTERNAL


@inlined_kernel
def _nothing(tree, ints, floats, weights, pose, blocks):  # type: ignore[no-untyped-def]
    """Cost of no residual."""
    return 0.0


def _followed_by(before: Any, index: int, name: str, accumulate: Any) -> Any:
    """Return the kernel that runs `before`, then the residual with that index and name."""
    column = FIRST_TABLE + index

    def run(tree, ints, floats, weights, pose, blocks):  # type: ignore[no-untyped-def]
        cost = before(tree, ints, floats, weights, pose, blocks)
        return cost + accumulate(tree, ints[index], floats[index], weights[column], pose, blocks)

    # Numba names machine code by this and a number that counts up within a process. Code that
    # several processes have put on disk is linked by name: under one name for all, a kernel of one
    # file could run in place of another's.
    run.__qualname__ = run.__name__ = f"run_to_{name}"
    return inlined_kernel(run)


# Adds the residuals of all tables to the blocks and returns their cost; ints, floats and weights in
# RESIDUALS' order.
accumulate_tables = _nothing
for _index, (_name, _module) in enumerate(RESIDUALS.items()):
    accumulate_tables = _followed_by(accumulate_tables, _index, _name, _module.accumulate)


def registered(name: str) -> Any:
    """Return the module of the residual with that name, or what was registered from outside.

    :raises InvalidValueError: there is none.
    """
    external = external_residuals()
    if name in external:
        return external[name]
    if name not in RESIDUALS:
        names = ", ".join([*RESIDUALS, *external])
        raise InvalidValueError(
            f"There is no residual named {name!r}; the registered ones are {names}."
        )
    return RESIDUALS[name]


def column_of(name: str) -> int:
    """Return the column of a stage's weights of one of `NAMES` or of a residual from outside."""
    if name in NAMES:
        return NAMES.index(name)
    return FIRST_EXTERNAL + external_residuals()[name].slot


def register_residual(
    name: str,
    *,
    ints: int = 1,
    floats: int = 1,
    indexes: str = "parts",
    kernel: Callable[..., Any] | None = None,
    function: Callable[..., Any] | None = None,
) -> None:
    """Add a residual of the form r(T_i, Omega_i, beta) to the solver, for this process. No file of
    Scope changes.

    Rows come in through `Measurements.tables[name]`, int64 (n, ints) and float64 (n, floats);
    `Weights.tables[name]` is its weight, 1 if left out; `Fit.cost_by_term[name]` its cost. The same
    name again replaces the residual.

    :param ints: columns of whole numbers; the first is what the row is about.
    :param floats: columns of other numbers.
    :param indexes: what all whole numbers count: "points" as in the measurements, "parts" 0..K or
        "joints" 1..K.
    :param kernel: ``accumulate(tree, ints, floats, weight, pose, blocks) -> cost``, as this module
        describes it: a plain function, which is compiled here, or one that `numba.njit` has
        compiled. Its speed is that of Scope's own.
    :param function: ``function(part, ints, floats) -> r (n,)`` of one row (ints,), (floats,) in
        plain Python, with R (3, 3), t (3,) of `part.Part` the pose of part i in the camera
        frame, metres, Omega (3, 3) the state of its joint and beta (P,). Derivatives are central
        differences: slow, to try an idea.
    :raises InvalidValueError: the name is one of Scope's own, not exactly one of `kernel` and
        `function` is given, a count is not a whole number of at least 1 (`floats`: 0), `indexes` is
        unknown or "points" with a `function`, or too many are registered.
    """
    external = external_residuals()
    own = [*RESIDUALS, *NAMES[:FIRST_TABLE], "focal_prior"]
    if not isinstance(name, str) or not name or name in own:
        raise InvalidValueError(
            f"A residual of your own needs a name other than {', '.join(own)}, but got {name!r}."
        )
    if (kernel is None) == (function is None) or not callable(kernel or function):
        raise InvalidValueError(
            f"Residual {name!r} needs exactly one callable, kernel or function."
        )
    for what, count, least in (("ints", ints, 1), ("floats", floats, 0)):
        check_count(count, f"{what} of {name!r}", least)
    allowed = INDEXES if function is None else INDEXES[1:]
    if not isinstance(indexes, str) or indexes not in allowed:
        found = repr(indexes) if isinstance(indexes, str) else described(indexes)
        raise InvalidValueError(
            f"indexes of {name!r} must be one of {', '.join(allowed)}, but is {found}."
        )
    if name not in external and len(external) == MAX_EXTERNAL:
        raise InvalidValueError(
            f"There is room for {MAX_EXTERNAL} residuals from outside: {', '.join(external)}."
        )
    slot = external[name].slot if name in external else len(external)
    external[name] = Registered(name, slot, int(ints), int(floats), indexes, kernel, function)


def empty_tables() -> dict[str, tuple[Array, Array]]:
    """Return tables without rows for every residual."""
    return {
        name: (np.zeros((0, m.INTS), np.int64), np.zeros((0, m.FLOATS)))
        for name, m in RESIDUALS.items()
    }
