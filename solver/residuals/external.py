# SPDX-License-Identifier: Apache-2.0
"""Residuals that other programs register: compiled ones, and plain Python ones with finite
differences.

The solver's machine code calls them through their address, with plain pointers and sizes, in the
order of `_PROTOTYPE`. So it stays as it is on disk whatever is registered, and without rows of such
a residual it makes no call.
"""

from __future__ import annotations

import ctypes
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import carray, cfunc, types  # type: ignore[attr-defined]
from numba.core.errors import NumbaError
from numba.extending import intrinsic

from ..errors import InvalidValueError, ShapeError
from ..kernel import inlined_kernel
from ..kernel import kernel as compiled
from ..part import GRADIENT, SHAPE, Array, Blocks, Linearization, Part, Pose
from ..rotations import exp
from ..tree import Tree

MAX_EXTERNAL = 16  # external residuals; each has a column of the weights
INDEXES = ("points", "parts", "joints")

_I = types.int64
_F = types.float64
_PI, _PF = types.CPointer(_I), types.CPointer(_F)  # type: ignore[no-untyped-call]
_PROTOTYPE = _F(
    _PI, _I, _PF, _F,  # ints, how many rows, floats, weight
    _I, _I, _I, _I, _I, _I,  # parts, points, W, and keypoints, shape and globals of `Tree`
    _PI, _PF, _PF, _PI, _PF, _PF,  # the arrays of `Tree`
    _PF, _PF, _PF, _PF, _PF, _PF,  # of `Pose`
    _PF, _PF, _PF, _PF, _PF, _PI,  # of `Blocks`
)  # fmt: skip
_C_TYPES: dict[Any, Any] = {
    _I: ctypes.c_int64,
    _F: ctypes.c_double,
    _PI: ctypes.c_void_p,
    _PF: ctypes.c_void_p,
}
_CALLBACK = ctypes.CFUNCTYPE(ctypes.c_double, *(_C_TYPES[kind] for kind in _PROTOTYPE.args))


class External(NamedTuple):
    """The rows of external residuals for the kernels."""

    # (m, 5): address, how many rows, where they begin in ints and in floats, column of the weights
    calls: Array
    ints: Array  # (n,)
    floats: Array  # (n,)


NONE = External(np.zeros((0, 5), np.int64), np.zeros(0, np.int64), np.zeros(0))


@dataclass
class Registered:
    """A residual from outside, with what a module of RESIDUALS has."""

    name: str
    slot: int  # among the columns for external residuals
    INTS: int
    FLOATS: int
    INDEXES: str
    kernel: Callable[..., Any] | None
    function: Callable[..., Any] | None
    _callable: Any = field(default=None, repr=False)  # what the address belongs to

    def address(self) -> int:
        """Return the address of the machine code, compiled on the first call.

        :raises InvalidValueError: the kernel does not compile.
        """
        with _LOCK:
            if self._callable is None:
                self._callable = self._callback() if self.kernel is None else self._entry()
        if self.kernel is None:
            return int(ctypes.cast(self._callable, ctypes.c_void_p).value or 0)
        return int(self._callable.address)

    def _entry(self) -> Any:
        ints = self.INTS
        floats = self.FLOATS
        given: Any = self.kernel
        accumulate = given if hasattr(given, "signatures") else inlined_kernel(given)

        def entry(  # type: ignore[no-untyped-def]
            i,
            rows,
            f,
            weight,
            n,
            points,
            W,
            keypoints,
            shape,
            globals_,
            parents,
            S,
            l,
            point_part,
            v_bar,
            V,
            Omega,
            R,
            t,
            D,
            beta,
            log_focal,
            A,
            H_u,
            H_uu,
            C,
            c,
            cross,
        ):
            tree = Tree(
                carray(parents, (n,)),
                carray(S, (n, 3, W)),
                carray(l, (n, 3)),
                carray(point_part, (points,)),
                carray(v_bar, (points, 3)),
                carray(V, (points, 3, W)),
                keypoints,
                shape,
                globals_,
            )
            pose = Pose(
                carray(Omega, (n, 3, 3)),
                carray(R, (n, 3, 3)),
                carray(t, (n, 3)),
                carray(D, (n, 3, W)),
                carray(beta, (W,)),
                carray(log_focal, (1,)),
            )
            blocks = Blocks(
                carray(A, (n, 6, 8 + W)),
                carray(H_u, (n, 3, 8 + W)),
                carray(H_uu, (n, 3, 3)),
                carray(C, (W, W)),
                carray(c, (W,)),
                carray(cross, (1,)),
            )
            table = carray(i, (rows, ints))
            numbers = carray(f, (rows, floats))
            return accumulate(tree, table, numbers, weight, pose, blocks)

        try:
            return cfunc(_PROTOTYPE)(entry)
        except NumbaError as error:
            lines = [
                line
                for line in str(error).splitlines()
                if line and not line.startswith("Failed in")
            ]
            reason = lines[0] if lines else type(error).__name__  # the whole of it is the cause
            raise InvalidValueError(
                f"The kernel of residual {self.name!r} does not compile: {reason}"
            ) from error

    def _callback(self) -> Any:
        name = self.name
        function = self.function
        ints = self.INTS
        floats = self.FLOATS

        def call(i: int, rows: int, f: int, weight: float, *sizes_and_arrays: int) -> float:
            try:
                assert function is not None
                return accumulate_function(
                    function, (i, f), (rows, ints, floats), weight, sizes_and_arrays
                )
            # it cannot pass through machine code: `raise_failure` does it
            except Exception as error:
                _failure.error = name, error
                return float("nan")

        return _CALLBACK(call)


_external: dict[str, Registered] = {}
_LOCK = threading.RLock()
_failure = threading.local()


def external_residuals() -> dict[str, Registered]:
    """Return the residuals that were registered from outside, by name."""
    return _external


def raise_failure() -> None:
    """Pass on what a Python residual raised within the machine code.

    :raises InvalidValueError: one has, since the last call.
    """
    failed = getattr(_failure, "error", None)
    if failed is not None:
        _failure.error = None
        name, error = failed
        raise InvalidValueError(
            f"The residual {name!r} raised {type(error).__name__}: {error}"
        ) from error


def pack_external(tables: list[tuple[Registered, Array, Array]], first_column: int) -> External:
    """Return the rows (n, INTS), (n, FLOATS) of several residuals for the kernels."""
    calls = np.zeros((len(tables), 5), np.int64)
    i = 0
    f = 0
    for k, (residual, ints, floats) in enumerate(tables):
        calls[k] = residual.address(), len(ints), i, f, first_column + residual.slot
        i = i + ints.size
        f = f + floats.size
    ints = np.concatenate([ints.ravel() for _, ints, _ in tables])
    return External(calls, ints, np.concatenate([floats.ravel() for _, _, floats in tables]))


@intrinsic
def _call(typingctx, address, arguments):  # type: ignore[no-untyped-def]
    """Call the function at an address; of arrays among the arguments, a tuple, it gets the pointer
    to their data.
    """

    def generate(context, builder, signature, args):  # type: ignore[no-untyped-def]
        values = []
        for k, kind in enumerate(signature.args[1].types):
            value = builder.extract_value(args[1], k)
            if isinstance(kind, types.Array):
                value = context.make_array(kind)(context, builder, value).data
            values.append(value)
        prototype = ir.FunctionType(ir.DoubleType(), [value.type for value in values])
        return builder.call(builder.inttoptr(args[0], prototype.as_pointer()), values)

    return types.float64(types.int64, arguments), generate


@compiled
def accumulate_external(tree, external, weights, pose, blocks):  # type: ignore[no-untyped-def]
    """Add all rows to the blocks and return their cost."""
    cost = 0.0
    n = tree.parents.shape[0]
    points = tree.point_part.shape[0]
    W = tree.S.shape[2]
    for k in range(external.calls.shape[0]):
        address, rows, i, f, column = external.calls[k]
        arguments = (
            external.ints[i:],
            rows,
            external.floats[f:],
            weights[column],
            n,
            points,
            W,
            tree.keypoints,
            tree.shape,
            tree.globals,
            tree.parents,
            tree.S,
            tree.l,
            tree.point_part,
            tree.v_bar,
            tree.V,
            pose.Omega,
            pose.R,
            pose.t,
            pose.D,
            pose.beta,
            pose.log_focal,
            blocks.A,
            blocks.H_u,
            blocks.H_uu,
            blocks.C,
            blocks.c,
            blocks.cross,
        )
        cost += _call(address, arguments)  # type: ignore[call-arg]
    return cost


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


def accumulate_function(
    function: Callable[..., Any],
    tables: tuple[int, int],
    extent: tuple[int, int, int],
    weight: float,
    sizes_and_arrays: tuple[int, ...],
) -> float:
    """Add every row's JᵀJ and Jᵀr to the blocks and return the cost, 1/2 weight |r|^2.

    :param tables: addresses of ints and floats. :param extent: how many rows, columns of ints,
        columns of floats.
    :param sizes_and_arrays: as the prototype has them from the sizes on, arrays as
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
