# SPDX-License-Identifier: GPL-3.0-or-later
"""The TFLite operators that compute element by element or reduce along axes, as ONNX nodes."""

from collections.abc import Callable

import numpy as np

from .graph import Graph
from .tflite import Operator

Converter = Callable[[Graph, Operator], None]


def _elementwise(kind: str) -> Converter:
    """Return the converter of an operator of one or two operands that ONNX calls ``kind``."""

    def convert(graph: Graph, operator: Operator) -> None:
        graph.finish(operator, graph.node(kind, _operands(graph, operator)))

    return convert


def _operands(graph: Graph, operator: Operator) -> list[str]:
    """Return the values of the operands; of two computed ones, the ranks must agree, as NCHW allows
    no padding.
    """
    rank = len(graph.shape(operator.outputs[0]))
    for tensor in operator.inputs:
        if tensor not in graph.constants and len(graph.shape(tensor)) != rank:
            raise graph.fail(
                operator, f"an operand of shape {graph.shape(tensor)} for a result of rank {rank}"
            )
    return [graph.operand(tensor, rank) for tensor in operator.inputs]


def squared_difference(graph: Graph, operator: Operator) -> None:
    """Convert (a − b)²."""
    difference = graph.node("Sub", _operands(graph, operator))
    graph.finish(operator, graph.node("Mul", [difference, difference]))


def reciprocal_root(graph: Graph, operator: Operator) -> None:
    """Convert 1 / √x."""
    graph.finish(
        operator, graph.node("Reciprocal", [graph.node("Sqrt", _operands(graph, operator))])
    )


def mean(graph: Graph, operator: Operator) -> None:
    """Convert the mean along axes."""
    axes, keep = _reduced(graph, operator)
    graph.finish(
        operator,
        graph.node("ReduceMean", [graph.value(operator.inputs[0])], axes=axes, keepdims=keep),
    )


def total(graph: Graph, operator: Operator) -> None:
    """Convert the sum along axes, which this version of ONNX takes as an input."""
    axes, keep = _reduced(graph, operator)
    inputs = [graph.value(operator.inputs[0]), graph.initializer(np.array(axes, np.int64))]
    graph.finish(operator, graph.node("ReduceSum", inputs, keepdims=keep))


def _reduced(graph: Graph, operator: Operator) -> tuple[list[int], int]:
    """Return the ONNX axes along which to reduce, and 1 if they stay as axes of length 1."""
    source = operator.inputs[0]
    axes = sorted(
        graph.axis(operator, source, int(a)) for a in np.atleast_1d(graph.constant(operator, 1))
    )
    keep = bool(operator.options["keep_dims"])
    rank = len(graph.shape(source))
    # others would leave the channels where they are
    if 0 in axes or (rank == 4 and not keep and axes != [2, 3]):
        raise graph.fail(operator, f"axes {axes} of a rank-{rank} tensor, keep_dims {keep}")
    return axes, int(keep)


ARITHMETIC: dict[str, Converter] = {
    "ADD": _elementwise("Add"),
    "DIV": _elementwise("Div"),
    "LOGISTIC": _elementwise("Sigmoid"),
    "MEAN": mean,
    "MUL": _elementwise("Mul"),
    "NEG": _elementwise("Neg"),
    "RSQRT": reciprocal_root,
    "SQRT": _elementwise("Sqrt"),
    "SQUARED_DIFFERENCE": squared_difference,
    "SUB": _elementwise("Sub"),
    "SUM": total,
}
