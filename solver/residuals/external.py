# SPDX-License-Identifier: Apache-2.0
"""Residuals that other programs register: compiled ones, and plain Python ones with finite
differences.

The solver's machine code calls them through their address, as `f(values, weight)` with the sizes
and the addresses of arrays that `VALUES` lists. So it stays as it is on disk whatever is
registered, and without rows of such a residual it makes no call.
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
from numba.core import cgutils as _cgutils
from numba.core.errors import NumbaError
from numba.extending import intrinsic as _intrinsic
from numba.extending import overload as _overload
from numba.extending import register_jitable

from ..errors import InvalidValueError, ShapeError
from ..kernel import inlined_kernel
from ..kernel import kernel as compiled
from ..part import GRADIENT, SHAPE, Array, Blocks, Linearization, Part, Pose
from ..rotations import exp
from ..tree import Tree

MAX_EXTERNAL = 16  # external residuals; each has a column of the weights
INDEXES = ("points", "parts", "joints")

intrinsic: Any = _intrinsic  # its first parameter is the compiler's, which type checkers do not see
overload: Any = _overload  # untyped, as the next
cgutils: Any = _cgutils
# What a residual from outside is given, as int64: sizes, and of arrays their addresses.
SIZES = ("rows", "parts", "points", "W")
VALUES = (*SIZES, "ints", "floats", *Tree._fields, *Pose._fields, *Blocks._fields)
COUNT = len(VALUES)
_TREE = len(SIZES) + 2  # where those of `Tree` begin
_POSE = _TREE + len(Tree._fields)
_BLOCKS = _POSE + len(Pose._fields)
_PROTOTYPE = types.float64(types.CPointer(types.int64), types.float64)  # type: ignore[no-untyped-call]
_CALLBACK = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_double)


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

        def entry(values, weight):  # type: ignore[no-untyped-def]
            tree, table, numbers, pose, blocks = _arrays(carray(values, (COUNT,)), ints, floats)
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

        def call(address: int, weight: float) -> float:
            if getattr(_failure, "error", None) is not None:
                return math.nan  # the fit is lost, and ends the sooner
            try:
                assert function is not None
                values = carray(ctypes.c_void_p(address), (COUNT,), np.int64)
                return accumulate_function(function, ints, floats, weight, values)
            # It cannot pass through machine code: `raise_failure` does it. So too what interrupts:
            # out of here, ctypes would drop it and return any number for the cost.
            except BaseException as error:
                _failure.error = name, error
                return math.nan

        return _CALLBACK(call)


_external: dict[str, Registered] = {}
_LOCK = threading.RLock()
_failure = threading.local()


def external_residuals() -> dict[str, Registered]:
    """Return the residuals that were registered from outside, by name."""
    return _external


def raise_failure() -> None:
    """Pass on what a Python residual raised within the machine code.

    :raises InvalidValueError: one has, since the last call. What interrupts a program, such as
        KeyboardInterrupt, is raised as it is.
    """
    failed = getattr(_failure, "error", None)
    if failed is not None:
        _failure.error = None
        name, error = failed
        if not isinstance(error, Exception):
            raise error
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


def _pointer(address: int) -> ctypes.c_void_p:
    """Return an address as a pointer."""
    return ctypes.c_void_p(int(address))


@intrinsic
def _as_pointer(typingctx, address):  # type: ignore[no-untyped-def]
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return types.voidptr(types.int64), generate


@overload(_pointer)
def _pointer_in_kernels(address):  # type: ignore[no-untyped-def]
    return lambda address: _as_pointer(address)


@register_jitable
def _arrays(values: Array, ints: int, floats: int) -> tuple[Tree, Array, Array, Pose, Blocks]:
    """Return the body, a residual's rows of so many whole and other numbers, the pose and the
    blocks, which are the solver's own memory; in kernels and in Python.

    :param values: (COUNT,) as `VALUES` lists them.
    """
    rows = values[0]
    n = values[1]
    points = values[2]
    W = values[3]
    t = values[_TREE:]
    p = values[_POSE:]
    b = values[_BLOCKS:]
    tree = Tree(
        carray(_pointer(t[0]), (n,), np.int64),
        carray(_pointer(t[1]), (n, 3, W), np.float64),
        carray(_pointer(t[2]), (n, 3), np.float64),
        carray(_pointer(t[3]), (points,), np.int64),
        carray(_pointer(t[4]), (points, 3), np.float64),
        carray(_pointer(t[5]), (points, 3, W), np.float64),
        t[6],
        t[7],
        t[8],
    )
    pose = Pose(
        carray(_pointer(p[0]), (n, 3, 3), np.float64),
        carray(_pointer(p[1]), (n, 3, 3), np.float64),
        carray(_pointer(p[2]), (n, 3), np.float64),
        carray(_pointer(p[3]), (n, 3, W), np.float64),
        carray(_pointer(p[4]), (W,), np.float64),
        carray(_pointer(p[5]), (1,), np.float64),
    )
    blocks = Blocks(
        carray(_pointer(b[0]), (n, 6, SHAPE + W), np.float64),
        carray(_pointer(b[1]), (n, 3, SHAPE + W), np.float64),
        carray(_pointer(b[2]), (n, 3, 3), np.float64),
        carray(_pointer(b[3]), (W, W), np.float64),
        carray(_pointer(b[4]), (W,), np.float64),
        carray(_pointer(b[5]), (1,), np.int64),
    )
    table = carray(_pointer(values[4]), (rows, ints), np.int64)
    numbers = carray(_pointer(values[5]), (rows, floats), np.float64)
    return tree, table, numbers, pose, blocks


@intrinsic
def _call(typingctx, address, weight, values):  # type: ignore[no-untyped-def]
    """Call the function at an address with `values`, nested tuples of whole numbers and arrays, of
    which it gets the addresses.
    """

    def flat(context: Any, builder: Any, kind: Any, value: Any) -> list[Any]:
        if isinstance(kind, types.Array):
            data = context.make_array(kind)(context, builder, value).data
            return [builder.ptrtoint(data, ir.IntType(64))]
        if not isinstance(kind, types.BaseTuple):
            return [value]
        found = []
        for k, one in enumerate(kind.types):  # type: ignore[attr-defined]
            found += flat(context, builder, one, builder.extract_value(value, k))
        return found

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        numbers = flat(context, builder, signature.args[2], args[2])
        memory = cgutils.pack_array(builder, numbers, ir.IntType(64))
        pointer = cgutils.alloca_once_value(builder, memory)
        pointer = builder.bitcast(pointer, ir.IntType(64).as_pointer())
        prototype = ir.FunctionType(ir.DoubleType(), [pointer.type, args[1].type])
        return builder.call(builder.inttoptr(args[0], prototype.as_pointer()), [pointer, args[1]])

    return types.float64(types.int64, types.float64, values), generate


@compiled
def accumulate_external(tree, external, weights, pose, blocks):  # type: ignore[no-untyped-def]
    """Add all rows to the blocks and return their cost."""
    cost = 0.0
    n = tree.parents.shape[0]
    points = tree.point_part.shape[0]
    W = tree.S.shape[2]
    for k in range(external.calls.shape[0]):
        address, rows, i, f, column = external.calls[k]
        sizes = (rows, n, points, W)
        values = (sizes, external.ints[i:], external.floats[f:], tree, pose, blocks)
        cost += _call(address, weights[column], values)
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
    columns_of_ints: int,
    columns_of_floats: int,
    weight: float,
    values: Array,
) -> float:
    """Add every row's JᵀJ and Jᵀr to the blocks and return the cost, 1/2 weight |r|^2.

    :param values: (COUNT,) as `VALUES` lists them.
    :raises ShapeError: the function does not return numbers (n,).
    :raises InvalidValueError: they are not finite.
    """
    tree, ints, floats, pose, blocks = _arrays(values, columns_of_ints, columns_of_floats)
    P = int(tree.shape_count)
    cost = 0.0
    s = math.sqrt(weight)
    for k in range(len(ints) if weight > 0.0 else 0):
        i = int(ints[k, 0])
        parent = tree.parents[i]
        part = Part(
            pose.R[i].copy(),
            pose.t[i].copy(),
            pose.D[i, :, :P].copy(),
            pose.Omega[i].copy(),
            np.eye(3) if parent < 0 else pose.R[parent].copy(),
            pose.t[0].copy(),
            pose.beta[:P].copy(),
        )
        row = ints[k].copy(), floats[k].copy()

        def residual(p: Part, row: tuple[Any, Any] = row) -> Any:
            return function(p, *row)

        r, J_x, J_u, J_beta = (s * a for a in differentiate(residual, part))
        cost += 0.5 * float(r @ r)
        for block, J in ((blocks.A[i], J_x), (blocks.H_u[i], J_u)):
            block[:, GRADIENT] += J.T @ r
            block[:, SHAPE : SHAPE + P] += J.T @ J_beta
        blocks.A[i, :, :6] += J_x.T @ J_x
        blocks.H_u[i, :, :6] += J_u.T @ J_x
        blocks.H_uu[i] += J_u.T @ J_u
        blocks.C[:P, :P] += np.triu(J_beta.T @ J_beta)
        blocks.c[:P] += J_beta.T @ r
        if J_u.any() and (J_x.any() or J_beta.any()):
            blocks.cross[0] = 1
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
