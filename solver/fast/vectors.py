# SPDX-License-Identifier: Apache-2.0
"""Doubles in vector registers: LLVM code for a pass over rows, and for formulas.

LLVM lowers a vector of four doubles to whatever the processor has (AVX, two NEON registers, ...).
Arrays are float64 whose rows are contiguous; positions are offsets in elements from the first one.
Nothing is checked: these are for kernels whose sizes are already known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic as _intrinsic

from ..gauss_newton.plain_rows import LANES, STATE
from ..tree import WIDTH

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_INT32 = ir.IntType(32)
_FLAGS = ("contract", "nsz")
_declared: Any = cgutils.get_or_insert_function  # untyped
intrinsic: Any = _intrinsic  # its first parameter is the compiler's, which type checkers do not see


class Vector:
    """A SIMD vector during code generation; its operators emit LLVM instructions."""

    def __init__(self, builder: Any, value: Any) -> None:
        """Wrap an LLVM value of a type <n x double>."""
        self.builder = builder
        self.value = value

    def _of(self, other: Any) -> Any:
        if isinstance(other, Vector):
            return other.value
        return ir.Constant(self.value.type, [float(other)] * self.value.type.count)

    def _emit(self, operation: Any, left: Any, right: Any) -> Vector:
        return Vector(self.builder, operation(left, right, flags=_FLAGS))

    def __add__(self, other: Any) -> Vector:
        """Sum."""
        return self._emit(self.builder.fadd, self.value, self._of(other))

    def __sub__(self, other: Any) -> Vector:
        """Difference."""
        return self._emit(self.builder.fsub, self.value, self._of(other))

    def __mul__(self, other: Any) -> Vector:
        """Product."""
        return self._emit(self.builder.fmul, self.value, self._of(other))

    def __truediv__(self, other: Any) -> Vector:
        """Quotient."""
        return self._emit(self.builder.fdiv, self.value, self._of(other))

    def __rtruediv__(self, other: Any) -> Vector:
        """Quotient of a number."""
        return self._emit(self.builder.fdiv, self._of(other), self.value)

    __radd__ = __add__
    __rmul__ = __mul__

    def sqrt(self) -> Vector:
        """Square root, by one instruction; `numpy.sqrt` calls this."""
        kind = self.value.type
        function = _declared(
            self.builder.module, ir.FunctionType(kind, [kind]), f"llvm.sqrt.v{kind.count}f64"
        )
        return Vector(self.builder, self.builder.call(function, [self.value]))


def _splat_of(builder: Any, scalar: Any) -> Any:
    """Return a vector whose numbers are all `scalar`."""
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    one = builder.insert_element(undefined, scalar, ir.Constant(_INT32, 0))
    return builder.shuffle_vector(
        one, undefined, ir.Constant(ir.VectorType(_INT32, WIDTH), [0] * WIDTH)
    )


def row_pass(formula: Callable[..., Sequence[Sequence[Vector]]], rows: Sequence[int]) -> Any:
    """Return `apply(scalars, n, a, a0, a_row, b, b0, b_row, c, c0, c_row)` for kernels: one pass
    over three arrays.

    formula(s, a, b, c) gets the scalars (a tuple of float64 in kernels) and `rows[k]` rows of each
    array, and returns the new first rows of each array in turn; an empty list leaves them as they
    are.
    All rows have length n, row r of `a` beginning at a0 + r a_row. Of each column everything is
    read before anything is written.
    """

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        scalars = args[0]
        n = args[1]
        splats = [
            Vector(builder, _splat_of(builder, builder.extract_value(scalars, k)))
            for k in range(sig.args[0].count)
        ]
        starts = []
        for k, count in enumerate(rows):
            array, offset, stride = args[2 + 3 * k : 5 + 3 * k]
            data = context.make_array(sig.args[2 + 3 * k])(context, builder, array).data
            places = [offset]
            for _ in range(count - 1):
                places.append(builder.add(places[-1], stride))
            starts.append([builder.gep(data, [place]) for place in places])
        width = ir.Constant(n.type, WIDTH)
        with cgutils.for_range(builder, builder.sdiv(n, width)) as loop:
            shift = builder.mul(loop.index, width)
            at = [
                [builder.bitcast(builder.gep(p, [shift]), _VECTOR.as_pointer()) for p in group]
                for group in starts
            ]
            loaded = [
                [Vector(builder, builder.load(p, align=8)) for p in pointers] for pointers in at
            ]
            for pointers, values in zip(at, formula(splats, *loaded), strict=True):
                for pointer, value in zip(pointers[: len(values)], values, strict=True):
                    builder.store(value.value, pointer, align=8)
        return context.get_dummy_value()

    @intrinsic
    def apply(  # type: ignore[no-untyped-def]
        typingctx, scalars, n, a, a0, a_row, b, b0, b_row, c, c0, c_row
    ):
        i = types.intp
        return types.void(scalars, i, a, i, i, b, i, i, c, i, i), generate

    return apply


class _Parameters:
    """A table's vectors, for a formula that asks for q[k]."""

    def __init__(self, builder: Any, load: Callable[[int], Any]) -> None:
        self.builder = builder
        self.load = load

    def __getitem__(self, k: int) -> Vector:
        return Vector(self.builder, self.load(k))


def in_lanes(formula: Callable[..., Any]) -> Any:
    """Return what plain_rows.in_lanes returns, with all lanes in one vector."""
    kind = ir.VectorType(ir.DoubleType(), LANES)

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        table = context.make_array(sig.args[0])(context, builder, args[0]).data
        state = context.make_array(sig.args[2])(context, builder, args[2]).data
        start = args[1]

        def pointer(data: Any, offset: Any) -> Any:
            return builder.bitcast(builder.gep(data, [offset]), kind.as_pointer())

        def load_parameter(k: int) -> Any:
            offset = builder.add(start, ir.Constant(start.type, k * LANES))
            return builder.load(pointer(table, offset), align=8)

        entries = [pointer(state, ir.Constant(start.type, k * LANES)) for k in range(STATE)]
        before = tuple(Vector(builder, builder.load(entry, align=8)) for entry in entries)
        found = formula(_Parameters(builder, load_parameter), 0, 1, before)
        for entry, value in zip(entries, found, strict=True):
            builder.store(value.value, entry, align=8)
        return context.get_dummy_value()

    @intrinsic
    def apply(typingctx, table, at, state):  # type: ignore[no-untyped-def]
        return types.void(table, types.intp, state), generate

    return apply
