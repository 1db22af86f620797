# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the network as ONNX, and read it again.

Matrices are 8-bit integers times a scale per row, W ≈ s q with s = max |W| / 127, multiplied once,
when the network is opened; the rest is in single precision.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from ...scope_addon.atomic_write import atomic_path
from ...scope_addon.capture.perception.landmark_network import KEYPOINT_COUNT
from ...scope_addon.capture.perception.lifter import INPUT_SIZE, WINDOW
from .network import LOG_SIGMA_RANGE, MERGES, LiftingNetwork

OPSET = 17
SIGMA_BIAS = 3.0  # which the network subtracts from log σ


class _Graph:
    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.weights: list[onnx.TensorProto] = []

    def constant(self, name: str, value: NDArray[Any]) -> str:
        self.weights.append(numpy_helper.from_array(np.asarray(value, order="C"), name))
        return name

    def add(self, kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        self.nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    def linear(
        self, x: str, name: str, weight: NDArray[np.float32], bias: NDArray[np.float32]
    ) -> str:
        rounded, scale = quantized(weight)
        whole = self.add(
            "Cast",
            [self.constant(f"{name}.weight", rounded)],
            f"{name}.whole",
            to=TensorProto.FLOAT,
        )
        single = self.add("Mul", [whole, self.constant(f"{name}.scale", scale)], f"{name}.weight32")
        return self.add("Gemm", [x, single, self.constant(f"{name}.bias", bias)], name, transB=1)

    def reshape(self, x: str, name: str, *shape: int) -> str:
        return self.add(
            "Reshape", [x, self.constant(f"{name}.shape", np.array(shape, np.int64))], name
        )

    def norm(self, x: str, name: str, layer: torch.nn.LayerNorm) -> str:
        scale, bias = (
            self.constant(f"{name}.{k}", getattr(layer, k).detach().numpy())
            for k in ("weight", "bias")
        )
        return self.add("LayerNormalization", [x, scale, bias], name, axis=-1, epsilon=layer.eps)


def quantized(weight: NDArray[np.float32]) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Return the matrix (n, m) as whole numbers -127..127 and the scale (n, 1) of each row."""
    scale = np.maximum(np.abs(weight).max(axis=1, keepdims=True), 1e-12) / 127
    return np.round(weight / scale).astype(np.int8), scale.astype(np.float32)


def export(network: LiftingNetwork, path: Path) -> None:
    """Write ``network``; the input's normalization becomes part of the first layer."""
    network = network.float().eval()
    g = _Graph()
    array = lambda tensor: tensor.detach().numpy().astype(np.float32)  # noqa: E731
    x = g.add("Sub", ["input", g.constant("mean", array(network.mean))], "centred")
    x = g.add("Div", [x, g.constant("spread", array(network.spread))], "normalized")
    width = network.leave.in_features
    moments = WINDOW
    x = g.reshape(x, "rows", -1, INPUT_SIZE)
    x = g.linear(x, "enter", array(network.enter.weight), array(network.enter.bias))
    for k, merge in enumerate(network.merges):
        y = g.norm(x, f"merge_norm{k}", merge.norm)
        y = g.reshape(y, f"together{k}", -1, 3 * width)
        y = g.linear(y, f"merge_first{k}", array(merge.first.weight), array(merge.first.bias))
        y = g.add("Relu", [y], f"merge_relu{k}")
        y = g.linear(y, f"merge_second{k}", array(merge.second.weight), array(merge.second.bias))
        x = g.reshape(x, f"threes{k}", -1, 3, width)
        middle = g.constant(f"middle{k}", np.array(1, np.int64))
        x = g.add("Gather", [x, middle], f"middles{k}", axis=1)
        x = g.add("Add", [x, y], f"merged{k}")
        moments //= 3
    assert moments == 1
    for k, block in enumerate(network.blocks):
        y = g.norm(x, f"norm{k}", block.norm)
        y = g.linear(y, f"first{k}", array(block.first.weight), array(block.first.bias))
        y = g.add("Relu", [y], f"relu{k}")
        y = g.linear(y, f"second{k}", array(block.second.weight), array(block.second.bias))
        x = g.add("Add", [x, y], f"sum{k}")
    x = g.norm(x, "norm", network.norm)
    weight = array(network.leave.weight)
    bias = array(network.leave.bias)
    n = KEYPOINT_COUNT * 3
    points = g.linear(x, "flat_points", weight[:n], bias[:n])
    g.add(
        "Reshape", [points, g.constant("points_shape", np.array([-1, KEYPOINT_COUNT, 3]))], "points"
    )
    sigma = g.linear(x, "flat_sigma", weight[n:], bias[n:] - SIGMA_BIAS)
    sigma = g.add(
        "Reshape",
        [sigma, g.constant("sigma_shape", np.array([-1, KEYPOINT_COUNT, 2]))],
        "sigma_raw",
    )
    low, high = (
        g.constant(f"sigma_limit{k}", np.array(v, np.float32))
        for k, v in enumerate(LOG_SIGMA_RANGE)
    )
    sigma = g.add("Clip", [sigma, low, high], "sigma_clipped")
    g.add("Add", [sigma, g.constant("sigma_offset", array(network.sigma_offset))], "log_sigma")
    graph = helper.make_graph(
        g.nodes,
        "lifter",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, ["n", WINDOW, INPUT_SIZE])],
        [
            helper.make_tensor_value_info("points", TensorProto.FLOAT, ["n", KEYPOINT_COUNT, 3]),
            helper.make_tensor_value_info("log_sigma", TensorProto.FLOAT, ["n", KEYPOINT_COUNT, 2]),
        ],
        g.weights,
    )
    opset = [helper.make_opsetid("", OPSET)]
    model = helper.make_model(graph, producer_name="scope", opset_imports=opset, ir_version=8)
    onnx.checker.check_model(model, full_check=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        onnx.save(model, str(temporary))


def read_exported(path: Path) -> LiftingNetwork:
    """Read a network that `export` has written.

    :raises KeyError: it is not such a network.
    """
    found = {
        w.name: np.array(numpy_helper.to_array(w)) for w in onnx.load(str(path)).graph.initializer
    }
    found |= {
        name: found[name] * found[name.removesuffix("weight") + "scale"]
        for name in found
        if found[name].dtype == np.int8
    }
    blocks = sum(name.startswith("first") and name.endswith(".weight") for name in found)
    network = LiftingNetwork(len(found["enter.bias"]), blocks)
    names = {
        f"merges.{k}.{part}": f"merge_{part}{k}"
        for k in range(MERGES)
        for part in ("norm", "first", "second")
    }
    names |= {
        f"blocks.{k}.{part}": f"{part}{k}"
        for k in range(blocks)
        for part in ("norm", "first", "second")
    }
    state = {name: found[name] for name in ("mean", "spread", "sigma_offset")}
    for ours, theirs in (names | {"enter": "enter", "norm": "norm"}).items():
        state |= {f"{ours}.{kind}": found[f"{theirs}.{kind}"] for kind in ("weight", "bias")}
    state["leave.weight"] = np.concatenate(
        [found["flat_points.weight"], found["flat_sigma.weight"]]
    )
    state["leave.bias"] = np.concatenate(
        [found["flat_points.bias"], found["flat_sigma.bias"] + SIGMA_BIAS]
    )
    network.load_state_dict(
        {name: torch.from_numpy(array.astype(np.float32)) for name, array in state.items()}
    )
    return network
