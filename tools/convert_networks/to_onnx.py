# SPDX-License-Identifier: GPL-3.0-or-later
"""Convert a parsed TFLite model to ONNX with named outputs, without operators that no kept output needs."""

import onnx
from onnx import TensorProto, helper

from ...solver.errors import ModelFileError
from .constants import fold_constants
from .graph import Graph
from .operators import CONVERTERS
from .tflite import Model, Operator

OPSET = 17
IR_VERSION = 8  # the lowest for this opset, which old releases of onnxruntime also read


def convert_model(
    model: Model, input_shape: tuple[int, ...], outputs: tuple[tuple[int, str, tuple[int, ...]], ...]
) -> onnx.ModelProto:
    """Return an ONNX model with one input ``input`` (batch, channels, height, width) and the given outputs.

    ``input_shape`` and the shapes in ``outputs``, (position, name, shape), are TFLite's (NHWC) and are checked. Rank-4
    outputs become NCHW.

    :raises ModelFileError: when shapes differ from those given, or an operator is not supported.
    """
    input_shapes = [model.tensors[i].shape for i in model.inputs]
    if input_shapes != [input_shape]:
        raise ModelFileError(f"{model.name}: inputs {input_shapes}, expected {input_shape}.")
    for position, name, shape in outputs:
        found = model.tensors[model.outputs[position]].shape if position < len(model.outputs) else None
        if found != shape:
            raise ModelFileError(f"{model.name}: output {position} ({name}) has shape {found}, expected {shape}.")
    graph = Graph(model, fold_constants(model))
    graph.names[model.inputs[0]] = "input"
    kept = [model.outputs[position] for position, _, _ in outputs]
    for operator in _needed(model, kept):
        if operator.outputs[0] not in graph.constants:
            _append(graph, operator)
    described = []
    for tensor, (_, name, shape) in zip(kept, outputs, strict=True):
        graph.nodes.append(helper.make_node("Identity", [graph.value(tensor)], [name], name=f"output_{name}"))
        described.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, _batched(shape)))
    source = helper.make_tensor_value_info("input", TensorProto.FLOAT, _batched(input_shape))
    body = helper.make_graph(graph.nodes, model.name.rsplit("/", 1)[-1], [source], described, graph.initializers)
    result = helper.make_model(body, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="scope")
    result.ir_version = IR_VERSION
    try:
        onnx.checker.check_model(result, full_check=True)
    except (onnx.checker.ValidationError, onnx.shape_inference.InferenceError) as error:
        raise ModelFileError(f"{model.name}: the converted graph is not valid ONNX: {error}") from error
    return result


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
    order = (0, 3, 1, 2) if len(shape) == 4 else range(len(shape))
    return ["batch", *(shape[i] for i in list(order)[1:])]


def _needed(model: Model, outputs: list[int]) -> list[Operator]:
    """Return the operators on which the outputs depend, in file order, which is execution order."""
    wanted = set(outputs)
    kept = []
    for operator in reversed(model.operators):
        if wanted.intersection(operator.outputs):
            kept.append(operator)
            wanted.update(operator.inputs)
    return kept[::-1]
