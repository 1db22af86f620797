# SPDX-License-Identifier: GPL-3.0-or-later
"""Gram products C += XᵀZ of tall X and Z.

Tiles of C, four rows by one to three vectors, stay in registers over all rows of X and Z.

Only tiles on and above the diagonal are touched. Rows are as in rows.py.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from ..compiled.kernel import kernel
from ..compiled.rows import VECTOR, WIDTH, intrinsic, splat_of

_variable: Any = cgutils.alloca_once_value  # untyped


def _tile(vectors: int, sign: int) -> Any:
    """Return `tile(C, at, c_row, X, x, x_row, Z, z, z_row, count)`: four rows of C, `vectors` wide,
    += sign XᵀZ.
    """

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        C, at, c_row, X, x, x_row, Z, z, z_row, count = args
        c_data, x_data, z_data = (
            context.make_array(sig.args[k])(context, builder, args[k]).data for k in (0, 3, 6)
        )

        def vector_at(data: Any, place: Any, v: int) -> Any:
            place = builder.add(place, ir.Constant(place.type, v * WIDTH))
            return builder.bitcast(builder.gep(data, [place]), VECTOR.as_pointer())

        starts = [at]
        for _ in range(3):
            starts.append(builder.add(starts[-1], c_row))
        targets = [[vector_at(c_data, start, v) for v in range(vectors)] for start in starts]
        sums = [[_variable(builder, builder.load(p, align=8)) for p in row] for row in targets]
        with cgutils.for_range(builder, count) as loop:
            left = builder.gep(x_data, [builder.add(x, builder.mul(loop.index, x_row))])
            right = builder.add(z, builder.mul(loop.index, z_row))
            values = [builder.load(vector_at(z_data, right, v), align=8) for v in range(vectors)]
            for r in range(4):
                splat = splat_of(
                    builder, builder.load(builder.gep(left, [ir.Constant(at.type, r)]), align=8)
                )
                for v in range(vectors):
                    product = builder.fmul(splat, values[v], flags=["contract"])
                    add = builder.fadd if sign > 0 else builder.fsub
                    builder.store(
                        add(builder.load(sums[r][v]), product, flags=["contract"]), sums[r][v]
                    )
        for row, pointers in zip(sums, targets, strict=True):
            for total, pointer in zip(row, pointers, strict=True):
                builder.store(builder.load(total), pointer, align=8)
        return context.get_dummy_value()

    @intrinsic
    def tile(typingctx, C, at, c_row, X, x, x_row, Z, z, z_row, count):  # type: ignore[no-untyped-def]
        i = types.intp
        return types.void(C, i, i, X, i, i, Z, i, i, i), generate

    return tile


_plus1 = _tile(1, 1)
_plus2 = _tile(2, 1)
_plus3 = _tile(3, 1)
_minus1 = _tile(1, -1)
_minus2 = _tile(2, -1)
_minus3 = _tile(3, -1)


@kernel
def add_gram(C, W, X, x, x_row, Z, z, z_row, count) -> None:  # type: ignore[no-untyped-def]
    """C += XᵀZ in the upper triangle of C (W, W), at least, for X and Z of `count` rows."""
    for a in range(0, W, 4):
        b = a
        while b + 12 <= W:
            _plus3(C, a * W + b, W, X, x + a, x_row, Z, z + b, z_row, count)
            b += 12
        if b + 8 == W:
            _plus2(C, a * W + b, W, X, x + a, x_row, Z, z + b, z_row, count)
        elif b + 4 == W:
            _plus1(C, a * W + b, W, X, x + a, x_row, Z, z + b, z_row, count)


@kernel
def subtract_gram(C, W, X, x, x_row, count) -> None:  # type: ignore[no-untyped-def]
    """C -= XᵀX in the upper triangle of C (W, W), at least, for X of `count` rows."""
    for a in range(0, W, 4):
        b = a
        while b + 12 <= W:
            _minus3(C, a * W + b, W, X, x + a, x_row, X, x + b, x_row, count)
            b += 12
        if b + 8 == W:
            _minus2(C, a * W + b, W, X, x + a, x_row, X, x + b, x_row, count)
        elif b + 4 == W:
            _minus1(C, a * W + b, W, X, x + a, x_row, X, x + b, x_row, count)


@kernel
def subtract_gram_below(C, W, X, x, x_row, count, first) -> None:  # type: ignore[no-untyped-def]
    """`subtract_gram` of an X whose column first + j is zero above row 3 (j // 3), for j below
    `count`.

    `first` and `count` are multiples of four: tiles are skipped as a whole.
    """
    for a in range(0, W, 4):
        a_skip = 3 * ((a - first) // 3) if first <= a < first + count else 0
        b = a
        while b < W:
            width = min(12, W - b)
            skip = 3 * ((b - first) // 3) if first <= b and b + width <= first + count else 0
            skip = max(skip, a_skip)
            rows = count - skip
            left = x + a + skip * x_row
            right = x + b + skip * x_row
            if width == 12:
                _minus3(C, a * W + b, W, X, left, x_row, X, right, x_row, rows)
            elif width == 8:
                _minus2(C, a * W + b, W, X, left, x_row, X, right, x_row, rows)
            else:
                _minus1(C, a * W + b, W, X, left, x_row, X, right, x_row, rows)
            b += width


@kernel
def subtract_gram_rows(C, at, c_row, X, x, x_row, Z, z, z_row, count, width) -> None:  # type: ignore[no-untyped-def]
    """C -= XᵀZ for four rows of C from the element `at` on, and a width that is a multiple of four.

    X has four columns from x on, Z `width` from z on, and both `count` rows. C may follow them in
    one array.
    """
    b = 0
    while b + 12 <= width:
        _minus3(C, at + b, c_row, X, x, x_row, Z, z + b, z_row, count)
        b += 12
    if b + 8 == width:
        _minus2(C, at + b, c_row, X, x, x_row, Z, z + b, z_row, count)
    elif b + 4 == width:
        _minus1(C, at + b, c_row, X, x, x_row, Z, z + b, z_row, count)
