# SPDX-License-Identifier: GPL-3.0-or-later
"""Networks that loop for ever, or take much memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from onnx import TensorProto, helper

from ...small_graphs import picture_input, save

LONGEST = np.array(2**62, np.int64)


def looping(path: Path, *, while_bright: bool = False) -> Path:
    """Write a network that loops for ever, for every image, or for those of which a pixel exceeds
    1000.
    """
    inside = [
        helper.make_node("Identity", ["go"], ["go_on"]),
        helper.make_node("Sin", ["x"], ["y"]),
    ]
    body = helper.make_graph(
        inside,
        "body",
        [
            helper.make_tensor_value_info("i", TensorProto.INT64, []),
            helper.make_tensor_value_info("go", TensorProto.BOOL, []),
            helper.make_tensor_value_info("x", TensorProto.FLOAT, None),
        ],
        [
            helper.make_tensor_value_info("go_on", TensorProto.BOOL, []),
            helper.make_tensor_value_info("y", TensorProto.FLOAT, None),
        ],
    )
    nodes = [
        helper.make_node("ReduceMax", ["images"], ["most"], keepdims=0),
        helper.make_node("Greater", ["most", "threshold"], ["start"]),
        helper.make_node("Loop", ["longest", "start", "images"], ["out"], body=body),
    ]
    out = helper.make_tensor_value_info("out", TensorProto.FLOAT, [1, 3, 32, 32])
    threshold = np.array(1000.0 if while_bright else -1.0, np.float32)
    return save(
        path, nodes, [picture_input(32, 32)], [out], {"longest": LONGEST, "threshold": threshold}
    )


def greedy(path: Path) -> Path:
    """Write a network that takes a quarter of a gigabyte for every image."""
    nodes = [
        helper.make_node("ConstantOfShape", ["shape"], ["much"]),
        helper.make_node("ReduceMax", ["much"], ["zero"]),
        helper.make_node("Add", ["images", "zero"], ["out"]),
    ]
    out = helper.make_tensor_value_info("out", TensorProto.FLOAT, [1, 3, 32, 32])
    shape = np.array([1, 1, 1, 1 << 26], np.int64)
    return save(path, nodes, [picture_input(32, 32)], [out], {"shape": shape})
