# SPDX-License-Identifier: GPL-3.0-or-later
"""Explicit SIMD in compiled kernels: one formula for several joints at once, on vectors of `WIDTH`
doubles.

A formula is a plain function of numbers, `formula(q, s) -> list`, with parameters q(k) and a state
s, a list. It uses +, -, *, / and `sqrt` and no branches. Called with floats or numpy arrays it
computes at once; `vectorized` turns it into a function for kernels that applies it to a state whose
entry k is the vector state[k * WIDTH : (k + 1) * WIDTH]. LLVM lowers the vectors to whatever the
processor has, as for rows.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic as _intrinsic

WIDTH = 8
_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_FLAGS = ("contract", "nsz")
_declared: Any = cgutils.get_or_insert_function  # untyped
intrinsic: Any = _intrinsic  # its first parameter is the compiler's, which type checkers do not see


class Vector:
    """A SIMD vector during code generation; its operators emit LLVM instructions."""

    def __init__(self, builder: Any, value: Any) -> None:
        """Wrap an LLVM value of type <WIDTH x double>."""
        self.builder = builder
        self.value = value

    def _of(self, other: Any) -> Any:
        if isinstance(other, Vector):
            return other.value
        return ir.Constant(_VECTOR, [float(other)] * WIDTH)

    def __add__(self, other: Any) -> Vector:
        """Sum."""
        return Vector(self.builder, self.builder.fadd(self.value, self._of(other), flags=_FLAGS))

    def __sub__(self, other: Any) -> Vector:
        """Difference."""
        return Vector(self.builder, self.builder.fsub(self.value, self._of(other), flags=_FLAGS))

    def __mul__(self, other: Any) -> Vector:
        """Product."""
        return Vector(self.builder, self.builder.fmul(self.value, self._of(other), flags=_FLAGS))

    def __truediv__(self, other: Any) -> Vector:
        """Quotient."""
        return Vector(self.builder, self.builder.fdiv(self.value, self._of(other), flags=_FLAGS))

    def __rsub__(self, other: Any) -> Vector:
        """Difference from a number."""
        return Vector(self.builder, self.builder.fsub(self._of(other), self.value, flags=_FLAGS))

    def __rtruediv__(self, other: Any) -> Vector:
        """Quotient of a number."""
        return Vector(self.builder, self.builder.fdiv(self._of(other), self.value, flags=_FLAGS))

    __radd__ = __add__
    __rmul__ = __mul__

    def sqrt(self) -> Vector:
        """Square root, by one instruction."""
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        function = _declared(self.builder.module, kind, f"llvm.sqrt.v{WIDTH}f64")
        return Vector(self.builder, self.builder.call(function, [self.value]))


def sqrt(x: Any) -> Any:
    """Return the square root of a number, an array or a SIMD vector."""
    return x.sqrt() if isinstance(x, Vector) else np.sqrt(x)


def vectorized(
    formula: Callable[[Callable[[int], Any], list[Any]], Sequence[Any]], reads: int
) -> Any:
    """Return `apply(table, at, state)` for kernels: state <- formula(q, state[:reads]), written
    from entry 0 on.

    q(k) is the vector of `table`'s elements at + k WIDTH and following. Both arrays are
    C-contiguous float64 of any rank, read and written as flat; nothing is checked.
    """

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        table = context.make_array(sig.args[0])(context, builder, args[0]).data
        state = context.make_array(sig.args[2])(context, builder, args[2]).data
        index = args[1].type

        def at(data: Any, offset: Any) -> Any:
            return builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer())

        def parameter(k: int) -> Vector:
            offset = builder.add(args[1], ir.Constant(index, k * WIDTH))
            return Vector(builder, builder.load(at(table, offset), align=8))

        given = [
            Vector(builder, builder.load(at(state, ir.Constant(index, k * WIDTH)), align=8))
            for k in range(reads)
        ]
        for k, value in enumerate(formula(parameter, given)):
            builder.store(value.value, at(state, ir.Constant(index, k * WIDTH)), align=8)
        return context.get_dummy_value()

    @intrinsic
    def apply(typingctx, table, at, state):  # type: ignore[no-untyped-def]
        return types.void(table, types.intp, state), generate

    return apply
