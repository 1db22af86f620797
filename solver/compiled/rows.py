# SPDX-License-Identifier: GPL-3.0-or-later
"""Short rows of doubles in vector registers: the few operations that carry the solver's arithmetic.

The number of shape columns is known only at run time, and a compiler leaves a run-time loop of ten
turns scalar. All rows are therefore padded with zeros to a multiple of `WIDTH`, and these
intrinsics work on `WIDTH` doubles at a time; LLVM lowers such a vector to whatever the processor
has (AVX, two NEON registers, ...).

Arrays are C-contiguous float64 of any rank; positions are flat element offsets, so `a[i, r, :]` of
an array (n, 3, W) starts at `(3 * i + r) * W`. Nothing is checked: these are for kernels whose
sizes are already known.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic as _intrinsic

WIDTH = 4
VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_INT32 = ir.IntType(32)
intrinsic: Any = _intrinsic  # its first parameter is the compiler's, which type checkers do not see


def padded(n: int) -> int:
    """Return `n` rounded up to a multiple of `WIDTH`."""
    return -(-n // WIDTH) * WIDTH


def splat_of(builder: Any, scalar: Any) -> Any:
    """Return a vector whose lanes are all `scalar`."""
    undefined = ir.Constant(VECTOR, ir.Undefined)
    one = builder.insert_element(undefined, scalar, ir.Constant(_INT32, 0))
    return builder.shuffle_vector(
        one, undefined, ir.Constant(ir.VectorType(_INT32, WIDTH), [0] * WIDTH)
    )


def _combine(context: Any, builder: Any, sig: Any, args: Any, terms: int) -> Any:
    """Emit dst[d:d+n] += sum_k a_k src[s_k:s_k+n]."""
    dst = args[0]
    d = args[1]
    scales = args[2 : 2 + terms]
    src = args[2 + terms]
    offsets = args[3 + terms : 3 + 2 * terms]
    n = args[-1]
    dst_data = context.make_array(sig.args[0])(context, builder, dst).data
    src_data = context.make_array(sig.args[2 + terms])(context, builder, src).data

    def at(data: Any, offset: Any) -> Any:
        return builder.bitcast(builder.gep(data, [offset]), VECTOR.as_pointer())

    splats = [splat_of(builder, a) for a in scales]
    width = ir.Constant(n.type, WIDTH)
    with cgutils.for_range(builder, builder.sdiv(n, width)) as loop:
        shift = builder.mul(loop.index, width)
        target = at(dst_data, builder.add(d, shift))
        total = builder.load(target, align=8)
        for splat, offset in zip(splats, offsets, strict=True):
            value = builder.load(at(src_data, builder.add(offset, shift)), align=8)
            product = builder.fmul(splat, value, flags=["contract"])
            total = builder.fadd(total, product, flags=["contract"])
        builder.store(total, target, align=8)
    return context.get_dummy_value()


@intrinsic
def clear(typingctx, dst, d, n):  # type: ignore[no-untyped-def]
    """dst[d:d+n] = 0."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        width = ir.Constant(args[2].type, WIDTH)
        with cgutils.for_range(builder, builder.sdiv(args[2], width)) as loop:
            place = builder.add(args[1], builder.mul(loop.index, width))
            target = builder.bitcast(builder.gep(data, [place]), VECTOR.as_pointer())
            builder.store(ir.Constant(VECTOR, [0.0] * WIDTH), target, align=8)
        return context.get_dummy_value()

    return types.void(dst, types.intp, types.intp), generate


@intrinsic
def copy(typingctx, dst, d, src, s, n):  # type: ignore[no-untyped-def]
    """dst[d:d+n] = src[s:s+n]."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        to, source = (
            context.make_array(sig.args[k])(context, builder, args[k]).data for k in (0, 2)
        )
        width = ir.Constant(args[4].type, WIDTH)
        with cgutils.for_range(builder, builder.sdiv(args[4], width)) as loop:
            shift = builder.mul(loop.index, width)
            places = ((source, args[3]), (to, args[1]))
            a, b = (builder.gep(data, [builder.add(offset, shift)]) for data, offset in places)
            value = builder.load(builder.bitcast(a, VECTOR.as_pointer()), align=8)
            builder.store(value, builder.bitcast(b, VECTOR.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(dst, types.intp, src, types.intp, types.intp), generate


@intrinsic
def add1(typingctx, dst, d, a, src, s, n):  # type: ignore[no-untyped-def]
    """dst[d:d+n] += a src[s:s+n]."""
    i = types.intp
    f = types.float64
    return types.void(dst, i, f, src, i, i), lambda c, b, sig, args: _combine(c, b, sig, args, 1)


@intrinsic
def add3(typingctx, dst, d, a0, a1, a2, src, s0, s1, s2, n):  # type: ignore[no-untyped-def]
    """dst[d:d+n] += a0 src[s0:s0+n] + a1 src[s1:s1+n] + a2 src[s2:s2+n]."""
    i = types.intp
    f = types.float64
    return types.void(dst, i, f, f, f, src, i, i, i, i), lambda c, b, sig, args: _combine(
        c, b, sig, args, 3
    )
