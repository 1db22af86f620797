# SPDX-License-Identifier: GPL-3.0-or-later
"""The TFLite operators that move elements without computing: reshape, transpose, slice,
concatenate.
"""

from collections.abc import Callable

import numpy as np

from .graph import NCHW_AXIS, Graph
from .tflite import Operator


def reshape(graph: Graph, operator: Operator) -> None:
    """Convert a reshape to the output tensor's shape; the first dimension stays free for the
    batch.
    """
    source = operator.inputs[0]
    target = graph.shape(operator.outputs[0])
    if not target or target[0] != graph.shape(source)[0]:
        raise graph.fail(
            operator, f"reshape of {graph.shape(source)} to {target} changes the batch"
        )
    name = graph.node(
        "Reshape",
        [graph.channels_last(source), graph.initializer(np.array([-1, *target[1:]], np.int64))],
    )
    if len(target) == 4:
        name = graph.node("Transpose", [name], perm=[0, 3, 1, 2])
    graph.finish(operator, name)


def transpose(graph: Graph, operator: Operator) -> None:
    """Convert a transpose that leaves the batch where it is."""
    source = operator.inputs[0]
    order = graph.constant(operator, 1).tolist()
    rank = len(graph.shape(source))
    if sorted(order) != list(range(rank)) or order[0] != 0:
        raise graph.fail(operator, f"axes {order} of a rank-{rank} tensor")
    if rank == 4:  # TFLite's axis i of the output is ONNX's axis NCHW_AXIS[i]
        moved = dict(zip(NCHW_AXIS, (NCHW_AXIS[axis] for axis in order), strict=True))
        order = [moved[axis] for axis in range(rank)]
    graph.finish(operator, graph.node("Transpose", [graph.value(source)], perm=order))


def strided_slice(graph: Graph, operator: Operator) -> None:
    """Convert a slice begin:end:1 along axes other than the batch, whole or dropped, which stays as
    it is.
    """
    source = operator.inputs[0]
    options = operator.options
    begin, end, step = (graph.constant(operator, i) for i in (1, 2, 3))
    shape = graph.shape(source)
    drops_batch = options["shrink_axis_mask"] == 1 and shape[0] == 1
    supported = (drops_batch or not options["shrink_axis_mask"]) and not (
        options["ellipsis_mask"] or options["new_axis_mask"]
    )
    if (
        not supported
        or not (len(begin) == len(end) == len(step) == len(shape))
        or (step != 1).any()
    ):
        raise graph.fail(
            operator, f"slice {begin.tolist()}:{end.tolist()}:{step.tolist()} with masks {options}"
        )
    name = graph.value(source)
    for axis in range(1, len(shape)):
        low = 0 if options["begin_mask"] >> axis & 1 else int(begin[axis])
        high = shape[axis] if options["end_mask"] >> axis & 1 else int(end[axis])
        if (low, high) != (0, shape[axis]):
            limits = [graph.initializer(np.array([value], np.int64)) for value in (low, high)]
            along = graph.initializer(np.array([graph.axis(operator, source, axis)], np.int64))
            name = graph.node("Slice", [name, *limits, along])
    graph.finish(operator, name)


def concatenation(graph: Graph, operator: Operator) -> None:
    """Convert a concatenation along the same axis, renumbered for rank 4; constants are repeated
    for the batch.
    """
    axis = graph.axis(operator, operator.outputs[0], operator.options["axis"])
    computed = next((i for i in operator.inputs if i not in graph.constants), None)
    if computed is None or axis == 0:
        raise graph.fail(operator, "only constants, or along the batch")
    batch = ""
    names = []
    for tensor in operator.inputs:
        names.append(graph.value(tensor))
        if tensor in graph.constants:
            batch = batch or graph.node("Shape", [graph.value(computed)], start=0, end=1)
            rest = graph.initializer(np.ones(len(graph.shape(tensor)) - 1, np.int64))
            names[-1] = graph.node(
                "Expand", [names[-1], graph.node("Concat", [batch, rest], axis=0)]
            )
    graph.finish(operator, graph.node("Concat", names, axis=axis))


LAYOUT: dict[str, Callable[[Graph, Operator], None]] = {
    "CONCATENATION": concatenation,
    "RESHAPE": reshape,
    "STRIDED_SLICE": strided_slice,
    "TRANSPOSE": transpose,
}
