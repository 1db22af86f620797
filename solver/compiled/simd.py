# SPDX-License-Identifier: GPL-3.0-or-later
"""The same formula for several joints at once: arithmetic on vectors of `LANES` doubles inside compiled kernels.

A formula is a plain function of numbers, `formula(q, s) -> list`, with parameters q(k) and a state s, a list. It uses
+, -, *, / and `sqrt` and no branches. Called with floats or numpy arrays it computes at once; `step` turns it into a
function for kernels that applies it to a state whose entry k is the vector state[k * LANES : (k + 1) * LANES].
LLVM lowers the vectors to whatever the processor has, as for rows.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic as _intrinsic

LANES = 8
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_FLAGS = ("contract", "nsz")
intrinsic: Any = _intrinsic  # its first parameter is the compiler's, which type checkers do not see


class Lanes:
    """A vector while code is generated for it; operators emit instructions."""

    def __init__(self, builder: Any, value: Any) -> None:
        """Wrap an LLVM value of type <LANES x double>."""
        self.builder, self.value = builder, value

    def _of(self, other: Any) -> Any:
        if isinstance(other, Lanes):
            return other.value
        return ir.Constant(_VECTOR, [float(other)] * LANES)

    def __add__(self, other: Any) -> Lanes:
        """Sum."""
        return Lanes(self.builder, self.builder.fadd(self.value, self._of(other), flags=_FLAGS))

    def __sub__(self, other: Any) -> Lanes:
        """Difference."""
        return Lanes(self.builder, self.builder.fsub(self.value, self._of(other), flags=_FLAGS))

    def __mul__(self, other: Any) -> Lanes:
        """Product."""
        return Lanes(self.builder, self.builder.fmul(self.value, self._of(other), flags=_FLAGS))

    def __truediv__(self, other: Any) -> Lanes:
        """Quotient."""
        return Lanes(self.builder, self.builder.fdiv(self.value, self._of(other), flags=_FLAGS))

    def __rsub__(self, other: Any) -> Lanes:
        """Difference from a number."""
        return Lanes(self.builder, self.builder.fsub(self._of(other), self.value, flags=_FLAGS))

    def __rtruediv__(self, other: Any) -> Lanes:
        """Quotient of a number."""
        return Lanes(self.builder, self.builder.fdiv(self._of(other), self.value, flags=_FLAGS))

    __radd__, __rmul__ = __add__, __mul__

    def sqrt(self) -> Lanes:
        """Square root, by one instruction."""
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        function = cgutils.get_or_insert_function(self.builder.module, kind, f"llvm.sqrt.v{LANES}f64")
        return Lanes(self.builder, self.builder.call(function, [self.value]))


def sqrt(x: Any) -> Any:
    """Return the square root of a number, an array or a vector of lanes."""
    return x.sqrt() if isinstance(x, Lanes) else np.sqrt(x)


def step(formula: Callable[[Callable[[int], Any], list], Sequence[Any]], reads: int) -> Any:
    """Return `apply(table, at, state)` for kernels: state <- formula(q, state[:reads]), written from entry 0 on.

    q(k) is the vector of `table`'s elements at + k LANES and following. Both arrays are C-contiguous float64 of any
    rank, read and written as flat; nothing is checked.
    """

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        table = context.make_array(sig.args[0])(context, builder, args[0]).data
        state = context.make_array(sig.args[2])(context, builder, args[2]).data
        index = args[1].type

        def at(data: Any, offset: Any) -> Any:
            return builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer())

        def parameter(k: int) -> Lanes:
            offset = builder.add(args[1], ir.Constant(index, k * LANES))
            return Lanes(builder, builder.load(at(table, offset), align=8))

        given = [Lanes(builder, builder.load(at(state, ir.Constant(index, k * LANES)), align=8)) for k in range(reads)]
        for k, value in enumerate(formula(parameter, given)):
            builder.store(value.value, at(state, ir.Constant(index, k * LANES)), align=8)
        return context.get_dummy_value()

    @intrinsic
    def apply(typingctx, table, at, state):  # type: ignore[no-untyped-def]
        return types.void(table, types.intp, state), generate

    return apply
