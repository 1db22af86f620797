# SPDX-License-Identifier: GPL-3.0-or-later
"""Convert a parsed TFLite model to ONNX with named outputs, without operators that no kept output
needs.
"""

import onnx
from onnx import TensorProto, helper

from ...solver.errors import ModelFileError
from .blocked import replace_prelu
from .constants import fold_constants
from .graph import Graph
from .operators import CONVERTERS
from .tflite import Model, Operator

OPSET = 17
IR_VERSION = 8  # the lowest for this opset, which old releases of onnxruntime also read


Outputs = tuple[tuple[int, str, tuple[int, ...]], ...]


def convert_model(
    model: Model,
    input_shape: tuple[int, ...],
    outputs: Outputs,
    on_request: Outputs = (),
    blocked: bool = False,
) -> onnx.ModelProto:
    """Return an ONNX model with the given outputs and one input, pictures as (batch, channels,
    height, width).

    ``input_shape`` and the shapes in ``outputs``, (position, name, shape), are TFLite's (NHWC) and
    are checked. Rank-4 outputs become NCHW.

    :param on_request: further outputs, each computed only if the scalar boolean input
        ``with_NAME``, false by default, is true; of shape (1, ...) and 0 otherwise. onnxruntime
        runs every node of a graph whatever outputs it is asked for, but only the branch of an
        ``If`` that is taken.
    :param blocked: whether to use only operators that onnxruntime runs in its blocked layout, which
        is faster, where PReLU and padded channels are what prevents it; see `blocked`. Not together
        with ``on_request``.
    :raises ModelFileError: when shapes differ from those given, or an operator is not supported.
    """
    input_shapes = [model.tensors[i].shape for i in model.inputs]
    if input_shapes != [input_shape]:
        raise ModelFileError(f"{model.name}: inputs {input_shapes}, expected {input_shape}.")
    for position, name, shape in outputs + on_request:
        found = (
            model.tensors[model.outputs[position]].shape if position < len(model.outputs) else None
        )
        if found != shape:
            raise ModelFileError(
                f"{model.name}: output {position} ({name}) has shape {found}, expected {shape}."
            )
    graph = Graph(model, fold_constants(model), blocked=blocked)
    graph.names[model.inputs[0]] = "input"
    kept = [model.outputs[position] for position, _, _ in outputs]
    done = _append_needed(graph, kept, frozenset())
    described = []
    for tensor, (_, name, shape) in zip(kept, outputs, strict=True):
        graph.nodes.append(
            helper.make_node("Identity", [graph.value(tensor)], [name], name=f"output_{name}")
        )
        described.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, _batched(shape)))
    if blocked:
        replace_prelu(graph)
    inputs = [helper.make_tensor_value_info("input", TensorProto.FLOAT, _batched(input_shape))]
    for position, name, shape in on_request:
        inputs.append(_append_branch(graph, model.outputs[position], name, shape, done))
        rank = [None] * len(shape)
        described.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, rank))
    body = helper.make_graph(
        graph.nodes, model.name.rsplit("/", 1)[-1], inputs, described, graph.initializers
    )
    result = helper.make_model(
        body, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="scope"
    )
    result.ir_version = IR_VERSION
    try:
        onnx.checker.check_model(result, full_check=True)
    except (onnx.checker.ValidationError, onnx.shape_inference.InferenceError) as error:
        raise ModelFileError(
            f"{model.name}: the converted graph is not valid ONNX: {error}"
        ) from error
    return result


def _append_needed(graph: Graph, outputs: list[int], done: frozenset[int]) -> frozenset[int]:
    """Append the operators on which the outputs depend, without those done; return those done now,
    by output tensor.
    """
    needed = [
        operator for operator in _needed(graph.model, outputs) if operator.outputs[0] not in done
    ]
    for operator in needed:
        if operator.outputs[0] not in graph.constants:
            _append(graph, operator)
    return done.union(operator.outputs[0] for operator in needed)


def _append_branch(
    graph: Graph, tensor: int, name: str, shape: tuple[int, ...], done: frozenset[int]
) -> onnx.ValueInfoProto:
    """Move what only this output needs into a branch that is computed on request; return the input
    that requests it.
    """
    start = len(graph.nodes)
    before = graph.known()
    _append_needed(graph, [tensor], done)
    result = helper.make_tensor_value_info(
        graph.value(tensor), TensorProto.FLOAT, [None] * len(shape)
    )
    branch = helper.make_graph(graph.nodes[start:], f"{name}_requested", [], [result])
    del graph.nodes[start:]
    graph.forget_since(before)  # values inside a branch cannot be used outside
    nothing = helper.make_tensor(f"no_{name}_value", TensorProto.FLOAT, [1] * len(shape), [0.0])
    constant = helper.make_node("Constant", [], [f"no_{name}"], name=f"no_{name}", value=nothing)
    result = helper.make_tensor_value_info(f"no_{name}", TensorProto.FLOAT, [None] * len(shape))
    otherwise = helper.make_graph([constant], f"{name}_not_requested", [], [result])
    wanted = f"with_{name}"
    # an input's default value
    graph.initializers.append(helper.make_tensor(wanted, TensorProto.BOOL, [], [False]))
    graph.nodes.append(
        helper.make_node(
            "If", [wanted], [name], name=f"output_{name}", then_branch=branch, else_branch=otherwise
        )
    )
    return helper.make_tensor_value_info(wanted, TensorProto.BOOL, [])


def _append(graph: Graph, operator: Operator) -> None:
    if not operator.inputs or operator.inputs[0] < 0:
        raise graph.fail(operator, "it has no input")
    if operator.kind not in CONVERTERS:
        raise graph.fail(operator, "this operator is not supported")
    try:
        CONVERTERS[operator.kind](graph, operator)
    except (ValueError, IndexError) as error:
        raise graph.fail(operator, f"its tensors do not fit it ({error})") from error


def _batched(shape: tuple[int, ...]) -> list[int | str]:
    order = [0, 3, 1, 2] if len(shape) == 4 else list(range(len(shape)))
    # a network may drop the batch of one, ours never does
    kept = order[1:] if shape[:1] == (1,) else order
    return ["batch", *(shape[i] for i in kept)]


def _needed(model: Model, outputs: list[int]) -> list[Operator]:
    """Return the operators on which the outputs depend, in file order, which is execution order."""
    wanted = set(outputs)
    kept = []
    for operator in reversed(model.operators):
        if wanted.intersection(operator.outputs):
            kept.append(operator)
            wanted.update(operator.inputs)
    return kept[::-1]
