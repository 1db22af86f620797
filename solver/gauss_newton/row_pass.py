# SPDX-License-Identifier: GPL-3.0-or-later
"""One pass over the rows of up to three arrays, made from a formula.

Doing all that is to be done to some rows while they are in registers saves most loads and stores,
which is what short rows cost. Rows are as in rows.py.
"""

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from ..compiled.rows import VECTOR, WIDTH, intrinsic, splat_of


class _Row:
    """A SIMD vector of a row during code generation; its operators emit LLVM instructions."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder = builder
        self.value = value

    def __add__(self, other: "_Row") -> "_Row":
        return _Row(self.builder, self.builder.fadd(self.value, other.value, flags=["contract"]))

    def __sub__(self, other: "_Row") -> "_Row":
        return _Row(self.builder, self.builder.fsub(self.value, other.value, flags=["contract"]))

    def __mul__(self, other: "_Row") -> "_Row":
        return _Row(self.builder, self.builder.fmul(self.value, other.value, flags=["contract"]))


class _Any:
    """Placeholder for a vector where only the number of results is wanted."""

    def __add__(self, other: object) -> "_Any":
        return self

    __sub__ = __mul__ = __add__


def _counted(scalars: int, rows: Sequence[int]) -> list[list[_Any]]:
    return [[_Any()] * count for count in (scalars, *rows)]


def row_pass(formula: Callable[..., Sequence[Sequence["_Row"]]], rows: Sequence[int]) -> Any:
    """Return `apply(scalars, n, a, a0, a_row, b, b0, b_row, c, c0, c_row)` for kernels: one pass
    over three arrays.

    formula(s, a, b, c) gets the scalars (a tuple of float64 in kernels) and `rows[k]` rows of each
    array, and returns the new rows of each array in turn; an empty list leaves them as they are.
    All rows have length n, row r of `a` beginning at a0 + r a_row. Of each column everything is
    read before anything is written.
    """

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        scalars = args[0]
        n = args[1]
        written = [len(list(group)) for group in formula(*_counted(sig.args[0].count, rows))]
        splats = [
            _Row(builder, splat_of(builder, builder.extract_value(scalars, k)))
            for k in range(sig.args[0].count)
        ]
        starts = []
        for k, count in enumerate(rows):
            array, offset, stride = args[2 + 3 * k : 5 + 3 * k]
            data = context.make_array(sig.args[2 + 3 * k])(context, builder, array).data
            places = [offset]
            for _ in range(max(count, written[k]) - 1):
                places.append(builder.add(places[-1], stride))
            starts.append([builder.gep(data, [place]) for place in places])
        width = ir.Constant(n.type, WIDTH)
        with cgutils.for_range(builder, builder.sdiv(n, width)) as loop:
            shift = builder.mul(loop.index, width)
            at = [
                [builder.bitcast(builder.gep(p, [shift]), VECTOR.as_pointer()) for p in group]
                for group in starts
            ]
            loaded = [
                [_Row(builder, builder.load(p, align=8)) for p in at[k][:count]]
                for k, count in enumerate(rows)
            ]
            for pointers, values in zip(at, formula(splats, *loaded), strict=True):
                for pointer, value in zip(pointers[: len(values)], values, strict=True):
                    builder.store(value.value, pointer, align=8)
        return context.get_dummy_value()

    @intrinsic
    def apply(typingctx, scalars, n, a, a0, a_row, b, b0, b_row, c, c0, c_row):  # type: ignore[no-untyped-def]
        i = types.intp
        return types.void(scalars, i, a, i, i, b, i, i, c, i, i), generate

    return apply
