# SPDX-License-Identifier: Apache-2.0
"""A residual that is a plain Python function: its derivatives by central differences, added to the
same blocks.

    function(part, ints, floats) -> r (n,)      of R, t, Omega and beta of `part`, and of one row of
                                                its tables
Every evaluation costs 1 + 2 (9 + P) calls for each row, in Python: a hundred times what a kernel
takes.
"""

import ctypes
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..errors import InvalidValueError, ShapeError
from ..part import GRADIENT, SHAPE, Array, Linearization, Part
from ..rotations import exp

STEP = 1e-6  # of the differences, radians and metres: their error is its square and 1e-16 over it


def differentiate(function: Callable[[Part], Any], part: Part) -> Linearization:
    """Return r (n,) and its derivatives, as part.py defines them: J_x (n, 6), J_u (n, 3) and J_beta
    (n, P).

    :raises ShapeError: the function does not return numbers (n,), n the same at every call.
    :raises InvalidValueError: r is not finite.
    """
    r = _numbers(function(part), None)

    def slope(moved: Callable[[float], Part]) -> Array:
        ahead, behind = (_numbers(function(moved(h)), len(r)) for h in (STEP, -STEP))
        return (ahead - behind) / (2.0 * STEP)

    def twisted(k: int, h: float) -> Part:
        w = np.zeros(3)
        nu = np.zeros(3)
        (w if k < 3 else nu)[k % 3] = h
        return replace(part, R=exp(w) @ part.R, t=part.t + np.cross(w, part.t - part.origin) + nu)

    def turned(k: int, h: float) -> Part:
        return replace(
            part, Omega=part.R_parent.T @ exp(h * np.eye(3)[k]) @ part.R_parent @ part.Omega
        )

    def shaped(k: int, h: float) -> Part:
        beta = part.beta.copy()
        beta[k] += h
        return replace(part, beta=beta, t=part.t + h * part.D[:, k])

    moves = [(twisted, 6), (turned, 3), (shaped, len(part.beta))]
    columns = [[slope(partial(move, k)) for k in range(n)] for move, n in moves]
    return Linearization(r, *(np.array(some).reshape(-1, len(r)).T for some in columns))


def accumulate(
    function: Callable[..., Any],
    tables: tuple[int, int],
    extent: tuple[int, int, int],
    weight: float,
    sizes_and_arrays: tuple[int, ...],
) -> float:
    """Add every row's JᵀJ and Jᵀr to the blocks and return the cost, 1/2 weight |r|^2.

    :param tables: addresses of ints and floats. :param extent: how many rows, columns of ints,
        columns of floats.
    :param sizes_and_arrays: as the prototype in external.py has them from the sizes on, arrays as
        addresses.
    :raises ShapeError: the function does not return numbers (n,).
    :raises InvalidValueError: they are not finite.
    """
    n, _, W, _, P, _ = sizes_and_arrays[:6]
    parents, _, _, _, _, _, Omega, R, t, D, beta, _, A, H_u, H_uu, C, c, cross = sizes_and_arrays[
        6:
    ]
    ints = _view(tables[0], extent[0], extent[1], whole=True)
    floats = _view(tables[1], extent[0], extent[2])
    up = _view(parents, n, whole=True)
    rotation = _view(R, n, 3, 3)
    position = _view(t, n, 3)
    state = _view(Omega, n, 3, 3)
    by_shape = _view(D, n, 3, W)
    shape = _view(beta, W)
    blocks_A = _view(A, n, 6, SHAPE + W)
    blocks_Hu = _view(H_u, n, 3, SHAPE + W)
    blocks_Huu = _view(H_uu, n, 3, 3)
    blocks_C = _view(C, W, W)
    blocks_c = _view(c, W)
    crossed = _view(cross, 1, whole=True)
    cost = 0.0
    s = math.sqrt(weight)
    for k in range(extent[0] if weight > 0.0 else 0):
        i = int(ints[k, 0])
        parent = np.eye(3) if up[i] < 0 else rotation[up[i]].copy()
        part = Part(
            rotation[i].copy(),
            position[i].copy(),
            by_shape[i, :, :P].copy(),
            state[i].copy(),
            parent,
            position[0].copy(),
            shape[:P].copy(),
        )
        row = ints[k].copy(), floats[k].copy()

        def residual(p: Part, row: tuple[Any, Any] = row) -> Any:
            return function(p, *row)

        r, J_x, J_u, J_beta = (s * a for a in differentiate(residual, part))
        cost += 0.5 * float(r @ r)
        for block, J in ((blocks_A[i], J_x), (blocks_Hu[i], J_u)):
            block[:, GRADIENT] += J.T @ r
            block[:, SHAPE : SHAPE + P] += J.T @ J_beta
        blocks_A[i, :, :6] += J_x.T @ J_x
        blocks_Hu[i, :, :6] += J_u.T @ J_x
        blocks_Huu[i] += J_u.T @ J_u
        blocks_C[:P, :P] += np.triu(J_beta.T @ J_beta)
        blocks_c[:P] += J_beta.T @ r
        if J_u.any() and (J_x.any() or J_beta.any()):
            crossed[0] = 1
    return cost


def _numbers(value: Any, n: int | None) -> Array:
    """Return the user's function's result (n,), checked."""
    try:
        r = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ShapeError(
            f"it must return numbers of shape (n,), but returned a {type(value).__name__}"
        ) from None
    if r.ndim != 1 or n not in (None, len(r)):
        wanted = "(n,)" if n is None else f"({n},), as at first"
        raise ShapeError(f"it must return numbers of shape {wanted}, but returned shape {r.shape}")
    if not np.isfinite(r).all():
        raise InvalidValueError(f"it must return finite numbers, but returned {r.tolist()}")
    return r


def _view(address: int, *shape: int, whole: bool = False) -> Array:
    """Return the kernels' own memory as an array."""
    size = math.prod(shape)
    if size == 0:
        return np.zeros(shape)
    kind = ctypes.c_int64 if whole else ctypes.c_double
    memory: Any = (kind * size).from_address(address)
    return np.frombuffer(memory, dtype=np.int64 if whole else np.float64).reshape(shape)
