# SPDX-License-Identifier: GPL-3.0-or-later
"""The TFLite operators of convolutional networks, each function appending the ONNX nodes that
compute the same.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arithmetic import ARITHMETIC
from .graph import Graph, SpatialPad
from .layout import LAYOUT
from .tflite import PADDINGS, Operator


def _window_pads(
    graph: Graph, operator: Operator, size: tuple[int, ...], kernel: tuple[int, ...]
) -> list[int]:
    """Return ONNX pads [top, left, bottom, right] of a sliding window over an input of ``size``
    (height, width).

    SAME: the output has ceil(n / stride) rows; the missing max((out − 1)·stride + reach − n, 0)
    rows are split in two, with the odd row at the end. VALID: none.
    """
    options = operator.options
    if (
        PADDINGS.get(options["padding"]) is None
        or min(options["stride_h"], options["stride_w"]) < 1
    ):
        raise graph.fail(
            operator,
            f"padding {options['padding']}, stride {options['stride_h']} x {options['stride_w']}",
        )
    if PADDINGS[options["padding"]] == "VALID":
        return [0, 0, 0, 0]
    before = []
    after = []
    for n, k, axis in zip(size, kernel, "hw", strict=True):
        stride = options[f"stride_{axis}"]
        reach = (k - 1) * options.get(f"dilation_{axis}_factor", 1) + 1
        missing = max((-(-n // stride) - 1) * stride + reach - n, 0)
        before.append(missing // 2)
        after.append(missing - missing // 2)
    return before + after


def _convolution(graph: Graph, operator: Operator, weights: NDArray[Any], groups: int) -> None:
    """Append a convolution with ``weights`` (out, in / groups, height, width) and the input's
    pending padding.
    """
    source = operator.inputs[0]
    kernel = weights.shape[2:]
    if len(graph.shape(source)) != 4 or weights.shape[1] * groups != graph.shape(source)[3]:
        raise graph.fail(
            operator, f"weights {weights.shape} do not fit the input {graph.shape(source)}"
        )
    pads = _window_pads(graph, operator, graph.shape(source)[1:3], kernel)
    if source in graph.pads and source not in graph.names:
        pending = graph.pads[source]
        source = pending.source
        extra = (pending.top, pending.left, pending.bottom, pending.right)
        pads = [a + b for a, b in zip(pads, extra, strict=True)]
    inputs = [graph.value(source), graph.initializer(weights)]
    if len(operator.inputs) > 2 and operator.inputs[2] >= 0:
        inputs.append(graph.initializer(graph.constant(operator, 2)))
    options = operator.options
    name = graph.node(
        "Conv",
        inputs,
        kernel_shape=list(kernel),
        strides=[options["stride_h"], options["stride_w"]],
        dilations=[options["dilation_h_factor"], options["dilation_w_factor"]],
        pads=pads,
        group=groups,
    )
    graph.finish(operator, name)


def conv_2d(graph: Graph, operator: Operator) -> None:
    """Convert a convolution; weights (out, height, width, in)."""
    weights = graph.constant(operator, 1)
    if weights.ndim != 4:
        raise graph.fail(operator, f"weights of shape {weights.shape}")
    _convolution(graph, operator, weights.transpose(0, 3, 1, 2), 1)


def depthwise_conv_2d(graph: Graph, operator: Operator) -> None:
    """Convert a depthwise convolution; weights (1, height, width, channels · multiplier)."""
    weights = graph.constant(operator, 1)
    if weights.ndim != 4 or weights.shape[0] != 1:
        raise graph.fail(operator, f"weights of shape {weights.shape}")
    _convolution(
        graph, operator, weights.transpose(3, 0, 1, 2), graph.shape(operator.inputs[0])[-1]
    )


def pad(graph: Graph, operator: Operator) -> None:
    """Convert zero padding; padding of rows and columns alone is left to the following
    convolutions.

    If ``graph.blocked``, channels are appended by a convolution, because onnxruntime's blocked
    layout has no Pad.
    """
    amounts = graph.constant(operator, 1)
    if amounts.shape != (4, 2) or (amounts < 0).any():
        raise graph.fail(operator, f"paddings {amounts.tolist()}")
    (n0, n1), (top, bottom), (left, right), (c0, c1) = amounts.tolist()
    if n0 == n1 == c0 == c1 == 0:
        graph.pads[operator.outputs[0]] = SpatialPad(operator.inputs[0], top, left, bottom, right)
        return
    source = graph.value(operator.inputs[0])
    if graph.blocked and n0 == n1 == c0 == top == left == bottom == right == 0:
        channels = graph.shape(operator.inputs[0])[3]
        weights = np.eye(channels + c1, channels, dtype=np.float32)[:, :, None, None]
        graph.finish(
            operator,
            graph.node("Conv", [source, graph.initializer(weights)], kernel_shape=[1, 1], group=1),
        )
        return
    onnx_order = np.array([n0, c0, top, left, n1, c1, bottom, right], np.int64)
    graph.finish(operator, graph.node("Pad", [source, graph.initializer(onnx_order)]))


def max_pool_2d(graph: Graph, operator: Operator) -> None:
    """Convert max pooling; in both formats, padding never is the maximum."""
    options = operator.options
    kernel = (options["filter_height"], options["filter_width"])
    pads = _window_pads(graph, operator, graph.shape(operator.inputs[0])[1:3], kernel)
    strides = [options["stride_h"], options["stride_w"]]
    name = graph.node(
        "MaxPool",
        [graph.value(operator.inputs[0])],
        kernel_shape=list(kernel),
        strides=strides,
        pads=pads,
    )
    graph.finish(operator, name)


def resize_bilinear(graph: Graph, operator: Operator) -> None:
    """Convert a bilinear resize with the sampling grid of the options."""
    (_, h_in, w_in, _) = graph.shape(operator.inputs[0])
    (_, h_out, w_out, _) = graph.shape(operator.outputs[0])
    if operator.options["align_corners"]:
        grid = "align_corners"
    else:
        grid = "half_pixel" if operator.options["half_pixel_centers"] else "asymmetric"
    scales = graph.initializer(np.array([1, 1, h_out / h_in, w_out / w_in], np.float32))
    inputs = [graph.value(operator.inputs[0]), "", scales]
    graph.finish(
        operator, graph.node("Resize", inputs, mode="linear", coordinate_transformation_mode=grid)
    )


def depth_to_space(graph: Graph, operator: Operator) -> None:
    """Convert depth to space; TFLite's depth is ordered by block row, block column and channel,
    ONNX's mode DCR.
    """
    block = operator.options["block_size"]
    name = graph.node(
        "DepthToSpace", [graph.value(operator.inputs[0])], blocksize=block, mode="DCR"
    )
    graph.finish(operator, name)


def prelu(graph: Graph, operator: Operator) -> None:
    """Convert PReLU: x where positive, slope · x elsewhere; slopes (1, 1, channels)."""
    slope = graph.constant(operator, 1)
    if slope.ndim != 3:
        raise graph.fail(operator, f"slopes of shape {slope.shape}")
    inputs = [graph.value(operator.inputs[0]), graph.initializer(slope.transpose(2, 0, 1))]
    graph.finish(operator, graph.node("PRelu", inputs))


def fully_connected(graph: Graph, operator: Operator) -> None:
    """Convert x Wᵀ + b with W (out, in); the input is flattened in TFLite order."""
    weights = graph.constant(operator, 1)
    if weights.ndim != 2 or operator.options["weights_format"] or operator.options["keep_num_dims"]:
        raise graph.fail(
            operator, f"weights of shape {weights.shape} or a layout that is not supported"
        )
    flat = graph.node("Flatten", [graph.channels_last(operator.inputs[0])])
    inputs = [flat, graph.initializer(weights)]
    if len(operator.inputs) > 2 and operator.inputs[2] >= 0:
        inputs.append(graph.initializer(graph.constant(operator, 2)))
    graph.finish(operator, graph.node("Gemm", inputs, transB=1))


CONVERTERS: dict[str, Callable[[Graph, Operator], None]] = {
    **ARITHMETIC,
    **LAYOUT,
    "CONV_2D": conv_2d,
    "DEPTHWISE_CONV_2D": depthwise_conv_2d,
    "DEPTH_TO_SPACE": depth_to_space,
    "FULLY_CONNECTED": fully_connected,
    "MAX_POOL_2D": max_pool_2d,
    "PAD": pad,
    "PRELU": prelu,
    "RESIZE_BILINEAR": resize_bilinear,
}
