# SPDX-License-Identifier: GPL-3.0-or-later
"""Short rows of doubles in vector registers: the few operations that carry the solver's arithmetic.

The number of shape columns is known only at run time, and a compiler leaves a run-time loop of ten turns scalar.
All rows are therefore padded with zeros to a multiple of `LANES`, and these intrinsics work on `LANES` doubles at a
time; LLVM lowers such a vector to whatever the processor has (AVX, two NEON registers, ...).

Arrays are C-contiguous float64 of any rank; positions are flat element offsets, so `a[i, r, :]` of an array
(n, 3, W) starts at `(3 * i + r) * W`. Nothing is checked: these are for kernels whose sizes are already known.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic as _intrinsic

LANES = 4
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_INT32 = ir.IntType(32)
intrinsic: Any = _intrinsic  # its first parameter is the compiler's, which type checkers do not see


def padded(n: int) -> int:
    """Return `n` rounded up to a multiple of `LANES`."""
    return -(-n // LANES) * LANES


def _splat(builder: Any, scalar: Any) -> Any:
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    one = builder.insert_element(undefined, scalar, ir.Constant(_INT32, 0))
    return builder.shuffle_vector(one, undefined, ir.Constant(ir.VectorType(_INT32, LANES), [0] * LANES))


def _combine(context: Any, builder: Any, sig: Any, args: Any, terms: int, keep: bool) -> Any:
    """Emit dst[d:d+n] = (keep ? dst : 0) + sum_k a_k src[s_k:s_k+n]."""
    dst, d = args[0], args[1]
    scales, src, offsets, n = args[2 : 2 + terms], args[2 + terms], args[3 + terms : 3 + 2 * terms], args[-1]
    dst_data = context.make_array(sig.args[0])(context, builder, dst).data
    src_data = context.make_array(sig.args[2 + terms])(context, builder, src).data

    def at(data: Any, offset: Any) -> Any:
        return builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer())

    splats = [_splat(builder, a) for a in scales]
    lanes = ir.Constant(n.type, LANES)
    with cgutils.for_range(builder, builder.sdiv(n, lanes)) as loop:
        shift = builder.mul(loop.index, lanes)
        target = at(dst_data, builder.add(d, shift))
        total = builder.load(target, align=8) if keep else None
        for splat, offset in zip(splats, offsets, strict=True):
            value = builder.load(at(src_data, builder.add(offset, shift)), align=8)
            product = builder.fmul(splat, value, flags=["contract"])
            total = product if total is None else builder.fadd(total, product, flags=["contract"])
        builder.store(total, target, align=8)
    return context.get_dummy_value()


@intrinsic
def add1(typingctx, dst, d, a, src, s, n):  # type: ignore[no-untyped-def]
    """dst[d:d+n] += a src[s:s+n]."""
    i, f = types.intp, types.float64
    return types.void(dst, i, f, src, i, i), lambda c, b, sig, args: _combine(c, b, sig, args, 1, True)


@intrinsic
def add3(typingctx, dst, d, a0, a1, a2, src, s0, s1, s2, n):  # type: ignore[no-untyped-def]
    """dst[d:d+n] += a0 src[s0:s0+n] + a1 src[s1:s1+n] + a2 src[s2:s2+n]."""
    i, f = types.intp, types.float64
    return types.void(dst, i, f, f, f, src, i, i, i, i), lambda c, b, sig, args: _combine(c, b, sig, args, 3, True)


@intrinsic
def set3(typingctx, dst, d, a0, a1, a2, src, s0, s1, s2, n):  # type: ignore[no-untyped-def]
    """dst[d:d+n] = a0 src[s0:s0+n] + a1 src[s1:s1+n] + a2 src[s2:s2+n]; dst may be one of the sources."""
    i, f = types.intp, types.float64
    return types.void(dst, i, f, f, f, src, i, i, i, i), lambda c, b, sig, args: _combine(c, b, sig, args, 3, False)


def _block(context: Any, builder: Any, sig: Any, args: Any, keep: bool) -> Any:
    """Emit three rows of dst from three rows of src; each vector of src is loaded once for all three."""
    dst, d, d_row, entries, src, s, s_row, n = args
    dst_data = context.make_array(sig.args[0])(context, builder, dst).data
    src_data = context.make_array(sig.args[4])(context, builder, src).data
    splats = [_splat(builder, builder.extract_value(entries, k)) for k in range(9)]
    two = ir.Constant(n.type, 2)
    targets = [d, builder.add(d, d_row), builder.add(d, builder.mul(two, d_row))]
    sources = [s, builder.add(s, s_row), builder.add(s, builder.mul(two, s_row))]
    lanes = ir.Constant(n.type, LANES)

    def at(data: Any, offset: Any, shift: Any) -> Any:
        return builder.bitcast(builder.gep(data, [builder.add(offset, shift)]), _VECTOR.as_pointer())

    with cgutils.for_range(builder, builder.sdiv(n, lanes)) as loop:
        shift = builder.mul(loop.index, lanes)
        values = [builder.load(at(src_data, offset, shift), align=8) for offset in sources]
        pointers = [at(dst_data, offset, shift) for offset in targets]
        totals = [builder.load(pointer, align=8) if keep else None for pointer in pointers]
        for r, pointer in enumerate(pointers):
            total = totals[r]
            for k in range(3):
                product = builder.fmul(splats[3 * r + k], values[k], flags=["contract"])
                total = product if total is None else builder.fadd(total, product, flags=["contract"])
            builder.store(total, pointer, align=8)
    return context.get_dummy_value()


def _block_signature(dst: Any, src: Any) -> Any:
    i = types.intp
    return types.void(dst, i, i, types.UniTuple(types.float64, 9), src, i, i, i)


@intrinsic
def add_block(typingctx, dst, d, d_row, entries, src, s, s_row, n):  # type: ignore[no-untyped-def]
    """dst_r += sum_k entries[3 r + k] src_k for r = 0, 1, 2; rows of length n at d + r d_row and s + k s_row."""
    return _block_signature(dst, src), lambda c, b, sig, args: _block(c, b, sig, args, True)


@intrinsic
def set_block(typingctx, dst, d, d_row, entries, src, s, s_row, n):  # type: ignore[no-untyped-def]
    """dst_r = sum_k entries[3 r + k] src_k for r = 0, 1, 2; dst may be the same rows as src."""
    return _block_signature(dst, src), lambda c, b, sig, args: _block(c, b, sig, args, False)
