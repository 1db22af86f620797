# SPDX-License-Identifier: GPL-3.0-or-later
"""Small ONNX graphs with the inputs and outputs of real networks, and known results.

Detectors return constants. Keypoint networks detect colours: keypoint k is the brightest place of
the picture's colour k mod 3 (red, green, blue), so that the picture and the way back from it are
tested with them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

OPSET = 17


def save(
    path: Path,
    nodes: list,
    inputs: list,
    outputs: list,
    constants: dict[str, np.ndarray] | None = None,
) -> Path:
    weights = [numpy_helper.from_array(value, name) for name, value in (constants or {}).items()]
    graph = helper.make_graph(nodes, "ours", inputs, outputs, weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=8)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path


def picture_input(
    width: int | str, height: int | str, kind: int = TensorProto.FLOAT
) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info("images", kind, [1, 3, height, width])


def fixed(path: Path, width: int | str, height: int | str, outputs: dict[str, np.ndarray]) -> Path:
    """Write a graph that returns these arrays for any input."""
    nodes = []
    constants = {}
    for name, value in outputs.items():
        constants[f"{name}_value"] = value
        nodes.append(helper.make_node("Identity", [f"{name}_value"], [name]))
    infos = [
        helper.make_tensor_value_info(
            name, helper.np_dtype_to_tensor_dtype(value.dtype), value.shape
        )
        for name, value in outputs.items()
    ]
    return save(path, nodes, [picture_input(width, height)], infos, constants)


def _colours(count: int) -> tuple[list, dict[str, np.ndarray]]:
    """Create the node that selects each keypoint's channel, ``seen`` (1, count, H, W)."""
    node = helper.make_node("Gather", ["images", "channel"], ["seen"], axis=1)
    return [node], {"channel": np.arange(count, dtype=np.int64) % 3}


def simcc(path: Path, count: int, width: int, height: int, ratio: float = 2.0) -> Path:
    """Write an RTMPose graph: bin b of an axis is the maximum of column or row b / ratio, linearly
    interpolated.
    """
    nodes, constants = _colours(count)
    constants["scales"] = np.array([1.0, 1.0, ratio], np.float32)
    for name, axis in (("simcc_x", 2), ("simcc_y", 3)):
        nodes += [
            helper.make_node("ReduceMax", ["seen"], [f"{name}_max"], axes=[axis], keepdims=0),
            helper.make_node(
                "Resize",
                [f"{name}_max", "", "scales"],
                [name],
                mode="linear",
                coordinate_transformation_mode="asymmetric",
            ),
        ]
    infos = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, count, round(size * ratio)])
        for name, size in (("simcc_x", width), ("simcc_y", height))
    ]
    return save(path, nodes, [picture_input(width, height)], infos, constants)


def heatmaps(path: Path, count: int, width: int, height: int, stride: int = 4) -> Path:
    """Write an HRNet graph: cell c is the mean of the image around pixel c · stride."""
    nodes, constants = _colours(count)
    nodes.append(
        helper.make_node(
            "AveragePool",
            ["seen"],
            ["heatmaps"],
            kernel_shape=[5, 5],
            strides=[stride, stride],
            pads=[2, 2, 1, 1],
            count_include_pad=1,
        )
    )
    shape = [1, count, height // stride, width // stride]
    info = helper.make_tensor_value_info("heatmaps", TensorProto.FLOAT, shape)
    return save(path, nodes, [picture_input(width, height)], [info], constants)
